"""Spindle speed, joint angles and other values from a CAN bus, through python-can, decoded with a DBC file."""

import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, Field

from millfrf.core import FileFormatError, InputError

from ..channels import STRICT, Name, Positive
from ..sources.source import DeviceTimeout, Disconnected, DriverMissing, EventAxis
from ..sources.threaded_feed import ThreadedFeed
from ..sources.timing import StampedValue, SteadyStamps, WallClock, to_events
from .serial_lines import LINE_FAILURES


class SignalTable(BaseModel):
    """One signal of a DBC file.

    Parameters
    ----------
    signal
        Name in the DBC file: ``Speed``, or ``Message.Speed`` if several messages have a signal of that name.
    series
        Name of the event series in the recording; empty: the same.
    factor
        Factor to SI units; to rpm for the series ``spindle_speed_rpm``, which ``chatter`` reads.
    """

    model_config = STRICT
    signal: Name
    series: str = ""
    factor: float = 1.0

    @property
    def series_name(self) -> str:
        return self.series or self.signal


class DbcDecoder:
    """Decoder of the selected signals of a DBC file, or of another format that cantools reads."""

    def __init__(self, path: Path, signals: Sequence[SignalTable]) -> None:
        database = _load_database(path)
        self._messages: dict[tuple[int, bool], Any] = {}
        self._signals: dict[tuple[int, bool], list[tuple[str, SignalTable]]] = {}
        for signal in signals:
            message, name = _find_signal(database.messages, signal.signal, path.name)
            # a standard identifier (11 bits) and an extended one (29 bits) of the same number are two messages
            identifier = (message.frame_id, bool(message.is_extended_frame))
            self._messages[identifier] = message
            self._signals.setdefault(identifier, []).append((name, signal))
        series = [signal.series_name for signal in signals]
        repeated = sorted({name for name in series if series.count(name) > 1})
        if repeated:
            raise InputError(f"{path.name}: series {', '.join(repeated)} is given to two signals; give unique names")

    def selects(self, frame_id: int, *, extended: bool = False) -> bool:
        """Return whether a message holds selected signals."""
        return (frame_id, extended) in self._messages

    def decode(self, frame_id: int, data: bytes, *, extended: bool = False) -> list[tuple[str, float]]:
        """Return series and values of a message; none if it is not selected or incomplete."""
        identifier = (frame_id, extended)
        if identifier not in self._messages:
            return []
        try:
            values = self._messages[identifier].decode(data, decode_choices=False)
        except Exception:  # a broken frame on the bus must not end a recording
            return []
        signals = self._signals[identifier]
        return [(s.series_name, float(values[name]) * s.factor) for name, s in signals if name in values]


def _load_database(path: Path) -> Any:
    try:
        import cantools  # optional: the extra `devices`
    except ImportError as error:
        raise DriverMissing("CAN needs the package cantools; pip install millfrf[devices]") from error
    try:
        return cantools.database.load_file(str(path))
    except OSError as error:
        raise InputError(f"no DBC file {path}; check the name") from error
    except Exception as error:  # cantools raises many kinds of errors, also of its parsers
        raise FileFormatError(f"{path} is not a DBC file: {' '.join(str(error).split())}") from error


def _find_signal(messages: Sequence[Any], signal: str, file: str) -> tuple[Any, str]:
    """Return the message with a signal, and the name of the signal in it."""
    signals = [(message, entry.name) for message in messages for entry in message.signals]
    matches = [(message, name) for message, name in signals if signal in (name, f"{message.name}.{name}")]
    if not matches:
        known = ", ".join(sorted({name for _, name in signals})[:20])
        raise InputError(f"{file} has no signal {signal!r}; it has {known}")
    if len(matches) > 1:
        choices = ", ".join(f"{message.name}.{name}" for message, name in matches)
        raise InputError(f"{file} has the signal {signal!r} in {len(matches)} messages; name one of {choices}")
    return matches[0]


class CanTable(BaseModel):
    """A CAN bus.

    Parameters
    ----------
    interface
        Interface as python-can names it, such as ``socketcan`` or ``pcan``.
    channel
        Channel of that interface, such as ``can0`` or ``PCAN_USBBUS1``.
    dbc
        DBC file of the bus, relative to the folder of the session file.
    signals
        Signals to keep.
    silence_s : s
        Time without a selected message after which the bus counts as lost.
    options
        Further arguments of the interface, such as ``bitrate``.
    """

    model_config = STRICT
    interface: Name
    channel: Name
    dbc: Name
    signals: Annotated[tuple[SignalTable, ...], Field(min_length=1)]
    silence_s: Positive = 2.0
    options: dict[str, Any] = Field(default_factory=dict)


class CanFeed(ThreadedFeed):
    """A CAN bus as a feed of events, with the interface's own time stamps.

    Some interfaces stamp with the host's wall clock; its steps are removed from the stamps and noted. ``folder`` is the
    folder of the session file.
    """

    def __init__(self, table: CanTable, folder: Path) -> None:
        self._decoder = DbcDecoder(folder / table.dbc, table.signals)
        axis = EventAxis("device", f"{table.interface}:{table.channel}")
        super().__init__(
            f"CAN bus {table.interface} {table.channel}", {signal.series_name: axis for signal in table.signals}
        )
        self._arguments = {"interface": table.interface, "channel": table.channel, **table.options}
        self._silence = table.silence_s
        self._bus: Any = None
        self._stamps = SteadyStamps()

    def _connect(self) -> None:
        self._stamps = SteadyStamps()
        self._reconnect()

    def _reconnect(self) -> None:
        try:
            import can  # optional: the extra `devices`
        except ImportError as error:
            raise DriverMissing(f"{self.where}: needs python-can; pip install millfrf[devices]") from error
        try:
            self._bus = can.Bus(**self._arguments)
        except can.CanInterfaceNotImplementedError as error:
            raise DriverMissing(f"{self.where}: {error}; install the interface's driver") from error
        except (can.CanError, OSError, ValueError, TypeError) as error:
            raise Disconnected(f"{self.where} cannot be opened: {error}; check its name and plug") from error

    def _receive(self) -> None:
        last_value, wall_clock = time.monotonic(), WallClock()
        try:
            while not self._stopped.is_set():
                message = self._next_message()
                arrival = time.monotonic()
                step = wall_clock.step()
                if step:
                    self._stamps.announce(step, arrival)
                for value in self._values(message, arrival):
                    last_value = arrival
                    self._put_clear(self._stamps.add(value))
                if arrival - last_value > self._silence:
                    reason = f"no selected message for {self._silence:g} s; check bus, bitrate and DBC file"
                    raise DeviceTimeout(f"{self.where}: {reason}", last_value)
        finally:
            self._put_clear(self._stamps.flush())

    def _next_message(self) -> Any:
        """Receive the next message; return None if none comes within a tenth of a second."""
        import can

        try:
            return self._bus.recv(0.1)
        except (can.CanError, ValueError, *LINE_FAILURES) as error:
            raise Disconnected(f"{self.where} is gone ({error}); check its plug") from error

    def _values(self, message: Any, arrival: float) -> list[StampedValue]:
        if message is None or message.is_error_frame or message.is_remote_frame:
            return []
        extended = bool(message.is_extended_id)
        if not self._decoder.selects(message.arbitration_id, extended=extended) or not self._inflow.admits(arrival):
            return []
        values = self._decoder.decode(message.arbitration_id, bytes(message.data), extended=extended)
        self._n_unreadable += not values
        return [StampedValue(name, value, message.timestamp or arrival, arrival) for name, value in values]

    def _put_clear(self, values: Sequence[StampedValue]) -> None:
        for step_time, step in self._stamps.steps():
            self.note(f"clock of its stamps stepped by {step:+.3f} s, removed", step_time)
        self._put(to_events(values))

    def _release(self) -> None:
        bus, self._bus = self._bus, None
        if bus is not None:
            with suppress(Exception):  # interfaces of lost devices raise any error
                bus.shutdown()
