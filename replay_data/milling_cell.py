"""`MillingCell`: a robot that mills, measured by a simulated laboratory; a source of recordings without hardware."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess, refuse_varied
from cutting.one_tooth import tooth_offsets
from foundation import InputError
from modal_fit import ModalModel

from .laboratory.sensors import Sensor, milling_sensors
from .laboratory.setup_notes import cutting_table, setup_text
from .sampled_cell import March, SampledCell
from .simulation.material import Material, material_named
from .simulation.milling_loop import empty_memory, mill, prepare_cut
from .simulation.modal_integrator import discretise
from .speed_profiles import ConstantSpeed, SpeedProfile

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
