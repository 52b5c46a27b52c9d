"""Motion that differs from tooth to tooth: runout, or a period that has doubled."""

import numpy as np
from numpy.typing import NDArray

from .course import PARTS, Course
from .orders import Revolutions

Real = NDArray[np.float64]


def alternation(revolutions: Revolutions) -> float:
    """Size of the orders at odd multiples of half the tooth passing over that of the tooth passing and its harmonics.

    Of the mean revolution; NaN with an odd number of teeth, where half the tooth passing is no order of the spindle.
    """
    teeth = revolutions.teeth
    if teeth % 2:
        return float("nan")
    alternating, common = _parts(revolutions)
    return float(np.sqrt(np.mean(alternating**2) / max(float(np.mean(common**2)), 1e-300)))


def alternation_course(revolutions: Revolutions) -> Course:
    """Size over the recording of what alternates from tooth to tooth; the number of teeth is even."""
    length = revolutions.count // PARTS
    parts = [_parts(revolutions.part(k * length, (k + 1) * length))[0] for k in range(PARTS)]
    return Course(np.array([float(np.sqrt(np.mean(part**2))) for part in parts]))


def _parts(revolutions: Revolutions) -> tuple[Real, Real]:
    """What changes its sign from tooth to tooth and what is common to all, (n_places / teeth, n_channels)."""
    turn = revolutions.mean_turn
    by_tooth = turn.reshape(revolutions.teeth, -1, turn.shape[1])
    signs = np.where(np.arange(revolutions.teeth) % 2, -1.0, 1.0)[:, None, None]
    return np.asarray((by_tooth * signs).mean(axis=0)), np.asarray(by_tooth.mean(axis=0))
