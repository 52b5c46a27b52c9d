"""A charge amplifier on a serial line, told what to do by a table of commands that the lab writes."""

import re
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from millfrf.core import InputError

from ..errors import DeviceError, DeviceTimeout
from ..sources.receiving import Put, ThreadedFeed
from .serial_lines import on_line, open_line

_PLACE = re.compile(r"\{(\w+)\}")


@dataclass(frozen=True)
class Command:
    r"""One line to the amplifier and what it must answer.

    Parameters
    ----------
    send
        Text; the line's ending is added. ``{fx}`` stands for the range of the channel fx.
    expect
        Regular expression that the answer must match from its beginning; empty: no answer is awaited. ``{fx}`` stands
        for the range, however it is written (1000, 1e3, 1000.0).
    wait
        s to wait for the answer, or after a command without one (a charge amplifier's reset takes time).
    """

    send: str
    expect: str = ""
    wait: float = 1.0

    @property
    def ranges(self) -> frozenset[str]:
        """Channels whose range it sends or expects."""
        return frozenset(_PLACE.findall(self.send) + _PLACE.findall(self.expect))

    def with_ranges(self, ranges: Mapping[str, float]) -> "Command":
        """The command with numbers in the places of the named ranges; each expected one is a group of its own."""
        send = _PLACE.sub(lambda found: f"{ranges[found[1]]:.10g}" if found[1] in ranges else found[0], self.send)
        expect = _PLACE.sub(lambda found: f"(?P<{found[1]}>{_NUMBER})" if found[1] in ranges else found[0], self.expect)
        return replace(self, send=send, expect=expect)


_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"


class Amplifier(ThreadedFeed):
    """A feed without events: commands when the recording begins, others when it ends, questions in between.

    A range stands in one place, the session's channel: it scales the samples, is sent to the amplifier and expected
    in its answers. Where the line is lost while a cut runs, it is opened again and the questions are asked; the
    opening commands are not sent, since a reset would falsify the forces.

    Parameters
    ----------
    port, baud
        Name and speed (bits/s) of the serial line.
    on_open, on_close
        Commands in their order: range, reset, operate; at the end: reset.
    ending
        Characters at the end of each command.
    check
        Questions with the answers that must come, asked after the opening commands, again and again, and at the end.
    check_every : s
        Time between two rounds of questions.
    ranges
        Range by channel name, in the unit in which the amplifier is told it.

    Raises
    ------
    InputError
        An expectation that is not a regular expression, or a place for a range that is not given.
    """

    def __init__(
        self,
        port: str,
        baud: int,
        on_open: Sequence[Command],
        on_close: Sequence[Command] = (),
        ending: str = "\r\n",
        *,
        check: Sequence[Command] = (),
        check_every: float = 5.0,
        ranges: Mapping[str, float] | None = None,
    ) -> None:
        super().__init__(f"amplifier on {port}", {})
        self._port, self._baud, self._ending = port, baud, ending
        self._ranges = dict(ranges or {})
        self._on_open, self._on_close, self._check = (
            tuple(self._understood(each) for each in commands) for commands in (on_open, on_close, check)
        )
        self._check_every = check_every
        self._line: Any = None

    def _understood(self, command: Command) -> Command:
        unknown = sorted(name for name in command.ranges if name not in self._ranges and not name.isdigit())
        if unknown:
            raise InputError(
                f"amplifier on {self._port}: {command.send!r} needs the range of {', '.join(unknown)}; give amplifier "
                "and amplifier_range with that channel"
            )
        ready = command.with_ranges(self._ranges)
        try:
            re.compile(ready.expect)
        except re.error as error:
            raise InputError(
                f"amplifier on {self._port}: expect {command.expect!r} is not a pattern: {error}"
            ) from error
        return ready

    def _connect(self) -> None:
        self._start((*self._on_open, *self._check))

    def _reconnect(self) -> None:
        self._start(self._check)

    def _start(self, commands: Sequence[Command]) -> None:
        self._line = open_line(self._port, self._baud, 0.05)
        try:
            for command in commands:
                self._tell(command)
        except BaseException:
            self._line.close()
            self._line = None
            raise

    def _tell(self, command: Command) -> None:
        with on_line(self._port):
            self._line.reset_input_buffer()
            self._line.write((command.send + self._ending).encode())
        if not command.expect:
            time.sleep(command.wait)
            return
        answer = self._answer(command)
        found = re.match(command.expect, answer)
        if found is None:
            raise DeviceError(
                f"amplifier on {self._port} answered {answer!r} to {command.send!r}, expected {command.expect!r}; "
                "check its range and the command table"
            )
        for name, text in found.groupdict().items():
            wanted = self._ranges[name]
            if abs(float(text) - wanted) > 1e-6 * abs(wanted):
                raise DeviceError(
                    f"amplifier on {self._port} answered {answer!r} to {command.send!r}: the range of {name} is "
                    f"{float(text):g}, not {wanted:g}; set it there or in the session"
                )

    def _answer(self, command: Command) -> str:
        answer, latest = b"", time.monotonic() + command.wait
        while not answer.endswith((b"\n", b"\r")) or not answer.strip():
            if time.monotonic() > latest:
                raise DeviceTimeout(
                    f"amplifier on {self._port} did not answer {command.send!r} within {command.wait:g} s; "
                    "check power, cable and baud rate"
                )
            with on_line(self._port):
                answer += self._line.read(max(1, self._line.in_waiting))
        return answer.decode("ascii", "replace").strip()

    def _receive(self, put: Put, stopped: Callable[[], bool]) -> None:
        """Ask whether all is as it was set, and notice when the line is gone."""
        del put
        due = time.monotonic() + self._check_every
        while not stopped():
            with on_line(self._port):
                self._line.read(max(1, self._line.in_waiting))
            if self._check and time.monotonic() > due:
                due = time.monotonic() + self._check_every
                for command in self._check:
                    self._tell(command)

    def conclude(self) -> None:
        """Ask a last time whether all is still as it was set."""
        super().conclude()
        if self._line is None:
            return
        try:
            for command in self._check:
                self._tell(command)
        except DeviceError as error:
            self.note(f"not as it was set at the end ({str(error).split(';')[0].removeprefix(self.where).strip(': ')})")

    def _let_go(self) -> None:
        """Close the line; the closing commands may reset the amplifier, which a running cut forbids."""
        if self._line is not None:
            self._line.close()
            self._line = None

    def _release(self) -> None:
        """Send the closing commands, as far as the amplifier still listens, and close the line."""
        try:
            if self._line is not None:
                with suppress(DeviceError):
                    for command in self._on_close:
                        self._tell(command)
        finally:
            self._let_go()
