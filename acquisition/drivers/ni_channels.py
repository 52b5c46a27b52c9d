"""Inputs and counters of National Instruments modules as channels of a DAQmx task."""

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError

from ..channels import Channel
from .ni_devices import sensor_identity


@dataclass(frozen=True)
class NiCounter:
    """One counter with what is wired to it.

    Parameters
    ----------
    channel
        Name and place; its quantity is an angle (rad) for an encoder, dimensionless for edges.
    counter
        Name of the counter, such as ``cDAQ1/_ctr0``.
    kind
        ``encoder``: signals A and B of an incremental encoder; ``edges``: rising edges of one signal.
    pulses_per_revolution
        Pulses of A a revolution.
    decoding
        Edges that count: ``x1``, ``x2`` or ``x4``.
    index
        Whether signal Z sets the angle to zero once a revolution.

    Raises
    ------
    InputError
        A quantity that a counter does not give.
    """

    channel: Channel
    counter: str
    kind: Literal["encoder", "edges"] = "encoder"
    pulses_per_revolution: int = 1024
    decoding: Literal["x1", "x2", "x4"] = "x4"
    index: bool = False

    def __post_init__(self) -> None:
        wanted = "angle" if self.kind == "encoder" else "dimensionless"
        if self.channel.quantity != wanted:
            raise InputError(
                f"counter {self.channel.name}: quantity {self.channel.quantity!r} does not go with {self.kind}; "
                f"give {wanted!r}"
            )

    @property
    def device(self) -> str:
        """The device of the counter: ``cDAQ1``."""
        return self.counter.split("/")[0]

    def described(self, identity: dict[str, str]) -> Channel:
        """The channel as recorded; a counter has no filter, so that its values are not late."""
        extra = {**self.channel.extra, "terminal": self.counter, "kind": self.kind, "device": identity}
        if self.kind == "encoder":
            extra |= {"pulses_per_revolution": self.pulses_per_revolution, "decoding": self.decoding}
        return replace(self.channel, input_delay_s=self.channel.input_delay_s or 0.0, extra=extra)

    def task(self, rate: float, sample_clock: str, buffer: int) -> Any:
        """A DAQmx task that takes one value at each tick of the inputs' sample clock; start it before them."""
        import nidaqmx
        from nidaqmx import constants

        task = nidaqmx.Task()
        try:
            if self.kind == "edges":
                task.ci_channels.add_ci_count_edges_chan(self.counter, self.channel.name, edge=constants.Edge.RISING)
            else:
                task.ci_channels.add_ci_ang_encoder_chan(
                    self.counter,
                    self.channel.name,
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


class CounterReading:
    """A running counter task, read block by block.

    Parameters
    ----------
    task
        The task of `NiCounter.task`.
    """

    def __init__(self, task: Any) -> None:
        from nidaqmx.stream_readers import CounterReader

        self.task = task
        self._reader = CounterReader(task.in_stream)
        self._reader.verify_array_shape = False

    def read(self, length: int, timeout: float) -> NDArray[np.float64]:
        """The next values (length,); waits ``timeout`` seconds at most."""
        values = np.empty(length)
        self._reader.read_many_sample_double(values, length, timeout)
        return values

    def close(self) -> None:
        """Stop and clear the task."""
        self.task.close()


T = TypeVar("T")

_CLOSE = 0.2
"""Share by which an excitation may differ from the nominal one: a module says 2.1 mA where 2 mA are asked."""

COUPLINGS = {"ac": "AC", "dc": "DC"}
TERMINALS = {"rse": "RSE", "nrse": "NRSE", "differential": "DIFF", "pseudodifferential": "PSEUDO_DIFF"}


@dataclass(frozen=True)
class ReadBack:
    """Settings of an input as the driver tells them; None: this module has no such setting.

    Parameters
    ----------
    range_volts : V
        Largest magnitude that the input converts.
    coupling
        ``ac`` or ``dc``.
    terminal_configuration
        ``rse``, ``nrse``, ``differential`` or ``pseudodifferential``.
    iepe_current : A
        Excitation current; 0: none.
    volts_per_unit
        Sensitivity by which the task scales, V per SI unit; None where it gives volts.
    """

    range_volts: float | None
    coupling: str | None
    terminal_configuration: str | None
    iepe_current: float | None
    volts_per_unit: float | None = None


def read_back(created: Any, sensitivity: Callable[[Any], float] | None) -> ReadBack:
    """Ask a created channel for its settings; ask after the timing is set.

    Parameters
    ----------
    created
        The channel as nidaqmx calls it.
    sensitivity
        Function that reads the sensitivity, V per SI unit, from it; None: the task gives volts.
    """
    high, low = _asked(lambda: float(created.ai_rng_high)), _asked(lambda: float(created.ai_rng_low))
    coupling = _asked(lambda: created.ai_coupling.name)
    terminals = _asked(lambda: created.ai_term_cfg.name)
    return ReadBack(
        None if high is None or low is None else min(abs(high), abs(low)),
        next((ours for ours, theirs in COUPLINGS.items() if theirs == coupling), None),
        next((ours for ours, theirs in TERMINALS.items() if theirs == terminals), None),
        _asked(lambda: float(created.ai_excit_val)),
        None if sensitivity is None else _asked(lambda: sensitivity(created)),
    )


def mismatches(wanted: "NiInput", found: ReadBack) -> list[str]:
    """Differences that falsify or endanger the samples, one sentence each."""
    name, said = wanted.channel.name, []
    if found.range_volts is not None and found.range_volts < 0.999 * wanted.range_volts:
        said.append(f"channel {name}: the input takes {found.range_volts:g} V, not {wanted.range_volts:g} V as asked")
    for what, asked, got in (
        ("coupling", wanted.coupling, found.coupling),
        ("terminal configuration", wanted.terminal_configuration, found.terminal_configuration),
    ):
        if asked and got != asked:
            said.append(f"channel {name}: {what} is {got or 'not settable'}, not {asked} as asked")
    current = found.iepe_current or 0.0
    if abs(current - wanted.iepe_current) > _CLOSE * wanted.iepe_current:
        said.append(
            f"channel {name}: excitation is {1e3 * current:g} mA, not {1e3 * wanted.iepe_current:g} mA as asked"
        )
    if wanted.teds and wanted.sensitivity is not None and found.volts_per_unit is not None:
        ratio = found.volts_per_unit / wanted.sensitivity
        if not 0.95 < ratio < 1.05:
            said.append(
                f"channel {name}: the sensor's TEDS says {100 * ratio:.4g} % of the sensitivity in the session; is "
                "another sensor plugged in?"
            )
    return said


def _asked(question: Callable[[], T]) -> T | None:
    """The answer, or None where the module has no such setting."""
    from nidaqmx.errors import DaqError, DaqFunctionNotSupportedError

    with suppress(DaqError, DaqFunctionNotSupportedError):
        return question()
    return None


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
        None: the sensor's TEDS states it.
    range_volts : V
        Largest magnitude of the input.
    iepe_current : A
        Excitation current of an IEPE sensor; 0: a plain voltage.
    coupling
        ``ac`` or ``dc``; empty: as the module chooses (AC for IEPE).
    terminal_configuration
        ``rse``, ``nrse``, ``differential`` or ``pseudodifferential``; empty: as the module chooses.
    teds
        Whether the IEPE sensor's electronic data sheet is read: it scales, and is held against ``sensitivity``.

    Raises
    ------
    InputError
        A sensitivity of zero, a range that is not positive, IEPE or TEDS for what has no such sensor.
    """

    channel: Channel
    terminal: str
    sensitivity: float | None
    range_volts: float = 5.0
    iepe_current: float = 0.0
    coupling: str = ""
    terminal_configuration: str = ""
    teds: bool = False

    def __post_init__(self) -> None:
        name = self.channel.name
        if self.sensitivity == 0 or (self.sensitivity is None and not self.teds):
            raise InputError(f"channel {name}: sensitivity 0 V per unit; take it from the calibration sheet")
        if not self.range_volts > 0:
            raise InputError(f"channel {name}: range {self.range_volts} V must be positive")
        if self.iepe_current and self.channel.quantity not in IEPE_QUANTITIES:
            raise InputError(
                f"channel {name}: IEPE is for {' and '.join(IEPE_QUANTITIES)}, not {self.channel.quantity}; "
                "leave iepe_current out"
            )
        if self.teds and not self.iepe_current:
            raise InputError(f"channel {name}: TEDS is read from IEPE sensors; give iepe_ma, or leave teds out")
        for what, value, known in (
            ("coupling", self.coupling, COUPLINGS),
            ("terminal configuration", self.terminal_configuration, TERMINALS),
        ):
            if value and value not in known:
                raise InputError(f"channel {name}: {what} {value!r} is not known; use one of {', '.join(known)}")

    @property
    def device(self) -> str:
        """The module: ``cDAQ1Mod1``."""
        return self.terminal.split("/")[0]

    @property
    def full_scale(self) -> float:
        """Largest magnitude that is asked for, in the channel's unit; NaN where only the TEDS knows the sensitivity."""
        return self.range_volts / abs(self.sensitivity) if self.sensitivity else math.nan

    @property
    def scale(self) -> float:
        """Factor for the task's values: 1 where DAQmx scales, else SI units per V."""
        return 1.0 if self.iepe_current else 1.0 / (self.sensitivity or 1.0)

    def described(self, module_delay: float | None, found: ReadBack, device: dict[str, str], sensor: str) -> Channel:
        """The channel as recorded: with its terminal, what was read back, and all delays known of it.

        Parameters
        ----------
        module_delay : s
            The module's own; None: it tells none. An amplifier's, which the channel had, is added.
        found
            Settings as the driver tells them.
        device
            Model, serial number and calibration of the module.
        sensor
            What the sensor's TEDS says of it; empty: not read.
        """
        sensitivity = found.volts_per_unit or self.sensitivity or 1.0
        reach = found.range_volts or self.range_volts
        settings = {
            "terminal": self.terminal,
            "sensitivity_v_per_unit": sensitivity,
            "range_v": reach,
            "coupling": found.coupling,
            "terminal_configuration": found.terminal_configuration,
            "iepe_a": found.iepe_current,
            "teds": sensor or None,
            "device": device or None,
        }
        extra = {**self.channel.extra, **{name: value for name, value in settings.items() if value is not None}}
        known = [delay for delay in (self.channel.input_delay_s, module_delay) if delay is not None]
        limits = [limit for limit in (self.channel.full_scale, reach / abs(sensitivity)) if limit is not None]
        return replace(
            self.channel,
            full_scale=min(limits),
            sensor=self.channel.sensor or sensor,
            input_delay_s=float(sum(known)) if known else None,
            extra=extra,
        )

    def add_to(self, channels: Any) -> Any:
        """Create the channel among those of a DAQmx task, and return what DAQmx calls it."""
        from nidaqmx import constants

        configuration = constants.TerminalConfiguration[TERMINALS.get(self.terminal_configuration, "DEFAULT")]
        if not self.iepe_current:
            reach = self.range_volts
            created = channels.add_ai_voltage_chan(
                self.terminal, self.channel.name, terminal_config=configuration, min_val=-reach, max_val=reach
            )
        else:
            created = self._iepe(channels, configuration)
        if self.coupling:
            created.ai_coupling = constants.Coupling[COUPLINGS[self.coupling]]
        return created

    def _iepe(self, channels: Any, configuration: Any) -> Any:
        """A channel that DAQmx scales, by the session's sensitivity or by that of the TEDS."""
        from nidaqmx import constants

        force = self.channel.quantity == "force"
        common = {
            "terminal_config": configuration,
            "units": constants.ForceUnits.NEWTONS if force else constants.AccelUnits.METERS_PER_SECOND_SQUARED,
            "current_excit_source": constants.ExcitationSource.INTERNAL,
            "current_excit_val": self.iepe_current,
        }
        if self.teds:
            return self._by_teds(channels, force, common)
        assert self.sensitivity is not None
        common |= {"min_val": -self.full_scale, "max_val": self.full_scale}
        if force:
            return channels.add_ai_force_iepe_chan(
                self.terminal,
                self.channel.name,
                sensitivity=self.sensitivity * 1e3,
                sensitivity_units=constants.ForceIEPESensorSensitivityUnits.MILLIVOLTS_PER_NEWTON,
                **common,
            )
        return channels.add_ai_accel_chan(
            self.terminal,
            self.channel.name,
            sensitivity=self.sensitivity * 1e3 * STANDARD_GRAVITY,
            sensitivity_units=constants.AccelSensitivityUnits.MILLIVOLTS_PER_G,
            **common,
        )

    def _by_teds(self, channels: Any, force: bool, common: dict[str, Any]) -> Any:
        """A channel with the sensitivity of its sensor's TEDS; its limits follow from the range in V."""
        from nidaqmx.system.physical_channel import PhysicalChannel

        PhysicalChannel(self.terminal).configure_teds()
        add = channels.add_teds_ai_force_iepe_chan if force else channels.add_teds_ai_accel_chan
        created = add(self.terminal, self.channel.name, **common)
        reach = self.range_volts / abs(self.told_sensitivity(created))
        created.ai_min, created.ai_max = -reach, reach
        return created

    def told_sensitivity(self, created: Any) -> float:
        """The sensitivity by which the task scales, V per SI unit."""
        from nidaqmx import constants

        if self.channel.quantity == "force":
            per_pound = constants.ForceIEPESensorSensitivityUnits.MILLIVOLTS_PER_POUND
            pound = 4.4482216152605 if created.ai_force_iepe_sensor_sensitivity_units == per_pound else 1.0
            return float(created.ai_force_iepe_sensor_sensitivity) * 1e-3 / pound
        volts = created.ai_accel_sensitivity_units == constants.AccelSensitivityUnits.VOLTS_PER_G
        return float(created.ai_accel_sensitivity) * (1.0 if volts else 1e-3) / STANDARD_GRAVITY

    def read_back(self, created: Any) -> ReadBack:
        """The settings of the created channel, as the driver tells them."""
        return read_back(created, self.told_sensitivity if self.iepe_current else None)

    def sensor_identity(self) -> str:
        """What the sensor's TEDS says of it; empty where it is not read."""
        return sensor_identity(self.terminal) if self.teds else ""


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
