"""Spindle speed, joint angles and other values from a CAN bus, through python-can, decoded with a DBC file."""

import os
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from foundation import FileFormatError, InputError

from ..errors import DeviceTimeout, Disconnected, DriverMissing
from ..sources.events import EventAxis, Events
from ..sources.receiver import Put
from ..sources.threaded_feed import ThreadedFeed
from .serial_line import LINE_FAILURES

_POLL = 0.1


@dataclass(frozen=True)
class CanSignal:
    """One signal of the DBC file as a series of events.

    Parameters
    ----------
    signal
        Its name in the DBC file.
    series
        Its name in the recording; empty: the same.
    factor
        Multiplies the decoded value, to SI units (or rpm where the series' name says so).
    """

    signal: str
    series: str = ""
    factor: float = 1.0

    @property
    def name(self) -> str:
        """Its name in the recording."""
        return self.series or self.signal


class DbcDecoder:
    """The wanted signals of a DBC file.

    Parameters
    ----------
    path
        DBC file (or another that cantools reads).
    signals
        Names of the signals to keep.

    Raises
    ------
    DriverMissing
        cantools is not installed.
    FileFormatError, InputError
        The file cannot be read, or lacks a signal.
    """

    def __init__(self, path: str | os.PathLike[str], signals: Sequence[CanSignal]) -> None:
        try:
            import cantools
        except ImportError as error:
            raise DriverMissing("CAN needs the package cantools; pip install millfrf[devices]") from error
        try:
            database: Any = cantools.database.load_file(os.fspath(path))
        except OSError as error:
            raise InputError(f"no DBC file {path}; check the name") from error
        except Exception as error:  # cantools raises errors of its own and of its parsers
            raise FileFormatError(f"{path} is not a DBC file: {' '.join(str(error).split())}") from error
        self._messages: dict[int, Any] = {}
        self._wanted: dict[int, list[CanSignal]] = {}
        there = {signal.name: message for message in database.messages for signal in message.signals}
        for wanted in signals:
            if wanted.signal not in there:
                known = ", ".join(sorted(there)[:20])
                raise InputError(f"{Path(path).name} has no signal {wanted.signal!r}; it has {known}")
            message = there[wanted.signal]
            self._messages[message.frame_id] = message
            self._wanted.setdefault(message.frame_id, []).append(wanted)

    def decode(self, frame_id: int, data: bytes) -> list[tuple[str, float]]:
        """Series and values in a message; none where it is not wanted or not whole."""
        if frame_id not in self._messages:
            return []
        try:
            values = self._messages[frame_id].decode(data, decode_choices=False)
        except Exception:  # a broken frame on the bus must not end a recording
            return []
        found = self._wanted[frame_id]
        return [(each.name, float(values[each.signal]) * each.factor) for each in found if each.signal in values]


class CanFeed(ThreadedFeed):
    """A CAN bus as a feed of events, with the interface's own time stamps.

    Parameters
    ----------
    interface, channel
        Names of interface and channel in python-can: ``socketcan`` and ``can0``; ``pcan`` and ``PCAN_USBBUS1`` ...
    dbc
        The bus's DBC file.
    signals
        Names of the signals to keep.
    silence : s
        Time without a wanted message after which the bus counts as lost.
    options
        Further arguments of `can.Bus`: ``bitrate``, ``port`` ...

    Raises
    ------
    DriverMissing, FileFormatError, InputError
    """

    def __init__(
        self,
        interface: str,
        channel: str,
        dbc: str | os.PathLike[str],
        signals: Sequence[CanSignal],
        *,
        silence: float = 2.0,
        options: Mapping[str, Any] | None = None,
    ) -> None:
        self._decoder = DbcDecoder(dbc, signals)
        axis = EventAxis("device", f"{interface}:{channel}")
        super().__init__(f"CAN bus {interface} {channel}", {signal.name: axis for signal in signals})
        self._arguments = {"interface": interface, "channel": channel, **(options or {})}
        self._silence = silence
        self._bus: Any = None

    def _connect(self) -> None:
        try:
            import can
        except ImportError as error:
            raise DriverMissing(f"{self._where}: needs python-can; pip install millfrf[devices]") from error
        try:
            self._bus = can.Bus(**self._arguments)
        except can.CanInterfaceNotImplementedError as error:
            raise DriverMissing(f"{self._where}: {error}; install the interface's driver") from error
        except (can.CanError, OSError, ValueError, TypeError) as error:
            raise Disconnected(f"{self._where} cannot be opened: {error}; check its name and plug") from error

    def _receive(self, put: Put, stopped: Callable[[], bool]) -> None:
        import can

        heard = time.monotonic()
        while not stopped():
            try:
                message = self._bus.recv(_POLL)
            except (can.CanError, ValueError, *LINE_FAILURES) as error:
                raise Disconnected(f"{self._where} is gone ({error}); check its plug") from error
            arrival = time.monotonic()
            if message is not None and not (message.is_error_frame or message.is_remote_frame):
                for name, value in self._decoder.decode(message.arbitration_id, bytes(message.data)):
                    heard = arrival
                    put(_event(name, message.timestamp or arrival, value, arrival))
            if arrival - heard > self._silence:
                raise DeviceTimeout(
                    f"{self._where}: no wanted message for {self._silence:g} s; check bus, bitrate and DBC file"
                )

    def _release(self) -> None:
        bus, self._bus = self._bus, None
        if bus is not None:
            with suppress(Exception):  # interfaces that are gone raise whatever they like
                bus.shutdown()


def _event(name: str, stamp: float, value: float, arrival: float) -> Events:
    return Events(name, np.array([stamp]), np.array([value]), np.array([arrival]))
