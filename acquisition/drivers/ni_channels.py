"""`[[channels]]` and `[[counters]]` of a session: sensors and encoders as channels of a DAQmx task."""

from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, Field, model_validator

from millfrf.core import SI_UNITS, InputError, Real, si_factor

from ..channels import STRICT, Channel, ChannelKeys, Name, Positive
from ..settings import SETTINGS
from .ni_devices import query

_COUPLINGS = {"ac": "AC", "dc": "DC"}  # names in a session, and in nidaqmx
_TERMINALS = {"rse": "RSE", "nrse": "NRSE", "differential": "DIFF", "pseudodifferential": "PSEUDO_DIFF"}
_STANDARD_GRAVITY = 9.80665  # m/s^2
_POUND = 4.4482216152605  # N


class ChannelTable(ChannelKeys):
    """One input of a session file.

    Parameters
    ----------
    unit
        Unit of the calibration sheet: ``N``, ``kN``, ``g``, ``m/s^2``, ``V``.
    terminal
        Name of the terminal, such as ``cDAQ1Mod1/ai0``.
    mv_per_unit : mV per unit
        Sensitivity of the sensor; not 0, and negative if the sign is reversed.
    units_per_volt : unit per V
        Scale of a device with a voltage output, instead of a sensitivity.
    amplifier_range : unit, or pC with pc_per_unit
        Range of a charge amplifier, instead of a sensitivity: at it the output is ``amplifier_volts``. It scales the
        samples and is sent to the amplifier, so that the two cannot differ.
    amplifier_volts : V
        Output of the amplifier at its range.
    pc_per_unit : pC per unit
        Sensitivity of a piezoelectric sensor, if the amplifier's range is a charge.
    amplifier
        Name of the `[[amplifier]]` to which the range is sent; empty: the range is set by hand.
    range_v : V
        Largest voltage of the input, of either sign.
    iepe_ma : mA
        Excitation current of an IEPE sensor, for accelerations and forces; 0: none.
    coupling
        ``ac`` or ``dc``; empty: the module's default, ``ac`` with IEPE.
    terminal_configuration
        ``rse``, ``nrse``, ``differential`` or ``pseudodifferential``; empty: the module's default.
    teds
        Whether the IEPE sensor's electronic data sheet is read. It scales if no sensitivity is given, and is compared
        with ``mv_per_unit`` otherwise.
    delay_us : microseconds
        Delay of an amplifier before the input; the module's own delay is added.
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
    def _check(self) -> "ChannelTable":
        scales = (self.mv_per_unit, self.units_per_volt, self.amplifier_range)
        n_scales = sum(scale is not None for scale in scales)
        if n_scales > 1 or (n_scales == 0 and not self.teds):
            raise ValueError(
                f"channel {self.name}: give either mv_per_unit (a sensor's sheet) or units_per_volt (a voltage output) "
                "or amplifier_range (a charge amplifier)"
            )
        if 0 in (*scales, self.pc_per_unit):
            raise ValueError(f"channel {self.name}: a sensitivity of 0; take it from the calibration sheet")
        if self.amplifier_range is None and (self.amplifier or self.pc_per_unit is not None):
            raise ValueError(f"channel {self.name}: amplifier and pc_per_unit go with amplifier_range; give it")
        try:
            si_factor(self.quantity, self.unit)
            self.channel()
        except InputError as error:
            raise ValueError(str(error)) from error
        if self.iepe_ma and self.quantity not in ("acceleration", "force"):
            raise ValueError(
                f"channel {self.name}: IEPE is for acceleration and force, not {self.quantity}; leave iepe_ma out"
            )
        if self.teds and not self.iepe_ma:
            raise ValueError(f"channel {self.name}: TEDS is read from IEPE sensors; give iepe_ma, or leave teds out")
        return self

    @property
    def device(self) -> str:
        return self.terminal.split("/")[0]

    @property
    def sensitivity(self) -> float | None:
        """Return the sensitivity in V per SI unit of the quantity; None if the sensor's TEDS states it."""
        factor = si_factor(self.quantity, self.unit)
        if self.mv_per_unit is not None:
            return self.mv_per_unit * 1e-3 / factor
        if self.amplifier_range is not None:
            return self.amplifier_volts * (self.pc_per_unit or 1.0) / (self.amplifier_range * factor)
        return None if self.units_per_volt is None else 1.0 / (self.units_per_volt * factor)

    @property
    def iepe_current(self) -> float:
        return self.iepe_ma * 1e-3

    @property
    def scale(self) -> float:
        """Return the factor for the values of the task: 1 if DAQmx scales, else SI units per V."""
        return 1.0 if self.iepe_ma or self.sensitivity is None else 1.0 / self.sensitivity

    def channel(self) -> Channel:
        """Return the channel of a recording, before the device is known; refuse a wrong direction or delay."""
        extra = {}
        if self.amplifier_range is not None:
            names = ("amplifier", "amplifier_range", "amplifier_volts", "pc_per_unit")
            extra = {name: getattr(self, name) for name in names if getattr(self, name) not in ("", None)}
        return Channel(
            self.name,
            self.quantity,
            SI_UNITS[self.quantity],
            self.node,
            self.direction,
            high_pass_hz=self.high_pass_hz,
            sensor=self.sensor,
            input_delay_s=self.delay_us * 1e-6 or None,
            extra=extra,
        )

    def recorded_channel(
        self, settings: dict[str, Any], module_delay: float | None, device: dict[str, str], teds: str
    ) -> Channel:
        """Return the channel as it is recorded: with the settings of `read_back`, and all known delays.

        ``module_delay`` (s) is None if the module reports none. ``device`` is the identity of the module, ``teds`` the
        identity of the sensor, empty if it was not read.
        """
        channel = self.channel()
        sensitivity = settings["sensitivity_v_per_unit"] or self.sensitivity or 1.0
        range_volts = settings["range_v"] or self.range_v
        about = {
            "terminal": self.terminal,
            **settings,
            "sensitivity_v_per_unit": sensitivity,
            "range_v": range_volts,
            "teds": teds or None,
            "device": device or None,
        }
        delays = [delay for delay in (channel.input_delay_s, module_delay) if delay is not None]
        return replace(
            channel,
            full_scale=range_volts / abs(sensitivity),
            sensor=self.sensor or teds,
            input_delay_s=float(sum(delays)) if delays else None,
            extra={**channel.extra, **{name: value for name, value in about.items() if value is not None}},
        )

    def add_to(self, channels: Any) -> Any:
        """Create the channel in a DAQmx task, and return DAQmx's object of it."""
        from nidaqmx import constants

        configuration = constants.TerminalConfiguration[_TERMINALS.get(self.terminal_configuration, "DEFAULT")]
        if not self.iepe_ma:
            limit = self.range_v
            created = channels.add_ai_voltage_chan(
                self.terminal, self.name, terminal_config=configuration, min_val=-limit, max_val=limit
            )
        else:
            created = self._add_iepe(channels, configuration)
        if self.coupling:
            created.ai_coupling = constants.Coupling[_COUPLINGS[self.coupling]]
        return created

    def _add_iepe(self, channels: Any, configuration: Any) -> Any:
        """Create a channel that DAQmx scales by the sensitivity in the session or in the TEDS."""
        from nidaqmx import constants

        is_force = self.quantity == "force"
        common = {
            "terminal_config": configuration,
            "units": constants.ForceUnits.NEWTONS if is_force else constants.AccelUnits.METERS_PER_SECOND_SQUARED,
            "current_excit_source": constants.ExcitationSource.INTERNAL,
            "current_excit_val": self.iepe_current,
        }
        if self.teds:
            return self._add_with_teds(channels, is_force, common)
        sensitivity = self.sensitivity
        assert sensitivity is not None
        full_scale = self.range_v / abs(sensitivity)
        common |= {"min_val": -full_scale, "max_val": full_scale}
        if is_force:
            return channels.add_ai_force_iepe_chan(
                self.terminal,
                self.name,
                sensitivity=sensitivity * 1e3,
                sensitivity_units=constants.ForceIEPESensorSensitivityUnits.MILLIVOLTS_PER_NEWTON,
                **common,
            )
        return channels.add_ai_accel_chan(
            self.terminal,
            self.name,
            sensitivity=sensitivity * 1e3 * _STANDARD_GRAVITY,
            sensitivity_units=constants.AccelSensitivityUnits.MILLIVOLTS_PER_G,
            **common,
        )

    def _add_with_teds(self, channels: Any, is_force: bool, common: dict[str, Any]) -> Any:
        from nidaqmx.system.physical_channel import PhysicalChannel

        PhysicalChannel(self.terminal).configure_teds()
        add = channels.add_teds_ai_force_iepe_chan if is_force else channels.add_teds_ai_accel_chan
        created = add(self.terminal, self.name, **common)
        # the limits follow from the range in V only now that the sensitivity is known
        limit = self.range_v / abs(self._task_sensitivity(created))
        created.ai_min, created.ai_max = -limit, limit
        return created

    def _task_sensitivity(self, created: Any) -> float:
        """Return the sensitivity by which the task scales, V per SI unit."""
        from nidaqmx import constants

        if self.quantity == "force":
            per_pound = constants.ForceIEPESensorSensitivityUnits.MILLIVOLTS_PER_POUND
            force = _POUND if created.ai_force_iepe_sensor_sensitivity_units == per_pound else 1.0
            return float(created.ai_force_iepe_sensor_sensitivity) * 1e-3 / force
        is_volts = created.ai_accel_sensitivity_units == constants.AccelSensitivityUnits.VOLTS_PER_G
        return float(created.ai_accel_sensitivity) * (1.0 if is_volts else 1e-3) / _STANDARD_GRAVITY

    def read_back(self, created: Any) -> dict[str, Any]:
        """Read the settings of the created channel from the driver, after the timing is set.

        A setting that the channel does not have is None.

        ``range_v`` is the largest magnitude that the input converts (V), ``iepe_a`` the excitation current (A), and
        ``sensitivity_v_per_unit`` the sensitivity by which the task scales (V per SI unit), None if the task gives
        volts.
        """
        high, low = query(lambda: float(created.ai_rng_high)), query(lambda: float(created.ai_rng_low))
        coupling = query(lambda: created.ai_coupling.name)
        terminals = query(lambda: created.ai_term_cfg.name)
        sensitivity = query(lambda: self._task_sensitivity(created)) if self.iepe_ma else None
        return {
            "sensitivity_v_per_unit": sensitivity,
            "range_v": None if high is None or low is None else min(abs(high), abs(low)),
            "coupling": next((ours for ours, theirs in _COUPLINGS.items() if theirs == coupling), None),
            "terminal_configuration": next((ours for ours, theirs in _TERMINALS.items() if theirs == terminals), None),
            "iepe_a": query(lambda: float(created.ai_excit_val)),
        }

    def mismatches(self, settings: dict[str, Any]) -> list[str]:
        """Describe the settings that differ from the request and falsify or endanger the samples, one sentence each."""
        sentences = []
        if settings["range_v"] is not None and settings["range_v"] < 0.999 * self.range_v:
            sentences.append(f"the input takes {settings['range_v']:g} V, not {self.range_v:g} V as requested")
        for name in ("coupling", "terminal_configuration"):
            requested, actual = getattr(self, name), settings[name]
            if requested and actual != requested:
                sentences.append(
                    f"{name.replace('_', ' ')} is {actual or 'not settable'}, not {requested} as requested"
                )
        current = settings["iepe_a"] or 0.0
        if abs(current - self.iepe_current) > SETTINGS.excitation_tolerance * self.iepe_current:
            sentences.append(f"excitation is {1e3 * current:g} mA, not {1e3 * self.iepe_current:g} mA as requested")
        actual, requested = settings["sensitivity_v_per_unit"], self.sensitivity
        ratio = actual / requested if self.teds and requested is not None and actual is not None else 1.0
        if abs(ratio - 1) >= SETTINGS.teds_tolerance:
            sentences.append(
                f"the sensor's TEDS says {100 * ratio:.4g} % of the sensitivity in the session; is another sensor "
                "plugged in?"
            )
        return [f"channel {self.name}: {sentence}" for sentence in sentences]


class CounterTable(BaseModel):
    """One counter of a session file: an angular encoder, or edges.

    Parameters
    ----------
    name
        Name of the channel in the recording.
    counter
        Name of the counter, such as ``cDAQ1/_ctr0``.
    kind
        ``encoder`` (an angle in rad) or ``edges`` (a number).
    pulses_per_revolution
        Pulses of the encoder's signal A per revolution.
    decoding
        Edges of the encoder that are counted: ``x1``, ``x2`` or ``x4``.
    index
        Whether the encoder's signal Z sets the angle to zero once per revolution.
    node, direction, sensor
        Fields of the same names in a recording's `Channel`.
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

    @property
    def device(self) -> str:
        return self.counter.split("/")[0]

    def recorded_channel(self, device: dict[str, str]) -> Channel:
        """Return the channel as it is recorded, with the identity of its device.

        Its delay is 0, because a counter has no filter.
        """
        extra: dict[str, Any] = {"terminal": self.counter, "kind": self.kind, "device": device}
        if self.kind == "encoder":
            extra |= {"pulses_per_revolution": self.pulses_per_revolution, "decoding": self.decoding}
        quantity = "angle" if self.kind == "encoder" else "dimensionless"
        place = (self.node, self.direction)
        return Channel(
            self.name, quantity, SI_UNITS[quantity], *place, sensor=self.sensor, input_delay_s=0.0, extra=extra
        )

    def task(self, rate: float, sample_clock: str, buffer: int) -> Any:
        """Make a DAQmx task that takes one value at each tick of the inputs' sample clock.

        It must be started before the task of the inputs.
        """
        import nidaqmx  # optional: the extra `devices`
        from nidaqmx import constants

        task = nidaqmx.Task()
        try:
            if self.kind == "edges":
                task.ci_channels.add_ci_count_edges_chan(self.counter, self.name, edge=constants.Edge.RISING)
            else:
                task.ci_channels.add_ci_ang_encoder_chan(
                    self.counter,
                    self.name,
                    decoding_type=constants.EncoderType[f"X_{self.decoding[1]}"],
                    zidx_enable=self.index,
                    units=constants.AngleUnits.RADIANS,
                    pulses_per_rev=self.pulses_per_revolution,
                )
            mode = constants.AcquisitionType.CONTINUOUS
            task.timing.cfg_samp_clk_timing(rate, source=sample_clock, sample_mode=mode)
            task.in_stream.input_buf_size = buffer
        except BaseException:
            task.close()
            raise
        return task


class CounterReader:
    def __init__(self, task: Any) -> None:
        from nidaqmx import stream_readers

        self._reader = stream_readers.CounterReader(task.in_stream)
        self._reader.verify_array_shape = False

    def read(self, length: int, timeout: float) -> Real:
        """Read the next values (length,); wait at most ``timeout`` seconds."""
        values = np.empty(length)
        self._reader.read_many_sample_double(values, length, timeout)
        return values
