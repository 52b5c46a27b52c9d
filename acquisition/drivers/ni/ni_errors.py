"""DAQmx error codes as the errors a lab understands."""

from collections.abc import Iterator
from contextlib import contextmanager

from foundation import InputError, MillfrfError

from ...errors import DeviceError, DeviceTimeout, Disconnected, DriverMissing, Overrun

OVERRUNS = {
    -200279: "the computer did not keep up; close other programs",  # samples no longer available in the buffer
    -200361: "the device's own memory overflowed; lower the rate, or use a faster bus or fewer devices on it",
    -200714: "the driver could not fetch them fast enough; lower the rate, or use a faster bus or computer",
}
TIMEOUT = -200284
_GONE = {-201003, -200324, -200045, -88705, -88709, -88710, -50405, -200220, -201401}
_NO_SUCH_TERMINAL = -200170
_BAD_VALUE = -200077
_NO_SYNC = -201426
_NO_TEDS = {-200709, -200741, -200742, -200743, -200753, -200826}
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
    if code in OVERRUNS:
        return Overrun(f"{devices}: samples were lost, {OVERRUNS[code]}")
    if code == TIMEOUT:
        return DeviceTimeout(f"{devices}: no samples came in time; check the sample clock and the chassis")
    if code in _GONE:
        return Disconnected(f"{devices}: the device is gone; check its plug and its power, then start anew")
    if code == _NO_SUCH_TERMINAL:
        return InputError(f"{devices}: a terminal does not exist ({_first_line(text)}); look it up in NI MAX")
    if code == _BAD_VALUE:
        return InputError(
            f"{devices}: the module cannot be set so ({_first_line(text)}); check range_v, iepe_ma, coupling and "
            "terminal_configuration against its data sheet"
        )
    if code == _NO_SYNC:
        return InputError(
            f"{devices}: these devices share no clock; put the modules into one chassis, or use devices that DAQmx "
            "synchronizes (PXI, or chassis on a time-sensitive network)"
        )
    if code in _NO_TEDS:
        return InputError(f"{devices}: no readable TEDS ({_first_line(text)}); leave teds out or check the sensor")
    return DeviceError(f"{devices}: DAQmx error {code}: {_first_line(text)}; look the code up in NI MAX")


def _first_line(text: str) -> str:
    return next((line.strip() for line in text.splitlines() if line.strip()), "no text").rstrip(".")
