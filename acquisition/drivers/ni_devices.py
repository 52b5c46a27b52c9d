"""National Instruments devices: identity and calibration, and error codes as the exceptions of this package."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, TypeVar

from millfrf.core import InputError, MillfrfError

from ..errors import DeviceError, DeviceTimeout, Disconnected, DriverMissing, Overrun

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


T = TypeVar("T")


def identity(device: str) -> dict[str, str]:
    """What a device says of itself, as far as its driver tells.

    Parameters
    ----------
    device
        Its name in DAQmx: ``cDAQ1Mod1``.

    Returns
    -------
    dict
        ``model``, ``serial`` (hexadecimal, as on its label), ``calibrated`` (ISO date of the external calibration) and
        ``self_calibrated``, and ``chassis`` with model and serial number; what is not known is left out.
    """
    from nidaqmx.system.device import Device

    asked = Device(device)
    found = _of(asked)
    chassis = _told(lambda: asked.compact_daq_chassis_device)
    if chassis is not None:
        told = _of(chassis)
        found["chassis"] = " ".join(text for text in (told.get("model"), told.get("serial")) if text)
    return {name: text for name, text in found.items() if text}


def _of(device: Any) -> dict[str, str]:
    """Model, serial number and dates of one device."""
    questions: dict[str, Callable[[], str]] = {
        "model": lambda: str(device.product_type),
        "serial": lambda: f"{device.serial_num:08X}",
        "calibrated": lambda: device.ext_cal_last_date_and_time.date().isoformat(),
        "self_calibrated": lambda: device.self_cal_last_date_and_time.date().isoformat(),
    }
    told = {name: _told(question) for name, question in questions.items()}
    return {name: text for name, text in told.items() if text}


def sensor_identity(terminal: str) -> str:
    """Manufacturer, model, version and serial number in the TEDS of a sensor that was configured; empty: none."""
    from nidaqmx.system.physical_channel import PhysicalChannel

    sensor = PhysicalChannel(terminal)
    parts = (
        ("manufacturer", lambda: sensor.teds_mfg_id),
        ("model", lambda: sensor.teds_model_num),
        ("version", lambda: sensor.teds_version_num),
        ("serial", lambda: sensor.teds_serial_num),
    )
    told = [(what, _told(question)) for what, question in parts]
    return " ".join(f"{what} {number}" for what, number in told if number is not None)


def _told(question: Callable[[], T]) -> T | None:
    """The answer, or None where the driver has none."""
    from nidaqmx.errors import DaqError, DaqFunctionNotSupportedError

    with suppress(DaqError, DaqFunctionNotSupportedError, ValueError):
        return question()
    return None
