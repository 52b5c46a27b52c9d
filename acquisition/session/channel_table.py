"""`[[channels]]` of a session: what is wired to a terminal, in the lab's own units."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from millfrf.core import SI_UNITS, InputError, si_factor

from ..channels import Channel, ChannelKeys
from ..drivers.ni_channels import NiCounter, NiInput

STRICT = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=False)
Positive = Annotated[float, Field(gt=0)]
Name = Annotated[str, Field(min_length=1)]


class ChannelTable(ChannelKeys):
    """One input of a session file.

    Parameters
    ----------
    unit
        Unit of the calibration sheet: ``N``, ``kN``, ``g``, ``m/s^2``, ``V``.
    terminal
        Name of the terminal, such as ``cDAQ1Mod1/ai0``.
    mv_per_unit : mV per unit
        Sensitivity of the sensor; not 0, and below 0 where the sign is turned.
    units_per_volt : unit per V
        Scale of a device with a voltage output, given instead of a sensitivity.
    amplifier_range : unit, or pC with pc_per_unit
        Range of a charge amplifier, given instead of a sensitivity: at it the output is ``amplifier_volts``. It scales
        the samples and is told to the amplifier, so that the two cannot differ.
    amplifier_volts : V
        Output of the amplifier at its range.
    pc_per_unit : pC per unit
        Sensitivity of a piezoelectric sensor, where the amplifier's range is a charge.
    amplifier
        Name of the `[[amplifier]]` that is told the range; empty: it is set by hand.
    range_v : V
        Largest voltage that the input holds, either sign.
    iepe_ma : mA
        Excitation current of an IEPE sensor, for accelerations and forces; 0: none.
    coupling
        ``ac`` or ``dc``; empty: as the module chooses, ``ac`` with IEPE.
    terminal_configuration
        ``rse``, ``nrse``, ``differential`` or ``pseudodifferential``; empty: as the module chooses.
    teds
        Whether the IEPE sensor's electronic data sheet is read; it scales where no sensitivity is given, and is held
        against ``mv_per_unit`` where one is.
    delay_us : microseconds
        Time by which an amplifier before the input delays the signal; the module's own delay is added.
    """

    unit: str
    terminal: Name
    mv_per_unit: float | None = None
    units_per_volt: float | None = None
    amplifier_range: Positive | None = None
    amplifier_volts: Positive = 10.0
    pc_per_unit: float | None = None
    amplifier: str = ""
    range_v: Positive = 5.0
    iepe_ma: Annotated[float, Field(ge=0, le=20)] = 0.0
    coupling: Literal["", "ac", "dc"] = ""
    terminal_configuration: Literal["", "rse", "nrse", "differential", "pseudodifferential"] = ""
    teds: bool = False
    delay_us: Annotated[float, Field(ge=0, le=1e6)] = 0.0

    @model_validator(mode="after")
    def _understood(self) -> "ChannelTable":
        given = (self.mv_per_unit, self.units_per_volt, self.amplifier_range)
        n_given = sum(one is not None for one in given)
        if n_given > 1 or (n_given == 0 and not self.teds):
            raise ValueError(
                f"channel {self.name}: give either mv_per_unit (a sensor's sheet) or units_per_volt (a voltage output) "
                "or amplifier_range (a charge amplifier)"
            )
        if 0 in (*given, self.pc_per_unit):
            raise ValueError(f"channel {self.name}: a sensitivity of 0; take it from the calibration sheet")
        if self.amplifier_range is None and (self.amplifier or self.pc_per_unit is not None):
            raise ValueError(f"channel {self.name}: amplifier and pc_per_unit go with amplifier_range; give it")
        try:
            self.wired()
        except InputError as error:
            raise ValueError(str(error)) from error
        return self

    @property
    def volts_per_si_unit(self) -> float | None:
        """V per SI unit of the quantity; None: the sensor's TEDS states it."""
        factor = si_factor(self.quantity, self.unit)
        if self.mv_per_unit is not None:
            return self.mv_per_unit * 1e-3 / factor
        if self.amplifier_range is not None:
            return self.amplifier_volts * (self.pc_per_unit or 1.0) / (self.amplifier_range * factor)
        return None if self.units_per_volt is None else 1.0 / (self.units_per_volt * factor)

    def _extra(self) -> dict[str, Any]:
        """Settings that the recording keeps with the channel."""
        if self.amplifier_range is None:
            return {}
        names = ("amplifier", "amplifier_range", "amplifier_volts", "pc_per_unit")
        return {name: getattr(self, name) for name in names if getattr(self, name) not in ("", None)}

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
            self._extra(),
        )
        return NiInput(
            channel,
            self.terminal,
            self.volts_per_si_unit,
            self.range_v,
            self.iepe_ma * 1e-3,
            self.coupling,
            self.terminal_configuration,
            self.teds,
        )


class CounterTable(BaseModel):
    """One counter of a session file: an angular encoder, or edges.

    Parameters
    ----------
    name, node, direction, sensor
        Fields of the same names in a recording's `Channel`.
    counter
        Name of the counter, such as ``cDAQ1/_ctr0``.
    kind
        ``encoder`` (an angle in rad) or ``edges`` (a number).
    pulses_per_revolution, decoding, index
        Settings of an encoder; see `NiCounter`.
    """

    model_config = STRICT
    name: Name
    counter: Name
    kind: Literal["encoder", "edges"] = "encoder"
    pulses_per_revolution: Annotated[int, Field(ge=1, le=10_000_000)] = 1024
    decoding: Literal["x1", "x2", "x4"] = "x4"
    index: bool = False
    node: str = ""
    direction: str = ""
    sensor: str = ""

    def wired(self) -> NiCounter:
        """The counter as the driver takes it.

        Raises
        ------
        InputError
            A direction that is not known.
        """
        quantity = "angle" if self.kind == "encoder" else "dimensionless"
        channel = Channel(self.name, quantity, SI_UNITS[quantity], self.node, self.direction, sensor=self.sensor)
        return NiCounter(channel, self.counter, self.kind, self.pulses_per_revolution, self.decoding, self.index)
