"""Does a cut settle? The milling loop run at one depth and speed until the motion repeats itself tooth by tooth."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess, refuse_varied
from foundation import TIP, InputError
from modal_fit import ModalModel

from .material import material_named
from .milling_loop import Memory, empty_memory, mill, prepare_cut
from .modal_integrator import Dynamics, discretise

Real = NDArray[np.float64]

SETTLED = 1e-3
"""Share of the largest deviation to which it must have fallen."""

STEPS = (128, 24.0)
"""Least steps a tooth, and least steps a period of the highest mode."""

LONGEST = (4000, 4_000_000)
"""Most turns, and most steps, before the question is left open."""


@dataclass(frozen=True)
class Settling:
    """The course of a deviation from a motion that repeats with every tooth.

    Parameters
    ----------
    verdict
        ``decays``, ``grows``, or ``open`` where neither was clear after the longest run.
    turns
        Revolutions of the spindle that were simulated.
    share
        The last tooth's deviation over the largest of the first teeth's.
    """

    verdict: str
    turns: float
    share: float


def settle(structure: ModalModel, process: MillingProcess, depth: float, spindle_speed: float) -> Settling:
    """Start the cut from rest and watch ``max |x(t) - x(t - tau)|`` over each tooth period tau.

    Runout is left out (with it teeth differ for ever). Entering the cut is the disturbance. A stable cut forgets it. A
    cut that doubles its period or turns (Hopf) does not, whether it grows on or teeth that leave the cut hold it.

    Parameters
    ----------
    structure
        Receptance with responses and excitations ``TCP:+X +Y +Z``; of residuals, a flexibility alone.
    process
        Cutter, engagement, feed.
    depth, spindle_speed
        m and rad/s.

    Raises
    ------
    InputError
        A structure or a process that the simulated cell does not take, or no feed per tooth.
    """
    refuse_varied(process, "the simulated cut", "give straight edges at equal pitch without process damping")
    if not process.feed_per_tooth > 0:
        raise InputError("a simulated cut needs a feed; give feed_per_tooth_m in the cutting file")
    passing = 2 * math.pi / (process.teeth * spindle_speed)
    highest = float(np.abs(structure.poles).max()) / (2 * math.pi)
    steps = max(STEPS[0], math.ceil(STEPS[1] * highest * passing))
    dynamics = discretise(replace(structure, residuals=None), passing / steps)
    if structure.residuals is not None:
        dynamics = dynamics._replace(immediate=dynamics.immediate + structure.residuals.upper)
    memory = empty_memory(len(structure.poles), process.teeth, steps)
    tip = [structure.responses.index(label) for label in TIP]
    output = 2 * np.stack([structure.right.real, -structure.right.imag], axis=1)[:, :, tip].reshape(-1, len(tip))
    run = _Run(process, depth, steps, dynamics, memory, output)
    return _watched(run, process.teeth, min(LONGEST[0] * process.teeth, LONGEST[1] // steps))


class _Run:
    """The loop, tooth by tooth."""

    def __init__(
        self, process: MillingProcess, depth: float, steps: int, dynamics: Dynamics, memory: Memory, output: Real
    ) -> None:
        self._cut = prepare_cut(process, depth, material_named("homogeneous"), 0)
        self._pitch, self._steps = 2 * math.pi / process.teeth, steps
        self._dynamics, self._memory, self._output = dynamics, memory, output
        self._before = np.zeros((steps, 3))

    def deviations(self, teeth: int) -> Real:
        """Largest deviation from the tooth before, of the next ``teeth`` tooth periods, m."""
        count, done = teeth * self._steps, int(self._memory.counters[0])
        step = self._pitch / self._steps
        angles = step * np.arange(done, done + count, dtype=float)
        history, force = np.empty((count, len(self._memory.modal))), np.empty((count, 3))
        offsets = np.zeros(round(2 * math.pi / self._pitch))
        mill(angles, step, self._dynamics, self._cut, offsets, self._memory, force, history)
        motion = np.concatenate([self._before, history @ self._output])
        self._before = motion[-self._steps :]
        away = np.linalg.norm(motion[self._steps :] - motion[: -self._steps], axis=1)
        return np.asarray(away.reshape(teeth, self._steps).max(axis=1))


def _watched(run: _Run, teeth: int, longest: int) -> Settling:
    """Go on until the deviation has fallen enough, has outgrown the first by far, or no longer falls."""
    block = 10 * teeth
    seen = run.deviations(block)
    first = float(seen.max())
    while len(seen) < longest:
        seen = np.concatenate([seen, run.deviations(block)])
        share = float(seen[-block:].max()) / first
        if share < SETTLED:
            return Settling("decays", len(seen) / teeth, share)
        if len(seen) >= 40 * block and _no_longer_falls(seen):
            return Settling("grows", len(seen) / teeth, share)
    return Settling("open", len(seen) / teeth, float(seen[-block:].max()) / first)


def _no_longer_falls(seen: Real) -> bool:
    """Whether the last quarter's peak is not below that of the quarter before."""
    quarter = len(seen) // 4
    return bool(seen[-quarter:].max() >= seen[-2 * quarter : -quarter].max())
