"""National Instruments devices: identity and calibration, and error codes as the exceptions of this package."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, TypeVar

from millfrf.core import InputError, MillfrfError

from ..sources.source import DeviceError, DeviceTimeout, Disconnected, DriverMissing, Overrun

T = TypeVar("T")

# error codes of DAQmx
_OVERRUNS = {
    -200279: "the computer did not keep up; close other programs",  # samples no longer available in the buffer
    -200361: "the device's own memory overflowed; lower the rate, or use a faster bus or fewer devices on it",
    -200714: "the driver could not fetch them fast enough; lower the rate, or use a faster bus or computer",
}
_TIMEOUT = -200284
_GONE = {-201003, -200324, -200045, -88705, -88709, -88710, -50405, -200220, -201401}
_NO_SUCH_TERMINAL = -200170
_BAD_VALUE = -200077
_NO_SYNC = -201426
_NO_TEDS = {-200709, -200741, -200742, -200743, -200753, -200826}
_INSTALL = "install NI-DAQmx from ni.com and the package with pip install millfrf[devices]"


@contextmanager
def translating_errors(devices: str) -> Iterator[None]:
    """Raise an error of DAQmx as an error of this project; ``devices`` names the devices in the message."""
    try:
        from nidaqmx import errors  # optional: the extra `devices`
    except ImportError as error:
        raise DriverMissing(f"{devices}: the package nidaqmx is not installed; {_INSTALL}") from error
    try:
        yield
    except (errors.DaqNotFoundError, errors.DaqNotSupportedError, errors.DaqFunctionNotSupportedError) as error:
        raise DriverMissing(f"{devices}: NI-DAQmx is not installed or too old here; {_INSTALL}") from error
    except errors.DaqError as error:
        raise _translated(int(error.error_code), str(error), devices) from error


def _translated(code: int, text: str, devices: str) -> MillfrfError:
    first_line = next((line.strip() for line in text.splitlines() if line.strip()), "no text").rstrip(".")
    if code in _OVERRUNS:
        return Overrun(f"{devices}: samples were lost, {_OVERRUNS[code]}")
    if code == _TIMEOUT:
        return DeviceTimeout(f"{devices}: no samples came in time; check the sample clock and the chassis")
    if code in _GONE:
        return Disconnected(f"{devices}: the device is gone; check its plug and its power, then start again")
    if code == _NO_SUCH_TERMINAL:
        return InputError(f"{devices}: a terminal does not exist ({first_line}); look it up in NI MAX")
    if code == _BAD_VALUE:
        return InputError(
            f"{devices}: the module does not accept these settings ({first_line}); check range_v, iepe_ma, coupling "
            "and terminal_configuration against its data sheet"
        )
    if code == _NO_SYNC:
        return InputError(
            f"{devices}: these devices share no clock; put the modules into one chassis, or use devices that DAQmx "
            "synchronizes (PXI, or chassis on a time-sensitive network)"
        )
    if code in _NO_TEDS:
        return InputError(f"{devices}: no readable TEDS ({first_line}); leave teds out or check the sensor")
    return DeviceError(f"{devices}: DAQmx error {code}: {first_line}; look the code up in NI MAX")


def query(read_property: Callable[[], T]) -> T | None:
    """Read a property of the driver; return None if the module does not have it."""
    from nidaqmx.errors import DaqError, DaqFunctionNotSupportedError

    with suppress(DaqError, DaqFunctionNotSupportedError, ValueError):
        return read_property()
    return None


def identity(device: str) -> dict[str, str]:
    """Read the identity of a device, such as ``cDAQ1Mod1``, as far as its driver knows it.

    The keys are ``model``, ``serial`` (hexadecimal, as on the label), ``calibrated`` (ISO date of the external
    calibration), ``self_calibrated``, and ``chassis`` with model and serial number.
    """
    from nidaqmx.system.device import Device

    module = Device(device)
    texts = _identity_of(module)
    chassis = query(lambda: module.compact_daq_chassis_device)
    if chassis is not None:
        of_chassis = _identity_of(chassis)
        texts["chassis"] = " ".join(text for text in (of_chassis.get("model"), of_chassis.get("serial")) if text)
    return {name: text for name, text in texts.items() if text}


def _identity_of(device: Any) -> dict[str, str]:
    properties: dict[str, Callable[[], str]] = {
        "model": lambda: str(device.product_type),
        "serial": lambda: f"{device.serial_num:08X}",
        "calibrated": lambda: device.ext_cal_last_date_and_time.date().isoformat(),
        "self_calibrated": lambda: device.self_cal_last_date_and_time.date().isoformat(),
    }
    texts = {name: query(read_property) for name, read_property in properties.items()}
    return {name: text for name, text in texts.items() if text}


def sensor_identity(terminal: str) -> str:
    """Read manufacturer, model, version and serial number from the TEDS of a configured sensor; empty if none."""
    from nidaqmx.system.physical_channel import PhysicalChannel

    sensor = PhysicalChannel(terminal)
    properties = (
        ("manufacturer", lambda: sensor.teds_mfg_id),
        ("model", lambda: sensor.teds_model_num),
        ("version", lambda: sensor.teds_version_num),
        ("serial", lambda: sensor.teds_serial_num),
    )
    numbers = [(name, query(read_property)) for name, read_property in properties]
    return " ".join(f"{name} {number}" for name, number in numbers if number is not None)


def input_delay(created: Any) -> float | None:
    """Read the delay of a module's input, s.

    The delay depends on the rate, which must be set before. It is zero for a module that compensates the delay of its
    filter, and None for a module without such a filter.
    """
    from nidaqmx import constants

    if query(lambda: created.ai_remove_filter_delay):
        return 0.0
    query(lambda: setattr(created, "ai_filter_delay_units", constants.DigitalWidthUnits.SECONDS))
    return query(lambda: float(created.ai_filter_delay))
