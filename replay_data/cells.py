"""Simulated robot cells, milled or tapped with a hammer: sources of recordings without hardware."""

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from acquisition import Block, StreamDescription
from millfrf.core import TIP, InputError
from millfrf.core.compilation import CUTTING, SIMULATION, compile_kernels
from millfrf.cutting import MillingProcess, refuse_varied, tooth_offsets
from modal_fit import ModalModel

from .laboratory import Decimator, Sensor, SignalChain, cutting_table, hammer_sensors, milling_sensors, setup_text
from .material import Material, material_named
from .milling_loop import empty_memory, mill, prepare_cut
from .modal_integrator import ResponseMap, discretise, require_simulable, respond
from .speed_profiles import ConstantSpeed, SpeedProfile

STREAM = "daq"
"""Name of the one stream a simulated cell gives."""


class March(Protocol):
    """A simulation that marches on from where it stands."""

    def advance(self, n_instants: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Modal history (n, 2 n_modes) and force (n, 3) at the next instants."""
        ...


class SampledCell:
    """Base of the simulated cells: oversampled march, response, anti-alias filter, sensors, blocks.

    Implements :class:`acquisition.Source`. Host times of the blocks are those of an ideal clock that starts at zero, so
    that a recording repeats bit by bit. See :class:`MillingCell` and :class:`HammerCell`.
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
        self._map()  # refuses sensors the structure does not have, before anything is recorded
        channels = tuple(sensor.channel() for sensor in self.sensors)
        self.streams = (StreamDescription(STREAM, self.sample_rate, 0.0, channels),)
        self._pipeline: _Pipeline | None = None
        self._read = 0

    def _start(self) -> March:
        """A fresh simulation, at rest."""
        raise NotImplementedError

    def _rehearse(self) -> tuple[March, int]:
        """A fresh simulation from which the size of the signals is judged, and how many samples of it."""
        raise NotImplementedError

    def open(self) -> None:
        """Start from rest, at the first sample."""
        noise_seed = int(np.random.SeedSequence([self.seed, 1]).generate_state(1)[0])
        chain = SignalChain(self.sensors, self.sample_rate, self.noise_rms(), noise_seed)
        self._pipeline = _Pipeline(self._start(), self._map(), self._decimator(), chain)
        self._read = 0

    def read(self) -> Block | None:
        """The next block of samples, or None when the recording is complete.

        Raises
        ------
        InputError
            The cell has not been opened.
        """
        if self._pipeline is None:
            raise InputError("the simulated cell is not open; call open() first")
        wanted = min(self._block_length, self.n_samples - self._read)
        if wanted <= 0:
            return None
        samples = self._pipeline.take(wanted, self._oversampling)
        first, self._read = self._read, self._read + wanted
        return Block(STREAM, first, samples, self._read / self.sample_rate)

    def close(self) -> None:
        """Let go of the simulation; the cell may be opened again."""
        self._pipeline = None

    def samples(self) -> NDArray[np.float64]:
        """The whole recording in memory, (n_samples, n_channels), for short tests."""
        self.open()
        blocks = []
        while (block := self.read()) is not None:
            blocks.append(block.samples)
        self.close()
        return np.concatenate(blocks)

    def noise_rms(self) -> NDArray[np.float64]:
        """Standard deviation of each channel's noise, SI, from the size of its signal in a rehearsal."""
        shares = np.array([sensor.noise for sensor in self.sensors])
        if not shares.any():
            return shares
        march, n_samples = self._rehearse()
        pipeline = _Pipeline(march, self._map(), self._decimator(), None)
        size = pipeline.take(n_samples, self._oversampling).std(axis=0)
        return np.asarray(shares * size)

    def _map(self) -> ResponseMap:
        quantities = [sensor.quantity for sensor in self.sensors]
        return ResponseMap(self.structure, quantities, [sensor.degree_of_freedom for sensor in self.sensors], self.step)

    def _decimator(self) -> Decimator:
        return Decimator(self._oversampling, len(self.sensors))


class _Pipeline:
    """March, response, decimation and sensors, asked for whole numbers of output samples."""

    def __init__(self, march: March, response: ResponseMap, decimator: Decimator, chain: SignalChain | None) -> None:
        self._march, self._response, self._decimator, self._chain = march, response, decimator, chain
        self._given = 0
        self._marched = 0

    def take(self, n_samples: int, oversampling: int) -> NDArray[np.float64]:
        last_instant = (self._given + n_samples - 1) * oversampling + self._decimator.lookahead
        instants = last_instant + 2 - self._marched  # one more than asked for: the response lags one instant
        history, force = self._march.advance(instants)
        motion = self._response(history, force)
        if self._marched == 0:
            motion = motion[1:]
        self._marched += instants
        self._given += n_samples
        samples = self._decimator(motion)
        return samples if self._chain is None else self._chain(samples)


def _require_sampling(duration: float, sample_rate: float, seed: int, oversampling: int, block_length: int) -> None:
    for name, value, unit in (("duration", duration, "s"), ("sample rate", sample_rate, "Hz")):
        if not (math.isfinite(value) and value > 0):
            raise InputError(f"{name} = {value!r} {unit} must be positive and finite")
    for name, whole in (("oversampling", oversampling), ("block length", block_length)):
        if not (isinstance(whole, int) and whole >= 1):
            raise InputError(f"{name} = {whole!r} must be a whole number, 1 or more")
    if not (isinstance(seed, int) and seed >= 0):
        raise InputError(f"seed = {seed!r} must be a whole number, zero or more")


REHEARSAL = 5.0
"""Longest simulation from which the size of the signals (and so of the noise) is judged, s."""

_LEAST_STEPS_PER_TOOTH = 8


class MillingCell(SampledCell):
    """A simulated milling test: a structure is milled with regenerative feedback, sensors record forces and motion.

    ``X = H F`` and ``F = F_p + a Ktc [alpha(t)] (X - X_tau)`` (Mohammadi & Ahmadi, Eqs. 1 and 4) while every tooth
    stays in the cut; beyond it, teeth leave the cut and the surface of several earlier teeth counts, so that chatter
    grows to a finite amplitude. The structure is integrated exactly for forces linear over a step.

    Parameters
    ----------
    structure
        Modal model (receptance) with responses and excitations ``TCP:+X +Y +Z``, and those the sensors need.
    process
        Cutter, immersion, force coefficients, feed, runout.
    depth : m
        Axial depth of cut.
    speed : rad/s
        Spindle speed, or a profile: :class:`LinearSweep`, :class:`DriftingSpeed`.
    duration : s
        Duration of the recording.
    sample_rate : Hz
        Sample rate of the recording.
    material
        ``"homogeneous"``, ``"porous"`` or a :class:`Material`.
    sensors
        Sensors of the cell. Default :func:`milling_sensors`: ``fx fy fz`` at the tip and ``ax ay az`` at the housing, 1
        % noise. The noise is a share of the channel's standard deviation in a rehearsal without noise of at most 5 s,
        in which the speed runs through its whole course.
    seed
        Seed of noise and pores; the same seed gives the same recording, whatever the block length.
    oversampling
        Number of steps of the simulation per sample.
    block_length
        Number of samples per block.

    Raises
    ------
    InputError
        A value that cannot be, a structure without the needed degrees of freedom, or a speed too high for the rate.

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
        refuse_varied(process, "the simulated cell", "give straight edges at equal pitch without process damping")
        self.process = process
        self.depth = float(depth)
        self.profile: SpeedProfile = ConstantSpeed(float(speed)) if isinstance(speed, (int, float)) else speed
        self.material = material_named(material)
        self.duration = float(duration)
        self._require_resolved_teeth()
        self.title = f"simulated milling, {self.material.name}, {self.depth * 1e3:g} mm deep"
        self.setup = setup_text(
            {
                "test": {"kind": "simulated milling", "seed": self.seed, "duration_s": self.duration},
                "cut": {"depth_m": self.depth, "material": self.material.name, **self.profile.description()},
                "cutting": cutting_table(process),
            }
        )

    def _require_resolved_teeth(self) -> None:
        steps = 2 * math.pi / self.process.teeth / (self.profile.fastest * self.step)
        if steps < _LEAST_STEPS_PER_TOOTH:
            raise InputError(
                f"spindle speed {self.profile.fastest * 30 / math.pi:g} rpm gives {steps:.1f} steps per tooth, "
                f"fewer than {_LEAST_STEPS_PER_TOOTH}; raise sample_rate or oversampling"
            )

    def _start(self) -> March:
        return _MillingMarch(self, self.profile)

    def _rehearse(self) -> tuple[March, int]:
        share = min(1.0, REHEARSAL / self.duration)
        profile = self.profile if share == 1.0 else self.profile.rehearsed(share)
        return _MillingMarch(self, profile), max(round(share * self.duration * self.sample_rate), 1)


class _MillingMarch:
    """The compiled loop with its state."""

    def __init__(self, cell: MillingCell, profile: SpeedProfile) -> None:
        pore_seed = np.random.SeedSequence([cell.seed, 0]).generate_state(1, np.uint64)[0]
        self._step = cell.step
        self._profile = profile
        self._dynamics = discretise(cell.structure, cell.step)
        self._cut = prepare_cut(cell.process, cell.depth, cell.material, int(pore_seed))
        self._offsets = tooth_offsets(cell.process)
        longest = 2 * math.pi / cell.process.teeth / (profile.slowest * cell.step)
        self._memory = empty_memory(len(cell.structure.poles), cell.process.teeth, math.ceil(longest))

    def advance(self, n_instants: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Next instants: modal history and force."""
        done = int(self._memory.counters[0])
        times = self._step * np.arange(done, done + n_instants, dtype=float)
        angles = self._profile.angle(times)
        before = self._profile.angle(np.array([max(done - 1, 0) * self._step, max(done, 1) * self._step]))
        history = np.empty((n_instants, len(self._memory.modal)))
        force = np.empty((n_instants, 3))
        first_step = float(before[1] - before[0])
        mill(angles, first_step, self._dynamics, self._cut, self._offsets, self._memory, force, history)
        return history, force


LEAD = 0.05
"""Quiet time before the first tap, s."""


class HammerCell(SampledCell):
    """Half-sine taps at the tool tip, direction by direction, each followed by its ring-down.

    Each tap is ``F(t) = A sin(pi (t - t0) / width)`` for ``0 < t - t0 < width``; A varies by 15 % and t0 by up to a
    sample, as by hand. The force channels carry the tap, the others the response, so that both H_TT (motion at the tip)
    and H_ST (motion at the housing) can be estimated (Mohammadi & Ahmadi, "Calibration of TCP FRF").

    Parameters
    ----------
    structure
        Modal model (receptance) with excitations ``TCP:+X +Y +Z`` and the responses the sensors need.
    directions
        Degrees of freedom to tap, in this order, among ``TCP:+X +Y +Z``.
    taps
        Number of taps in each direction.
    spacing : s
        Time between taps; a segment of this length holds one tap and its ring-down.
    peak : N
        Mean amplitude A of the taps.
    width : s
        Duration of the half sine; 4 ms (a soft tip) excites up to about 250 Hz.
    sample_rate, sensors, seed, oversampling, block_length
        Options of the same names in :class:`MillingCell`; default sensors :func:`hammer_sensors`.

    Raises
    ------
    InputError
        A value that cannot be.

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
                    "first_tap_s": LEAD,
                },
            }
        )

    def _start(self) -> March:
        return _HammerMarch(self)

    def _rehearse(self) -> tuple[March, int]:
        return _HammerMarch(self), self.n_samples


class _HammerMarch:
    """Force of all taps, and the structure's answer."""

    def __init__(self, cell: HammerCell) -> None:
        generator = np.random.default_rng([cell.seed, 0])
        n_taps = len(cell.directions) * cell.taps
        jitter = generator.uniform(0, 1 / cell.sample_rate, n_taps)
        self._times = LEAD + cell.spacing * np.arange(n_taps) + jitter
        self._peaks = cell.peak * np.clip(generator.normal(1, 0.15, n_taps), 0.3, 1.7)
        self._columns = [TIP.index(direction) for direction in cell.directions for _ in range(cell.taps)]
        self._width, self._step = cell.width, cell.step
        self._modes = discretise(cell.structure, cell.step).modes
        self._modal = np.zeros(2 * len(cell.structure.poles))
        self._last_force = np.zeros(3)
        self._done = 0

    def advance(self, n_instants: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Next instants: modal history and force."""
        times = np.arange(self._done, self._done + n_instants) * self._step
        force = np.zeros((n_instants, 3))
        for start, peak, column in zip(self._times, self._peaks, self._columns, strict=True):
            low, high = np.searchsorted(times, [start, start + self._width])
            force[low:high, column] += peak * np.sin(math.pi * (times[low:high] - start) / self._width)
        history = np.empty((n_instants, len(self._modal)))
        respond(force, self._modes, self._last_force, self._modal, history)
        self._done += n_instants
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
    if spacing <= LEAD + width:
        raise InputError(f"taps {spacing:g} s apart leave no time to ring down; take several seconds")
