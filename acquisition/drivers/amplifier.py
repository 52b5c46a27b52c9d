"""A charge amplifier on a serial line, told what to do by a table of commands that the lab writes."""

import re
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from foundation import InputError

from ..errors import DeviceError, DeviceTimeout
from ..sources import EventAxis, Events
from .serial_line import on_line, open_line


@dataclass(frozen=True)
class Command:
    r"""One line to the amplifier and what it must answer.

    Parameters
    ----------
    send
        Text; the line's ending is added.
    expect
        Regular expression that the answer must match from its beginning; empty: no answer is awaited.
    wait
        s to wait for the answer, or after a command without one (a charge amplifier's reset takes time).
    """

    send: str
    expect: str = ""
    wait: float = 1.0


class Amplifier:
    """A feed without events: commands when the recording begins, others when it ends.

    Parameters
    ----------
    port, baud
        Name and speed (bits/s) of the serial line.
    on_open, on_close
        Commands in their order: range, reset, operate; at the end: reset.
    ending
        Characters at the end of each command.

    Raises
    ------
    InputError
        An expectation that is not a regular expression.
    """

    def __init__(
        self, port: str, baud: int, on_open: Sequence[Command], on_close: Sequence[Command] = (), ending: str = "\r\n"
    ) -> None:
        for command in (*on_open, *on_close):
            try:
                re.compile(command.expect)
            except re.error as error:
                raise InputError(f"amplifier on {port}: expect {command.expect!r} is not a pattern: {error}") from error
        self._port, self._baud, self._ending = port, baud, ending
        self._on_open, self._on_close = tuple(on_open), tuple(on_close)
        self.event_series: dict[str, EventAxis] = {}
        self._line: Any = None

    def open(self) -> None:
        """Open the line and send the opening commands.

        Raises
        ------
        DeviceError
            An answer that was not expected, or none; the line is gone or its driver missing.
        """
        self.close()
        self._line = open_line(self._port, self._baud, 0.05)
        try:
            for command in self._on_open:
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
        if re.match(command.expect, answer) is None:
            raise DeviceError(
                f"amplifier on {self._port} answered {answer!r} to {command.send!r}, expected {command.expect!r}; "
                "check its range and the command table"
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

    def poll(self) -> list[Events]:
        """Give no events; raise an error if the line has gone.

        Raises
        ------
        Disconnected
        """
        if self._line is not None:
            with on_line(self._port):
                self._line.read(self._line.in_waiting)
        return []

    def close(self) -> None:
        """Send the closing commands, as far as the amplifier still listens, and close the line."""
        line = self._line
        if line is None:
            return
        try:
            for command in self._on_close:
                self._tell(command)
        except DeviceError:
            pass
        finally:
            line.close()
            self._line = None
