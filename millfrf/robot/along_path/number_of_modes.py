"""How many modes the limits of a path need: as many as settle them at a few of its postures."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robot_model import modes_at

from .posture_values import PathCut, Request, values_of

SETTLED = 5e-3
"""Relative change of the limits at which more modes change nothing that a cut would show."""

_COUNTS = (6, 8, 11, 15, 20, 27, 36, 48)


@dataclass(frozen=True)
class KeptModes:
    """Modes up to ``highest_frequency`` (Hz); ``change``: by how much the next step of modes moves limits, a share."""

    highest_frequency: float
    change: float
    checked: int


def kept_modes(cut: PathCut, samples: Sequence[Request]) -> KeptModes:
    """Raise the number of modes until the limits at the sampled postures change by less than 0.5 %.

    Higher modes are left as their static flexibility, so what changes is their dynamics alone. A tooth period holds
    many turns of a mode at kilohertz, which costs a thousand times more than the low modes that robots chatter with.
    """
    frequencies = [modes_at(cut.robot, one.q).frequencies for one in samples]
    size = min(len(one) for one in frequencies)
    steps = [count for count in _COUNTS if count < size]
    cuts = [1.0001 * max(float(one[count - 1]) for one in frequencies) for count in steps] + [np.inf]
    before = _limits(replace(cut, highest_frequency=cuts[0]), samples)
    change = 0.0
    for i in range(1, len(cuts)):
        if i == len(cuts) - 1 and change < 0.02:
            return KeptModes(cuts[i - 1], change, len(samples))
        after = _limits(replace(cut, highest_frequency=cuts[i]), samples)
        change = float(np.abs(after / before - 1).max())
        if change < SETTLED:
            return KeptModes(cuts[i - 1], change, len(samples))
        before = after
    return KeptModes(cuts[-1], 0.0, len(samples))


def _limits(cut: PathCut, samples: Sequence[Request]) -> np.ndarray:
    return np.maximum(values_of(cut, samples).known_depth(cut.max_depth), 1e-9)
