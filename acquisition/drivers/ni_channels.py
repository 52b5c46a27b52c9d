"""An input of National Instruments with its sensor, and how it becomes a channel of a DAQmx task."""

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from foundation import InputError

from ..channel import Channel

STANDARD_GRAVITY = 9.80665
IEPE_QUANTITIES = ("acceleration", "force")


@dataclass(frozen=True)
class NiInput:
    """One input terminal with what is wired to it.

    Parameters
    ----------
    channel
        Name, quantity and place; its full scale is set from the range where it is None.
    terminal
        Name of the terminal, such as ``cDAQ1Mod1/ai0``.
    sensitivity
        Sensitivity in V per SI unit of the channel: V/(m/s²), V/N; of a charge amplifier the reciprocal of its N/V.
    range_volts : V
        Largest magnitude of the input.
    iepe_current : A
        Excitation current of an IEPE sensor; 0: a plain voltage.

    Raises
    ------
    InputError
        A sensitivity of zero, a range that is not positive, or IEPE for a quantity that has no such sensor.
    """

    channel: Channel
    terminal: str
    sensitivity: float
    range_volts: float = 5.0
    iepe_current: float = 0.0

    def __post_init__(self) -> None:
        name = self.channel.name
        if self.sensitivity == 0:
            raise InputError(f"channel {name}: sensitivity 0 V per unit; take it from the calibration sheet")
        if not self.range_volts > 0:
            raise InputError(f"channel {name}: range {self.range_volts} V must be positive")
        if self.iepe_current and self.channel.quantity not in IEPE_QUANTITIES:
            raise InputError(
                f"channel {name}: IEPE is for {' and '.join(IEPE_QUANTITIES)}, not {self.channel.quantity}; "
                "leave iepe_current out"
            )

    @property
    def device(self) -> str:
        """The module: ``cDAQ1Mod1``."""
        return self.terminal.split("/")[0]

    @property
    def full_scale(self) -> float:
        """Largest magnitude of the input, in the channel's unit."""
        return self.range_volts / abs(self.sensitivity)

    @property
    def scale(self) -> float:
        """Factor for the task's values: 1 where DAQmx scales, else SI units per V."""
        return 1.0 if self.iepe_current else 1.0 / self.sensitivity

    def described(self, module_delay: float | None) -> Channel:
        """The channel as recorded: with its terminal, sensitivity, and all delays known of it.

        ``module_delay`` is the module's own (s; None: it tells none); an amplifier's, which the channel had, is added.
        """
        extra = {**self.channel.extra, "terminal": self.terminal, "sensitivity_v_per_unit": self.sensitivity}
        known = [delay for delay in (self.channel.input_delay_s, module_delay) if delay is not None]
        full_scale = self.channel.full_scale if self.channel.full_scale is not None else self.full_scale
        return replace(
            self.channel, full_scale=full_scale, input_delay_s=float(sum(known)) if known else None, extra=extra
        )

    def add_to(self, channels: Any) -> Any:
        """Create the channel among those of a DAQmx task, and return what DAQmx calls it."""
        from nidaqmx import constants

        if not self.iepe_current:
            return channels.add_ai_voltage_chan(
                self.terminal, self.channel.name, min_val=-self.range_volts, max_val=self.range_volts
            )
        common = {
            "min_val": -self.full_scale,
            "max_val": self.full_scale,
            "current_excit_source": constants.ExcitationSource.INTERNAL,
            "current_excit_val": self.iepe_current,
        }
        if self.channel.quantity == "force":
            return channels.add_ai_force_iepe_chan(
                self.terminal,
                self.channel.name,
                units=constants.ForceUnits.NEWTONS,
                sensitivity=self.sensitivity * 1e3,
                sensitivity_units=constants.ForceIEPESensorSensitivityUnits.MILLIVOLTS_PER_NEWTON,
                **common,
            )
        return channels.add_ai_accel_chan(
            self.terminal,
            self.channel.name,
            units=constants.AccelUnits.METERS_PER_SECOND_SQUARED,
            sensitivity=self.sensitivity * 1e3 * STANDARD_GRAVITY,
            sensitivity_units=constants.AccelSensitivityUnits.MILLIVOLTS_PER_G,
            **common,
        )


def input_delay(created: Any) -> float | None:
    """Time between a signal and its sample in this module, s, where the driver tells it; ask after the rate is set.

    Zero where the module takes its filter's delay out itself; None where it has no such filter.
    """
    from nidaqmx import constants
    from nidaqmx.errors import DaqError, DaqFunctionNotSupportedError

    unknown = (DaqError, DaqFunctionNotSupportedError)
    with suppress(*unknown):
        if created.ai_remove_filter_delay:
            return 0.0
    with suppress(*unknown):
        created.ai_filter_delay_units = constants.DigitalWidthUnits.SECONDS
    with suppress(*unknown):
        return float(created.ai_filter_delay)
    return None
