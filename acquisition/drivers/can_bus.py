"""Spindle speed, joint angles and other values from a CAN bus, through python-can, decoded with a DBC file."""

import os
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from millfrf.core import FileFormatError, InputError

from ..errors import DeviceTimeout, Disconnected, DriverMissing
from ..sources.receiving import Put, ThreadedFeed
from ..sources.source import EventAxis, Events
from ..sources.timing import Stamped, SteadyStamps, WallClock
from .serial_lines import LINE_FAILURES

_POLL = 0.1


@dataclass(frozen=True)
class CanSignal:
    """One signal of the DBC file as a series of events.

    Parameters
    ----------
    signal
        Its name in the DBC file: ``Speed``, or ``Message.Speed`` where several messages have a signal of that name.
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
        The file cannot be read, lacks a signal, or has it in several messages; two signals share a series.
    """

    def __init__(self, path: str | os.PathLike[str], signals: Sequence[CanSignal]) -> None:
        database = _database(path)
        self._messages: dict[tuple[int, bool], Any] = {}
        self._wanted: dict[tuple[int, bool], list[tuple[str, CanSignal]]] = {}
        for wanted in signals:
            message, name = _found(database.messages, wanted.signal, Path(path).name)
            identifier = (message.frame_id, bool(message.is_extended_frame))
            self._messages[identifier] = message
            self._wanted.setdefault(identifier, []).append((name, wanted))
        series = [wanted.name for wanted in signals]
        twice = sorted({name for name in series if series.count(name) > 1})
        if twice:
            raise InputError(f"{Path(path).name}: series {', '.join(twice)} is given to two signals; give unique names")

    def decode(self, frame_id: int, data: bytes, *, extended: bool = False) -> list[tuple[str, float]]:
        """Series and values in a message; none where it is not wanted or not whole.

        A standard identifier (11 bits) and an extended one (29 bits) of one number are two messages.
        """
        identifier = (frame_id, extended)
        if identifier not in self._messages:
            return []
        try:
            values = self._messages[identifier].decode(data, decode_choices=False)
        except Exception:  # a broken frame on the bus must not end a recording
            return []
        found = self._wanted[identifier]
        return [(each.name, float(values[name]) * each.factor) for name, each in found if name in values]


def _database(path: str | os.PathLike[str]) -> Any:
    try:
        import cantools
    except ImportError as error:
        raise DriverMissing("CAN needs the package cantools; pip install millfrf[devices]") from error
    try:
        return cantools.database.load_file(os.fspath(path))
    except OSError as error:
        raise InputError(f"no DBC file {path}; check the name") from error
    except Exception as error:  # cantools raises errors of its own and of its parsers
        raise FileFormatError(f"{path} is not a DBC file: {' '.join(str(error).split())}") from error


def _found(messages: Sequence[Any], wanted: str, file: str) -> tuple[Any, str]:
    """The message that holds a signal, and the signal's name within it.

    Raises
    ------
    InputError
        No message has it, or several have it.
    """
    there = [(message, signal.name) for message in messages for signal in message.signals]
    match = [(message, name) for message, name in there if wanted in (name, f"{message.name}.{name}")]
    if not match:
        known = ", ".join(sorted({name for _, name in there})[:20])
        raise InputError(f"{file} has no signal {wanted!r}; it has {known}")
    if len(match) > 1:
        choices = ", ".join(f"{message.name}.{name}" for message, name in match)
        raise InputError(f"{file} has the signal {wanted!r} in {len(match)} messages; name one of {choices}")
    return match[0]


class CanFeed(ThreadedFeed):
    """A CAN bus as a feed of events, with the interface's own time stamps.

    Stamps of interfaces that take the computer's wall clock follow its steps; these are taken out and noted.

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
        self._stamps = SteadyStamps()

    def _connect(self) -> None:
        self._stamps = SteadyStamps()
        self._reconnect()

    def _reconnect(self) -> None:
        try:
            import can
        except ImportError as error:
            raise DriverMissing(f"{self.where}: needs python-can; pip install millfrf[devices]") from error
        try:
            self._bus = can.Bus(**self._arguments)
        except can.CanInterfaceNotImplementedError as error:
            raise DriverMissing(f"{self.where}: {error}; install the interface's driver") from error
        except (can.CanError, OSError, ValueError, TypeError) as error:
            raise Disconnected(f"{self.where} cannot be opened: {error}; check its name and plug") from error

    def _receive(self, put: Put, stopped: Callable[[], bool]) -> None:
        heard, wall_clock = time.monotonic(), WallClock()
        try:
            while not stopped():
                message = self._message()
                arrival = time.monotonic()
                step = wall_clock.step()
                if step:
                    self._stamps.announce(step, arrival)
                for one in self._values(message, arrival):
                    heard = arrival
                    self._put(self._stamps.add(one), put)
                if arrival - heard > self._silence:
                    what = f"no wanted message for {self._silence:g} s; check bus, bitrate and DBC file"
                    raise DeviceTimeout(f"{self.where}: {what}", heard)
        finally:
            self._put(self._stamps.flush(), put)

    def _message(self) -> Any:
        """The next message, or None where none comes in a tenth of a second."""
        import can

        try:
            return self._bus.recv(_POLL)
        except (can.CanError, ValueError, *LINE_FAILURES) as error:
            raise Disconnected(f"{self.where} is gone ({error}); check its plug") from error

    def _values(self, message: Any, arrival: float) -> list[Stamped]:
        if message is None or message.is_error_frame or message.is_remote_frame:
            return []
        extended = bool(message.is_extended_id)
        values = self._decoder.decode(message.arbitration_id, bytes(message.data), extended=extended)
        return [Stamped(name, value, message.timestamp or arrival, arrival) for name, value in values]

    def _put(self, clear: Sequence[Stamped], put: Put) -> None:
        for at, step in self._stamps.steps():
            self.note(f"clock of its stamps stepped by {step:+.3f} s, taken out", at)
        for one in clear:
            put(Events(one.series, np.array([one.stamp]), np.array([one.value]), np.array([one.arrival])))

    def _release(self) -> None:
        bus, self._bus = self._bus, None
        if bus is not None:
            with suppress(Exception):  # interfaces that are gone raise whatever they like
                bus.shutdown()
