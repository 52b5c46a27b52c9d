"""`[[channels]]` of a session: what is wired to a terminal, in the lab's own units."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, model_validator

from foundation import SI_UNITS, InputError, si_factor

from ..channel import Channel
from ..drivers.ni_channels import NiInput

STRICT = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=False)
Positive = Annotated[float, Field(gt=0)]
Name = Annotated[str, Field(min_length=1)]


class ChannelTable(BaseModel):
    """One input of a session file.

    Parameters
    ----------
    name, quantity, node, direction, high_pass_hz, sensor
        Fields of the same names in a recording's `Channel`.
    unit
        Unit of the calibration sheet: ``N``, ``kN``, ``g``, ``m/s^2``, ``V``.
    terminal
        Name of the terminal, such as ``cDAQ1Mod1/ai0``.
    mv_per_unit : mV per ``unit``
        Sensitivity of the sensor.
    units_per_volt : ``unit`` per V
        Setting of a charge amplifier, given instead of a sensitivity.
    range_v : V
        Largest magnitude of the input.
    iepe_ma : mA
        Excitation current of an IEPE sensor; 0: none.
    delay_us : microseconds
        Time by which an amplifier before the input delays the signal; the module's own delay is added.
    """

    model_config = STRICT
    name: Name
    quantity: str
    unit: str
    terminal: Name
    mv_per_unit: float | None = None
    units_per_volt: float | None = None
    range_v: Positive = 5.0
    iepe_ma: Annotated[float, Field(ge=0, le=20)] = 0.0
    delay_us: Annotated[float, Field(ge=0, le=1e6)] = 0.0
    node: str = ""
    direction: str = ""
    high_pass_hz: Positive | None = None
    sensor: str = ""

    @model_validator(mode="after")
    def _understood(self) -> "ChannelTable":
        if (self.mv_per_unit is None) == (self.units_per_volt is None):
            raise ValueError(
                f"channel {self.name}: give either mv_per_unit (a sensor's sheet) or units_per_volt (an amplifier)"
            )
        if 0 in (self.mv_per_unit, self.units_per_volt):
            raise ValueError(f"channel {self.name}: a sensitivity of 0; take it from the calibration sheet")
        try:
            self.wired()
        except InputError as error:
            raise ValueError(str(error)) from error
        return self

    @property
    def volts_per_si_unit(self) -> float:
        """V per SI unit of the quantity."""
        factor = si_factor(self.quantity, self.unit)
        if self.mv_per_unit is not None:
            return self.mv_per_unit * 1e-3 / factor
        return 1.0 / ((self.units_per_volt or 1.0) * factor)

    def wired(self) -> NiInput:
        """The input in SI units.

        Raises
        ------
        InputError
            A unit, quantity or direction that is not known.
        """
        si_factor(self.quantity, self.unit)
        channel = Channel(
            self.name,
            self.quantity,
            SI_UNITS[self.quantity],
            self.node,
            self.direction,
            None,
            self.high_pass_hz,
            self.sensor,
            self.delay_us * 1e-6 or None,
        )
        return NiInput(channel, self.terminal, self.volts_per_si_unit, self.range_v, self.iepe_ma * 1e-3)
