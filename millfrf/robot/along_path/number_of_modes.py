"""How many modes the limits of a path need: as many as give the limits of many more at some of its postures."""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from millfrf.robot_model import modes_at

from .posture_values import PathCut, Request, values_of

Real = NDArray[np.float64]

SETTLED = 5e-3
"""Relative change of the limits at which more modes change nothing that a cut would show."""

_COUNTS = (8, 11, 15, 20, 27)
"""Numbers of modes that are tried; the last is the reference, a kilohertz on a heavy robot."""

_MOST_TURNS = 15.0
"""Turns of the highest mode in a tooth period up to which the reference goes: the cost grows with the third power."""


@dataclass(frozen=True)
class KeptModes:
    """Modes up to which limits are computed.

    Parameters
    ----------
    highest_frequency : Hz
        Natural frequency up to which modes are kept.
    reference : Hz
        The same of the reference that the limits were compared with.
    change
        Largest relative difference of a limit from the reference's.
    checked
        Number of postures that were compared.
    """

    highest_frequency: float
    reference: float
    change: float
    checked: int


def kept_modes(cut: PathCut, samples: Sequence[Request], pool: Executor | None = None) -> KeptModes:
    """Find the fewest modes whose limits lie within 0.5 % of a reference with many more, at the sampled postures.

    Modes that are not kept are left as their static flexibility, so what is lost is their dynamics alone. The
    reference has all modes that turn at most 15 times in a tooth period. A step that changes nothing proves nothing: a
    mode at 400 Hz can lower a limit that was the same with 8 modes and with 11.
    """
    frequencies = [modes_at(cut.robot, one.q).frequencies for one in samples]
    size = min(len(one) for one in frequencies)
    steps = [_above(frequencies, count) for count in _COUNTS if count < size]
    steps += [np.inf] if size <= _COUNTS[-1] else []
    all_of_them = 1.0001 * max(float(one[-1]) for one in frequencies)
    most = _MOST_TURNS * cut.process.teeth * cut.speed / (2 * np.pi)
    steps = [step for step in steps if min(step, all_of_them) <= most] or steps[:1]
    truth = _limits(replace(cut, highest_frequency=steps[-1]), samples, pool)
    for step in steps[:-1]:
        change = float(np.abs(_limits(replace(cut, highest_frequency=step), samples, pool) / truth - 1).max())
        if change < SETTLED:
            return KeptModes(step, steps[-1], change, len(samples))
    return KeptModes(steps[-1], steps[-1], 0.0, len(samples))


def change_with_more(cut: PathCut, reference: float, samples: Sequence[Request], pool: Executor | None) -> float:
    """Largest relative change of the limits at some postures if modes up to ``reference`` (Hz) are kept."""
    few, many = (_limits(one, samples, pool) for one in (cut, replace(cut, highest_frequency=reference)))
    return float(np.abs(few / many - 1).max())


def _above(frequencies: Sequence[Real], count: int) -> float:
    """Frequency below which ``count`` modes lie at every posture: in the middle of the gap above them, where one is.

    Just above the highest of them it would cut off the same mode at a posture that was not sampled.

    Examples
    --------
    >>> round(_above([np.array([10.0, 100.0, 400.0]), np.array([11.0, 96.0, 420.0])], 2))
    200
    >>> round(_above([np.array([10.0, 100.0, 120.0]), np.array([11.0, 130.0, 150.0])], 2))
    130
    """
    below = max(float(one[count - 1]) for one in frequencies)
    return max(1.0001 * below, float(np.sqrt(below * min(float(one[count]) for one in frequencies))))


def _limits(cut: PathCut, samples: Sequence[Request], pool: Executor | None) -> Real:
    return np.maximum(values_of(cut, samples, pool).known_depth(cut.max_depth), 1e-9)
