"""Simulated robot cells, milled or tapped with a hammer: sources of recordings without hardware."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from acquisition import Block, StreamDescription
from millfrf.core import TIP, InputError, Real
from millfrf.core.compilation import CUTTING, SIMULATION, compile_kernels
from millfrf.cutting import MillingProcess, refuse_varied, tooth_offsets
from modal_fit import ModalModel

from .laboratory import Decimator, Sensor, SignalChain, cutting_table, hammer_sensors, milling_sensors, setup_text
from .milling_loop import Material, empty_memory, material_named, mill, prepare_cut
from .modal_integrator import ResponseMap, discretise, require_simulable, respond
from .settings import SETTINGS
from .speed_profiles import ConstantSpeed, SpeedProfile

STREAM = "daq"  # name of the only stream of a simulated cell


class Simulation(Protocol):
    """A simulation that advances step by step and keeps its state."""

    def advance(self, n_instants: int) -> tuple[Real, Real]:
        """Return modal history (n, 2 n_modes) and force (n, 3), N, at the next instants."""
        ...


class SampledCell(ABC):
    """Base class of the simulated cells: oversampled simulation, response, anti-alias filter, sensors, blocks.

    Implements :class:`acquisition.Source`. The host times of the blocks come from an ideal clock that starts at zero,
    so that a recording repeats bit by bit. See :class:`MillingCell` and :class:`HammerCell`.
    """

    def __init__(
        self,
        structure: ModalModel,
        duration: float,
        sample_rate: float,
        sensors: Sequence[Sensor],
        seed: int,
        oversampling: int,
        block_length: int,
    ) -> None:
        _require_sampling(duration, sample_rate, seed, oversampling, block_length)
        require_simulable(structure)
        compile_kernels(*CUTTING, *SIMULATION)
        self.structure = structure
        self.sensors = tuple(sensors)
        self.sample_rate = float(sample_rate)
        self.seed = int(seed)
        self.n_samples = max(round(duration * sample_rate), 1)
        self.step = 1.0 / (sample_rate * oversampling)
        self._oversampling = int(oversampling)
        self._block_length = int(block_length)
        self._response_map()  # raises an error for sensors that the structure does not have, before any recording
        channels = tuple(sensor.channel() for sensor in self.sensors)
        self.streams = (StreamDescription(STREAM, self.sample_rate, 0.0, channels),)
        self._pipeline: _Pipeline | None = None
        self._n_read = 0

    @abstractmethod
    def _simulation(self) -> Simulation:
        """Return a new simulation, at rest."""

    @abstractmethod
    def _rehearsal(self) -> tuple[Simulation, int]:
        """Return a new simulation from which the size of the signals is computed, and its number of samples."""

    def open(self) -> None:
        """Start the simulation from rest, at the first sample."""
        noise_seed = int(np.random.SeedSequence([self.seed, 1]).generate_state(1)[0])
        chain = SignalChain(self.sensors, self.sample_rate, self._noise_rms(), noise_seed)
        self._pipeline = self._new_pipeline(self._simulation(), chain)
        self._n_read = 0

    def read(self) -> Block | None:
        """Give the next block of samples, or None when the recording is complete.

        Raises
        ------
        InputError
            The cell has not been opened.
        """
        if self._pipeline is None:
            raise InputError("the simulated cell is not open; call open() first")
        length = min(self._block_length, self.n_samples - self._n_read)
        if length <= 0:
            return None
        samples = self._pipeline.take(length)
        first, self._n_read = self._n_read, self._n_read + length
        return Block(STREAM, first, samples, self._n_read / self.sample_rate)

    def close(self) -> None:
        """Discard the simulation; the cell may be opened again."""
        self._pipeline = None

    def samples(self) -> Real:
        """Return the complete recording in memory, (n_samples, n_channels), for short tests."""
        self.open()
        blocks = []
        while (block := self.read()) is not None:
            blocks.append(block.samples)
        self.close()
        return np.concatenate(blocks)

    def _noise_rms(self) -> Real:
        """Return the standard deviation of the noise of each channel, SI.

        It is the channel's noise share of the standard deviation of the signal in a rehearsal.
        """
        shares = np.array([sensor.noise for sensor in self.sensors])
        if not shares.any():
            return shares
        simulation, n_samples = self._rehearsal()
        return np.asarray(shares * self._new_pipeline(simulation, None).take(n_samples).std(axis=0))

    def _response_map(self) -> ResponseMap:
        quantities = [sensor.quantity for sensor in self.sensors]
        return ResponseMap(self.structure, quantities, [sensor.degree_of_freedom for sensor in self.sensors], self.step)

    def _new_pipeline(self, simulation: Simulation, chain: SignalChain | None) -> "_Pipeline":
        decimator = Decimator(self._oversampling, len(self.sensors))
        return _Pipeline(simulation, self._response_map(), decimator, self._oversampling, chain)


class _Pipeline:
    """Chain of simulation, response, decimation and sensors that gives any number of output samples at a time."""

    def __init__(
        self,
        simulation: Simulation,
        response: ResponseMap,
        decimator: Decimator,
        oversampling: int,
        chain: SignalChain | None,
    ) -> None:
        self._simulation, self._response, self._decimator, self._chain = simulation, response, decimator, chain
        self._oversampling = oversampling
        self._n_samples = 0  # output samples given so far
        self._n_instants = 0  # instants simulated so far

    def take(self, n_samples: int) -> Real:
        last_instant = (self._n_samples + n_samples - 1) * self._oversampling + self._decimator.lookahead
        n_instants = last_instant + 2 - self._n_instants  # one more than needed: the response lags one instant
        motion = self._response(*self._simulation.advance(n_instants))
        if self._n_instants == 0:
            motion = motion[1:]
        self._n_instants += n_instants
        self._n_samples += n_samples
        samples = self._decimator(motion)
        return samples if self._chain is None else self._chain(samples)


def _require_sampling(duration: float, sample_rate: float, seed: int, oversampling: int, block_length: int) -> None:
    for name, value, unit in (("duration", duration, "s"), ("sample rate", sample_rate, "Hz")):
        if not (math.isfinite(value) and value > 0):
            raise InputError(f"{name} = {value!r} {unit} must be positive and finite")
    for name, count in (("oversampling", oversampling), ("block length", block_length)):
        if not (isinstance(count, int) and count >= 1):
            raise InputError(f"{name} = {count!r} must be a whole number, 1 or more")
    if not (isinstance(seed, int) and seed >= 0):
        raise InputError(f"seed = {seed!r} must be a whole number, zero or more")


class MillingCell(SampledCell):
    """A simulated milling test: a structure is milled with regenerative feedback, sensors record forces and motion.

    ``X = H F`` and ``F = F_p + a Ktc [alpha(t)] (X - X_tau)`` (Mohammadi & Ahmadi, Eqs. 1 and 4) while every tooth
    stays in the cut. Beyond that, teeth leave the cut and the surface of several earlier teeth counts, so that chatter
    grows to a finite amplitude. The structure is integrated exactly for forces that are linear over a step.

    Parameters
    ----------
    structure
        Modal model (receptance) with responses and excitations ``TCP:+X +Y +Z``, and the responses of the sensors.
    process
        Cutter, immersion, force coefficients, feed, runout.
    depth : m
        Axial depth of cut.
    speed : rad/s
        Spindle speed, or a profile such as :class:`LinearSweep`.
    duration : s
        Duration of the recording.
    sample_rate : Hz
        Sample rate of the recording.
    material
        ``"homogeneous"``, ``"porous"`` or a ``Material``.
    sensors
        Sensors of the cell. Default :func:`milling_sensors`: ``fx fy fz`` at the tip and ``ax ay az`` at the housing,
        with 1 % noise. The noise is a share of the channel's standard deviation in a rehearsal without noise of at
        most 5 s, which runs through all speeds of the profile.
    seed
        Seed of noise and pores; the same seed gives the same recording for any block length.
    oversampling
        Number of steps of the simulation per sample.
    block_length
        Number of samples per block.

    Raises
    ------
    InputError
        An impossible value, a structure without the needed degrees of freedom, or a speed too high for the rate.

    Examples
    --------
    >>> from replay_data import default_structure
    >>> cutter = MillingProcess(2, 12.7e-3, math.pi / 2, 119e6, 0.17, 0.33, math.pi / 2, math.pi, 0.15e-3)
    >>> cell = MillingCell(default_structure(), cutter, 1e-3, 800 * math.pi / 30, duration=0.1)
    >>> cell.samples().shape
    (1024, 6)
    """

    def __init__(
        self,
        structure: ModalModel,
        process: MillingProcess,
        depth: float,
        speed: float | SpeedProfile,
        duration: float,
        *,
        sample_rate: float = 10240.0,
        material: str | Material = "homogeneous",
        sensors: Sequence[Sensor] | None = None,
        seed: int = 0,
        oversampling: int = 2,
        block_length: int = 8192,
    ) -> None:
        chosen = milling_sensors() if sensors is None else tuple(sensors)
        super().__init__(structure, duration, sample_rate, chosen, seed, oversampling, block_length)
        if not (math.isfinite(depth) and depth >= 0):
            raise InputError(f"depth = {depth!r} m must be zero or more, and finite")
        refuse_varied(
            process,
            "the simulated cell",
            "give straight edges at equal pitch, undamped",
            takes=("runout",),
        )
        self.process = process
        self.depth = float(depth)
        self.profile = ConstantSpeed(float(speed)) if isinstance(speed, (int, float)) else speed
        self.material = material_named(material)
        self.duration = float(duration)
        steps = 2 * math.pi / process.teeth / (self.profile.fastest * self.step)
        if steps < SETTINGS.steps_per_tooth:
            raise InputError(
                f"spindle speed {self.profile.fastest * 30 / math.pi:g} rpm gives {steps:.1f} steps per tooth, "
                f"fewer than {SETTINGS.steps_per_tooth}; raise sample_rate or oversampling"
            )
        self.title = f"simulated milling, {self.material.name}, {self.depth * 1e3:g} mm deep"
        self.setup = setup_text(
            {
                "test": {"kind": "simulated milling", "seed": self.seed, "duration_s": self.duration},
                "cut": {"depth_m": self.depth, "material": self.material.name, **self.profile.description()},
                "cutting": cutting_table(process),
            }
        )

    def _simulation(self) -> Simulation:
        return _MillingSimulation(self, self.profile)

    def _rehearsal(self) -> tuple[Simulation, int]:
        share = min(1.0, SETTINGS.longest_rehearsal / self.duration)
        profile = self.profile if share == 1.0 else self.profile.rehearsed(share)
        return _MillingSimulation(self, profile), max(round(share * self.duration * self.sample_rate), 1)


class _MillingSimulation:
    """The compiled regenerative loop of a milling cell, with its state."""

    def __init__(self, cell: MillingCell, profile: SpeedProfile) -> None:
        pore_seed = np.random.SeedSequence([cell.seed, 0]).generate_state(1, np.uint64)[0]
        self._step = cell.step
        self._profile = profile
        self._dynamics = discretise(cell.structure, cell.step)
        self._cut = prepare_cut(cell.process, cell.depth, cell.material, int(pore_seed))
        self._offsets = tooth_offsets(cell.process)
        longest_period = 2 * math.pi / cell.process.teeth / (profile.slowest * cell.step)  # steps
        self._memory = empty_memory(len(cell.structure.poles), cell.process.teeth, math.ceil(longest_period))

    def advance(self, n_instants: int) -> tuple[Real, Real]:
        first = int(self._memory.counters[0])
        angles = self._profile.angle(self._step * np.arange(first, first + n_instants, dtype=float))
        # angle of the step that leads to the first instant; at the very start, angle of the step after it
        before = self._profile.angle(np.array([max(first - 1, 0) * self._step, max(first, 1) * self._step]))
        history = np.empty((n_instants, len(self._memory.modal)))
        force = np.empty((n_instants, 3))
        first_step = float(before[1] - before[0])
        mill(angles, first_step, self._dynamics, self._cut, self._offsets, self._memory, force, history)
        return history, force


class HammerCell(SampledCell):
    """Half-sine taps at the tool tip, direction by direction, each followed by its free decay.

    Each tap is ``F(t) = A sin(pi (t - t0) / width)`` for ``0 < t - t0 < width``; A varies by 15 % and t0 by up to a
    sample, as by hand. The force channels record the tap, all other channels the response, so that both H_TT (motion at
    the tip) and H_ST (motion at the housing) can be estimated (Mohammadi & Ahmadi, "Calibration of TCP FRF").

    Parameters
    ----------
    structure
        Modal model (receptance) with excitations ``TCP:+X +Y +Z`` and the responses of the sensors.
    directions
        Degrees of freedom to tap, in this order, among ``TCP:+X +Y +Z``.
    taps
        Number of taps in each direction.
    spacing : s
        Time between taps; a segment of this length holds one tap and its free decay.
    peak : N
        Mean amplitude A of the taps.
    width : s
        Duration of the half sine; 4 ms (a soft tip) excites up to about 250 Hz.
    sample_rate, sensors, seed, oversampling, block_length
        Options of the same names in :class:`MillingCell`; default sensors :func:`hammer_sensors`.

    Raises
    ------
    InputError
        An impossible value.

    Examples
    --------
    >>> from replay_data import default_structure
    >>> cell = HammerCell(default_structure(), taps=1, spacing=0.5)
    >>> [channel.name for channel in cell.streams[0].channels]
    ['fx', 'fy', 'fz', 'ax', 'ay', 'az', 'tip_ax', 'tip_ay', 'tip_az']
    >>> cell.n_samples
    15360
    """

    def __init__(
        self,
        structure: ModalModel,
        *,
        directions: Sequence[str] = TIP,
        taps: int = 5,
        spacing: float = 4.0,
        peak: float = 200.0,
        width: float = 4e-3,
        sample_rate: float = 10240.0,
        sensors: Sequence[Sensor] | None = None,
        seed: int = 0,
        oversampling: int = 2,
        block_length: int = 8192,
    ) -> None:
        _require_taps(directions, taps, spacing, peak, width)
        chosen = hammer_sensors() if sensors is None else tuple(sensors)
        duration = len(directions) * taps * spacing
        super().__init__(structure, duration, sample_rate, chosen, seed, oversampling, block_length)
        self.directions = tuple(directions)
        self.taps, self.spacing, self.peak, self.width = taps, float(spacing), float(peak), float(width)
        self.title = f"simulated hammer test, {taps} taps at {', '.join(directions)}"
        self.setup = setup_text(
            {
                "test": {"kind": "simulated hammer", "seed": self.seed, "duration_s": duration},
                "hammer": {
                    "directions": " ".join(directions),
                    "taps_per_direction": taps,
                    "spacing_s": self.spacing,
                    "first_tap_s": SETTINGS.first_tap,
                },
            }
        )

    def _simulation(self) -> Simulation:
        return _HammerSimulation(self)

    def _rehearsal(self) -> tuple[Simulation, int]:
        return _HammerSimulation(self), self.n_samples


class _HammerSimulation:
    """Force of all taps of a hammer cell, and the response of the structure to them."""

    def __init__(self, cell: HammerCell) -> None:
        generator = np.random.default_rng([cell.seed, 0])
        n_taps = len(cell.directions) * cell.taps
        jitter = generator.uniform(0, 1 / cell.sample_rate, n_taps)
        self._starts = SETTINGS.first_tap + cell.spacing * np.arange(n_taps) + jitter
        self._peaks = cell.peak * np.clip(generator.normal(1, SETTINGS.tap_scatter, n_taps), *SETTINGS.tap_limits)
        self._columns = [TIP.index(direction) for direction in cell.directions for _ in range(cell.taps)]
        self._width, self._step = cell.width, cell.step
        self._modes = discretise(cell.structure, cell.step).modes
        self._modal = np.zeros(2 * len(cell.structure.poles))
        self._last_force = np.zeros(3)
        self._n_instants = 0

    def advance(self, n_instants: int) -> tuple[Real, Real]:
        times = np.arange(self._n_instants, self._n_instants + n_instants) * self._step
        force = np.zeros((n_instants, 3))
        for start, peak, column in zip(self._starts, self._peaks, self._columns, strict=True):
            low, high = np.searchsorted(times, [start, start + self._width])
            force[low:high, column] += peak * np.sin(math.pi * (times[low:high] - start) / self._width)
        history = np.empty((n_instants, len(self._modal)))
        respond(force, self._modes, self._last_force, self._modal, history)
        self._n_instants += n_instants
        return history, force


def _require_taps(directions: Sequence[str], taps: int, spacing: float, peak: float, width: float) -> None:
    unknown = [direction for direction in directions if direction not in TIP]
    if unknown or not directions:
        raise InputError(f"taps at {', '.join(unknown) or 'nowhere'}; give one or more of {', '.join(TIP)}")
    if not (isinstance(taps, int) and taps >= 1):
        raise InputError(f"{taps!r} taps per direction; give a whole number, 1 or more")
    for name, value, unit in (("spacing", spacing, "s"), ("peak", peak, "N"), ("width", width, "s")):
        if not (math.isfinite(value) and value > 0):
            raise InputError(f"{name} of the taps = {value!r} {unit} must be positive and finite")
    if spacing <= SETTINGS.first_tap + width:
        raise InputError(f"taps {spacing:g} s apart leave no time to ring down; take several seconds")
