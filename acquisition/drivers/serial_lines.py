"""Serial lines, and instruments that send one number a line."""

import re
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from millfrf.core import InputError

from ..errors import DeviceTimeout, Disconnected, DriverMissing
from ..sources.receiving import Put, ThreadedFeed
from ..sources.source import HOST_AXIS, EventAxis, Events
from ..sources.timing import Stamped, SteadyStamps

BITS_A_BYTE = 10
"""Start bit, eight data bits, stop bit."""

LINE_FAILURES: tuple[type[Exception], ...] = (OSError, TypeError)  # pyserial stumbles over a lost descriptor
try:
    import termios
except ImportError:  # Windows
    pass
else:
    LINE_FAILURES += (termios.error,)  # no OSError, though it says the same


def open_line(port: str, baud: int, timeout: float) -> Any:
    """An open `serial.Serial`; ``timeout`` in s is for one read.

    Raises
    ------
    DriverMissing, Disconnected, InputError
    """
    try:
        import serial
    except ImportError as error:
        raise DriverMissing(f"serial line {port}: needs pyserial; pip install millfrf[devices]") from error
    try:
        return serial.Serial(port, baud, timeout=timeout, write_timeout=timeout)
    except ValueError as error:
        raise InputError(f"serial line {port}: {error}; check its settings") from error
    except OSError as error:
        raise Disconnected(f"serial line {port} cannot be opened: {error}; check its name and plug") from error


@contextmanager
def on_line(port: str) -> Iterator[None]:
    """Whatever a line raises when its adapter is unplugged, as `Disconnected`.

    Raises
    ------
    Disconnected
    """
    try:
        yield
    except LINE_FAILURES as error:
        raise Disconnected(f"serial line {port} is gone ({error}); check its plug") from error


_NUMBER = r"([-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)"
_LONGEST_LINE = 4096


class TachometerFeed(ThreadedFeed):
    """Lines of text, each with a value, as a feed of events.

    Parameters
    ----------
    port, baud
        Name of the serial line, ``COM3`` or ``/dev/ttyUSB0``, and its speed in bits/s.
    series
        Name of the event series.
    pattern
        Regular expression whose first group is the number.
    factor
        Factor by which the number is multiplied.
    period : s
        Time between two lines where the instrument keeps it exactly: then its own clock is followed, and a computer
        that is busy does not blur the times. None: a line's time is its arrival less its transmission.
    silence : s
        Time without a line after which the instrument counts as lost.

    Raises
    ------
    InputError
        A pattern that is not one, or has no group.
    """

    def __init__(
        self,
        port: str,
        baud: int,
        series: str,
        *,
        pattern: str = _NUMBER,
        factor: float = 1.0,
        period: float | None = None,
        silence: float = 3.0,
    ) -> None:
        try:
            self._pattern = re.compile(pattern)
        except re.error as error:
            raise InputError(f"serial line {port}: pattern {pattern!r} is not a regular expression: {error}") from error
        if not self._pattern.groups:
            raise InputError(f"serial line {port}: pattern {pattern!r} needs a group ( ) around the number")
        axis = HOST_AXIS if period is None else EventAxis("device", f"line:{port}")
        super().__init__(f"serial line {port}", {series: axis})
        self._port, self._baud, self._series = port, baud, series
        self._factor, self._period, self._silence = factor, period, silence
        self._line: Any = None
        self._stamps = SteadyStamps()

    def _connect(self) -> None:
        self._stamps = SteadyStamps()
        self._reconnect()

    def _reconnect(self) -> None:
        self._line = open_line(self._port, self._baud, 0.1)

    def _receive(self, put: Put, stopped: Callable[[], bool]) -> None:
        pending, n_lines, heard = b"", 0, time.monotonic()
        try:
            while not stopped():
                with on_line(self._port):
                    came = self._line.read(max(1, self._line.in_waiting))
                arrival = time.monotonic()
                *lines, pending = (pending + came).replace(b"\r", b"\n").split(b"\n")
                pending = pending[-_LONGEST_LINE:]
                for line in filter(None, lines):
                    n_lines, heard = n_lines + 1, arrival
                    self._take(line, n_lines, arrival, put)
                if arrival - heard > self._silence:
                    what = f"nothing came for {self._silence:g} s; check instrument"
                    raise DeviceTimeout(f"serial line {self._port}: {what}", heard)
        finally:
            self._put(self._stamps.flush(), put)

    def _take(self, line: bytes, count: int, arrival: float, put: Put) -> None:
        found = self._pattern.search(line.decode("ascii", "replace"))
        if found is None:
            return
        try:
            value = float(found.group(1)) * self._factor
        except (TypeError, ValueError):
            return
        begun = arrival - (len(line) + 1) * BITS_A_BYTE / self._baud
        if self._period is None:
            put(Events(self._series, np.array([begun]), np.array([value])))
        else:
            self._put(self._stamps.add(Stamped(self._series, value, count * self._period, begun)), put)

    def _put(self, clear: Sequence[Stamped], put: Put) -> None:
        """Hand over; a step of the count of lines is that of lines which got lost, or of a line opened anew."""
        for at, step in self._stamps.steps():
            self.note(f"{-step:.3f} s of lines are missing, the times go on", at)
        for one in clear:
            put(Events(one.series, np.array([one.stamp]), np.array([one.value]), np.array([one.arrival])))

    def _release(self) -> None:
        if self._line is not None:
            self._line.close()
            self._line = None
