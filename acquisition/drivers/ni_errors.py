"""DAQmx error codes as the errors a lab understands."""

from collections.abc import Iterator
from contextlib import contextmanager

from foundation import InputError, MillfrfError

from ..errors import DeviceError, DeviceTimeout, Disconnected, DriverMissing, Overrun

OVERRUN = -200279
TIMEOUT = -200284
_GONE = {-201003, -200324, -200045, -88709, -88710, -200220, -201401}
_NO_SUCH_TERMINAL = -200170
_INSTALL = "install NI-DAQmx from ni.com and the package with pip install millfrf[devices]"


@contextmanager
def speaking_to(devices: str) -> Iterator[None]:
    """Raise what DAQmx reports as one of the project's errors.

    Raises
    ------
    DriverMissing, Overrun, DeviceTimeout, Disconnected, DeviceError, InputError
    """
    try:
        from nidaqmx import errors
    except ImportError as error:
        raise DriverMissing(f"{devices}: the package nidaqmx is not installed; {_INSTALL}") from error
    try:
        yield
    except (errors.DaqNotFoundError, errors.DaqNotSupportedError, errors.DaqFunctionNotSupportedError) as error:
        raise DriverMissing(f"{devices}: NI-DAQmx is not installed or too old here; {_INSTALL}") from error
    except errors.DaqError as error:
        raise _translated(int(error.error_code), str(error), devices) from error


def _translated(code: int, text: str, devices: str) -> MillfrfError:
    if code == OVERRUN:
        return Overrun(f"{devices}: samples were lost, the computer did not keep up; close other programs")
    if code == TIMEOUT:
        return DeviceTimeout(f"{devices}: no samples came in time; check the sample clock and the chassis")
    if code in _GONE:
        return Disconnected(f"{devices}: the device is gone; check its plug and its power, then start anew")
    if code == _NO_SUCH_TERMINAL:
        return InputError(f"{devices}: a terminal does not exist ({_first_line(text)}); look it up in NI MAX")
    return DeviceError(f"{devices}: DAQmx error {code}: {_first_line(text)}; look the code up in NI MAX")


def _first_line(text: str) -> str:
    return next((line.strip() for line in text.splitlines() if line.strip()), "no text").rstrip(".")
