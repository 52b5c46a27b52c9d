"""`CellMessages`: the state of a cut as MQTT messages for the controller of a cell."""

import json
import math
import time
from importlib import import_module
from typing import Any

from millfrf.core import InputError

from .chatter_watch import Announcement

_PORT = 1883  # of MQTT without encryption, as registered
_PATIENCE = 5.0  # s; for a connection, and for the last message


class CellMessages:
    """A connection to an MQTT broker; each announcement is one retained JSON message of one topic.

    Parameters
    ----------
    broker
        Host of the broker, or ``host:port``.
    topic
        Topic of the messages.

    Raises
    ------
    InputError
        No client library, a port that is no number, or no broker at the address.
    """

    def __init__(self, broker: str, topic: str) -> None:
        client = _client_library()
        host, _, port = broker.partition(":")
        if port and not port.isdigit():
            raise InputError(f"--mqtt {broker}: the port {port!r} is no number; write it as broker.local:1883")
        self._topic, self._last = topic, None
        self._client = client.Client(client.CallbackAPIVersion.VERSION2)
        self._client.connect_timeout = _PATIENCE
        try:
            self._client.connect(host, int(port or _PORT))
        except (OSError, ValueError) as error:
            raise InputError(
                f"--mqtt {broker}: no MQTT broker answers ({error}); start it, or leave --mqtt out"
            ) from error
        self._client.loop_start()  # the library connects again where the broker was lost, and then sends what waited

    def __call__(self, announcement: Announcement) -> None:
        """Send an announcement; it waits where the broker is lost."""
        text = json.dumps(message_of(announcement), allow_nan=False)
        self._last = self._client.publish(self._topic, text, qos=1, retain=True)

    def close(self) -> None:
        """Wait for the last message, and disconnect."""
        latest = time.monotonic() + _PATIENCE
        while self._last is not None and not self._last.is_published() and time.monotonic() < latest:
            time.sleep(0.02)
        self._client.disconnect()
        self._client.loop_stop()


def message_of(announcement: Announcement) -> dict[str, Any]:
    """Return the content of a message; a number that is not known is None.

    Examples
    --------
    >>> told = Announcement(12.4, "hopf", 850.2, 6900.0, (6376.5, 12753.0), "the line at 850.20 Hz grows", 1e-30)
    >>> message_of(told)["state"], message_of(told)["proposed_spindle_speeds_rpm"]
    ('hopf', [6376.5, 12753.0])
    """
    return {
        "state": announcement.state,
        "time_s": round(announcement.time, 3),
        "frequency_hz": None if math.isnan(announcement.frequency) else announcement.frequency,
        "other_frequency_hz": None if math.isnan(announcement.side_line) else announcement.side_line,
        "spindle_speed_rpm": None if math.isnan(announcement.spindle_speed_rpm) else announcement.spindle_speed_rpm,
        "proposed_spindle_speeds_rpm": list(announcement.proposed_rpm),
        "p_value": announcement.p_value,
        "reason": announcement.reason,
    }


def _client_library() -> Any:
    try:
        return import_module("paho.mqtt.client")
    except ImportError as error:
        raise InputError('--mqtt needs the library paho-mqtt; run pip install "millfrf[live]"') from error
