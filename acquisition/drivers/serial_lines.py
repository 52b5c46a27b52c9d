"""Serial lines: instruments that send one number per line, and charge amplifiers that are set by commands."""

import re
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, Field

from millfrf.core import InputError

from ..channels import STRICT, Name, Positive
from ..sources.source import HOST_AXIS, DeviceError, DeviceTimeout, Disconnected, DriverMissing, EventAxis, Events
from ..sources.threaded_feed import ThreadedFeed
from ..sources.timing import StampedValue, SteadyStamps, to_events

Baud = Annotated[int, Field(ge=50, le=10_000_000)]
LINE_FAILURES: tuple[type[Exception], ...] = (OSError, TypeError)  # pyserial raises TypeError for a lost descriptor
try:
    import termios
except ImportError:  # Windows
    pass
else:
    LINE_FAILURES += (termios.error,)  # an error of the operating system that is no OSError

_NUMBER = r"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?"


def open_line(port: str, baud: int, timeout: float) -> Any:
    """Open a `serial.Serial`; ``timeout`` (s) is the longest time of one read or write."""
    try:
        import serial  # optional: the extra `devices`
    except ImportError as error:
        raise DriverMissing(f"serial line {port}: needs pyserial; pip install millfrf[devices]") from error
    try:
        return serial.Serial(port, baud, timeout=timeout, write_timeout=timeout)
    except ValueError as error:
        raise InputError(f"serial line {port}: {error}; check its settings") from error
    except OSError as error:
        raise Disconnected(f"serial line {port} cannot be opened: {error}; check its name and plug") from error


@contextmanager
def reporting_loss(port: str) -> Iterator[None]:
    """Raise `Disconnected` for every error that a line raises when its adapter is unplugged."""
    try:
        yield
    except LINE_FAILURES as error:
        raise Disconnected(f"serial line {port} is gone ({error}); check its plug") from error


class TachometerTable(BaseModel):
    """An instrument that sends one number per line.

    Parameters
    ----------
    port
        Serial line, such as ``COM3`` or ``/dev/ttyUSB0``.
    baud : bit/s
        Speed of the line.
    series
        Name of the event series in the recording.
    pattern
        Regular expression whose first group is the number; left out: the first number of the line.
    factor
        Factor to SI units; to rpm for the series ``spindle_speed_rpm``, which ``chatter`` reads.
    period_s : s
        Time between two lines if the instrument keeps it exactly; left out: the times of arrival are used.
    silence_s : s
        Time without a line after which the instrument counts as lost.
    """

    model_config = STRICT
    port: Name
    baud: Baud
    series: Name
    pattern: str | None = None
    factor: float = 1.0
    period_s: Positive | None = None
    silence_s: Positive = 3.0


class TachometerFeed(ThreadedFeed):
    """Feed of the numbers in the lines of text that an instrument sends.

    With ``period_s`` the instrument's clock is used, so that a busy host does not blur the times. Otherwise the time of
    a line is its time of arrival minus the duration of its transmission.
    """

    def __init__(self, table: TachometerTable) -> None:
        pattern = f"({_NUMBER})" if table.pattern is None else table.pattern
        try:
            self._pattern = re.compile(pattern)
        except re.error as error:
            raise InputError(
                f"serial line {table.port}: pattern {pattern!r} is not a regular expression: {error}"
            ) from error
        if not self._pattern.groups:
            raise InputError(f"serial line {table.port}: pattern {pattern!r} needs a group ( ) around the number")
        axis = HOST_AXIS if table.period_s is None else EventAxis("device", f"line:{table.port}")
        super().__init__(f"serial line {table.port}", {table.series: axis})
        self._table = table
        self._line: Any = None
        self._stamps = SteadyStamps()

    def _connect(self) -> None:
        self._stamps = SteadyStamps()
        self._reconnect()

    def _reconnect(self) -> None:
        self._line = open_line(self._table.port, self._table.baud, 0.1)

    def _receive(self) -> None:
        silence, port = self._table.silence_s, self._table.port
        pending, n_lines, last_line = b"", 0, time.monotonic()
        try:
            while not self._stopped.is_set():
                with reporting_loss(port):
                    received = self._line.read(max(1, self._line.in_waiting))
                arrival = time.monotonic()
                *lines, pending = (pending + received).replace(b"\r", b"\n").split(b"\n")
                pending = pending[-4096:]  # an instrument that sends no line end must not fill the memory
                for line in filter(None, lines):
                    n_lines, last_line = n_lines + 1, arrival
                    self._take(line, n_lines, arrival)
                if arrival - last_line > silence:
                    raise DeviceTimeout(
                        f"serial line {port}: nothing was received for {silence:g} s; check the instrument", last_line
                    )
        finally:
            self._put_clear(self._stamps.flush())

    def _take(self, line: bytes, count: int, arrival: float) -> None:
        if not self._inflow.admits(arrival):
            return
        match = self._pattern.search(line.decode("ascii", "replace"))
        try:
            value = float(match.group(1)) * self._table.factor if match else None
        except (TypeError, ValueError):  # the group took no part in the match, or is no number
            value = None
        if value is None:
            self._n_unreadable += 1
            return
        # 10 bits per byte: start bit, eight data bits, stop bit
        begun = arrival - (len(line) + 1) * 10 / self._table.baud
        if self._table.period_s is None:
            self._put([Events(self._table.series, np.array([begun]), np.array([value]))])
        else:
            stamped = StampedValue(self._table.series, value, count * self._table.period_s, begun)
            self._put_clear(self._stamps.add(stamped))

    def _put_clear(self, values: Sequence[StampedValue]) -> None:
        # The count of lines steps if lines were lost, or if the serial line was opened again.
        for step_time, step in self._stamps.steps():
            self.note(f"lines of {-step:.3f} s are missing; later times account for it", step_time)
        self._put(to_events(values))

    def _release(self) -> None:
        if self._line is not None:
            self._line.close()
            self._line = None


_PLACE = re.compile(r"\{(\w+)\}")
_RANGE = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"


class CommandTable(BaseModel):
    """One command to a charge amplifier, and its answer.

    Parameters
    ----------
    send
        Text to send; ``{fx}`` stands for the range of channel fx.
    expect
        Regular expression that the answer must match from its beginning, with ``{fx}`` for a range as in ``send``;
        empty: no answer is expected.
    wait_s : s
        Time to wait for the answer, or after a command without one.
    """

    model_config = STRICT
    send: Name
    expect: str = ""
    wait_s: Positive = 1.0

    @property
    def ranges(self) -> frozenset[str]:
        """Return the channels whose range is sent or expected.

        ``{2}`` in a regular expression is a repetition, no channel.
        """
        names = _PLACE.findall(self.send) + _PLACE.findall(self.expect)
        return frozenset(name for name in names if not name.isdigit())

    def with_ranges(self, ranges: Mapping[str, float]) -> "CommandTable":
        """Insert the ranges; an expected range becomes a group of the regular expression that matches any number."""
        send = _PLACE.sub(lambda place: f"{ranges[place[1]]:.10g}" if place[1] in ranges else place[0], self.send)
        expect = _PLACE.sub(lambda place: f"(?P<{place[1]}>{_RANGE})" if place[1] in ranges else place[0], self.expect)
        return self.model_copy(update={"send": send, "expect": expect})


class AmplifierTable(BaseModel):
    """A charge amplifier on a serial line. Channels refer to it by ``name``, or by its port if it has no name.

    Parameters
    ----------
    name
        Name by which channels refer to it; empty: its port.
    port
        Serial line of the amplifier.
    baud : bit/s
        Speed of the line.
    ending
        Characters at the end of each command.
    on_open
        Commands at the beginning of the recording; they are not sent again after the line was lost.
    on_close
        Commands at the end of the recording.
    check
        Queries with the answers that must come.
    check_every_s : s
        Time between two rounds of queries.
    """

    model_config = STRICT
    name: str = ""
    port: Name
    baud: Baud
    ending: str = "\r\n"
    on_open: tuple[CommandTable, ...] = ()
    on_close: tuple[CommandTable, ...] = ()
    check: tuple[CommandTable, ...] = ()
    check_every_s: Positive = 5.0

    @property
    def label(self) -> str:
        """Return the name of the amplifier, or its port."""
        return self.name or self.port

    def ranges_sent(self) -> frozenset[str]:
        """Return the channels whose range the commands send or expect."""
        return frozenset(name for command in (*self.on_open, *self.check) for name in command.ranges)


class Amplifier(ThreadedFeed):
    """A feed without events that sends commands when the recording begins and ends, and queries in between.

    A range is stated once, with its channel: it scales the samples, is sent to the amplifier and expected in its
    answers. If the line is lost during a cut, it is opened again and the queries are sent, but not the opening
    commands: a reset would falsify the forces.

    ``ranges`` holds the range of each channel by name, in the unit in which the amplifier takes it.
    """

    def __init__(self, table: AmplifierTable, ranges: Mapping[str, float]) -> None:
        super().__init__(f"amplifier on {table.port}", {})
        self._table, self._ranges = table, ranges
        self._on_open, self._on_close, self._check = (
            [self._prepared(command) for command in commands]
            for commands in (table.on_open, table.on_close, table.check)
        )
        self._line: Any = None

    def _prepared(self, command: CommandTable) -> CommandTable:
        unknown = sorted(name for name in command.ranges if name not in self._ranges)
        if unknown:
            raise InputError(
                f"{self.where}: {command.send!r} needs the range of {', '.join(unknown)}; give amplifier and "
                "amplifier_range with that channel"
            )
        prepared = command.with_ranges(self._ranges)
        try:
            re.compile(prepared.expect)
        except re.error as error:
            raise InputError(f"{self.where}: expect {command.expect!r} is not a pattern: {error}") from error
        return prepared

    def _connect(self) -> None:
        self._open_line([*self._on_open, *self._check])

    def _reconnect(self) -> None:
        self._open_line(self._check)

    def _open_line(self, commands: Sequence[CommandTable]) -> None:
        self._line = open_line(self._table.port, self._table.baud, 0.05)
        try:
            for command in commands:
                self._send(command)
        except BaseException:
            self._suspend()
            raise

    def _send(self, command: CommandTable) -> None:
        """Send a command and check its answer."""
        with reporting_loss(self._table.port):
            self._line.reset_input_buffer()
            self._line.write((command.send + self._table.ending).encode())
        if not command.expect:
            time.sleep(command.wait_s)  # a reset of a charge amplifier takes time
            return
        answer = self._answer(command)
        match = re.match(command.expect, answer)
        if match is None:
            raise DeviceError(
                f"{self.where} answered {answer!r} to {command.send!r}, expected {command.expect!r}; check its range "
                "and the command table"
            )
        for name, text in match.groupdict().items():
            expected = self._ranges[name]
            if abs(float(text) - expected) > 1e-6 * abs(expected):  # rounding of the printed number
                raise DeviceError(
                    f"{self.where} answered {answer!r} to {command.send!r}: the range of {name} is {float(text):g}, "
                    f"not {expected:g}; set it there or in the session"
                )

    def _answer(self, command: CommandTable) -> str:
        answer, deadline = b"", time.monotonic() + command.wait_s
        while not answer.endswith((b"\n", b"\r")) or not answer.strip():
            if time.monotonic() > deadline:
                raise DeviceTimeout(
                    f"{self.where} did not answer {command.send!r} within {command.wait_s:g} s; check power, cable and "
                    "baud rate"
                )
            with reporting_loss(self._table.port):
                answer += self._line.read(max(1, self._line.in_waiting))
                answer = answer[-4096:]  # an amplifier that sends no line end must not fill the memory
        return answer.decode("ascii", "replace").strip()

    def _receive(self) -> None:
        """Send the queries again and again, and raise `Disconnected` when the line is gone."""
        due = time.monotonic() + self._table.check_every_s
        while not self._stopped.is_set():
            with reporting_loss(self._table.port):
                self._line.read(max(1, self._line.in_waiting))
            if self._check and time.monotonic() > due:
                due = time.monotonic() + self._table.check_every_s
                for command in self._check:
                    self._send(command)

    def conclude(self) -> None:
        """Send the queries a last time; note an answer that differs from the settings."""
        super().conclude()
        if self._line is None:
            return
        try:
            for command in self._check:
                self._send(command)
        except DeviceError as error:
            self.note(
                f"its settings differ at the end ({str(error).split(';')[0].removeprefix(self.where).strip(': ')})"
            )

    def _suspend(self) -> None:
        # without the closing commands, which may reset the amplifier while the cut runs
        if self._line is not None:
            self._line.close()
            self._line = None

    def _release(self) -> None:
        try:
            if self._line is not None:
                with suppress(DeviceError):  # an amplifier that is off cannot be reset
                    for command in self._on_close:
                        self._send(command)
        finally:
            self._suspend()
