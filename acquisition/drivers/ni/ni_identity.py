"""Which device measured: model, serial number and calibration of a module and its chassis, and a sensor's TEDS."""

from collections.abc import Callable
from contextlib import suppress
from typing import Any, TypeVar

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
