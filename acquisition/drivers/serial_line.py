"""Opening a serial line, and its failures in words."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from foundation import InputError

from ..errors import Disconnected, DriverMissing

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
