"""Motion that differs from tooth to tooth: runout, or a period that has doubled."""

import numpy as np
from numpy.typing import NDArray

from .course import PARTS, Course
from .lines import Spectrum
from .orders import Revolutions
from .tool_motion import ToolMotion

Real = NDArray[np.float64]

_STANDS_OUT = 20.0  # power of an order over the noise from which it counts


def alternation(revolutions: Revolutions) -> float:
    """Size of the orders at odd multiples of half the tooth passing over that of all other orders.

    They are those of the mean revolution. With an odd number of teeth the result is NaN, because half the tooth passing
    is no order of the spindle then. An eccentric cutter with four teeth or more has orders one above and
    one below the tooth passing instead.
    """
    if revolutions.teeth % 2:
        return float("nan")
    alternating = _alternating(revolutions)
    rest = np.mean(revolutions.mean_turn**2) - np.mean(alternating**2)
    return float(np.sqrt(np.mean(alternating**2) / max(float(rest), 1e-300)))


def alternation_course(revolutions: Revolutions) -> Course:
    """Size over the recording of what alternates from tooth to tooth; the number of teeth is even."""
    length = revolutions.count // PARTS
    parts = [_alternating(revolutions.part(k * length, (k + 1) * length)) for k in range(PARTS)]
    return Course(np.array([float(np.sqrt(np.mean(part**2))) for part in parts]))


def alternating_change(late: Revolutions, spectrum: Spectrum, motion: ToolMotion) -> float:
    """Root mean square of the chip's change by what alternates from tooth to tooth, over the thickest chip.

    Of orders at odd multiples of half the tooth passing that stand out of the noise; 0 with an odd number of teeth.
    """
    if late.teeth % 2:
        return 0.0
    power = 2 * np.abs(np.fft.rfft(late.mean_turn, axis=0) / late.mean_turn.shape[0]) ** 2
    orders = np.arange(late.teeth // 2, int(spectrum.orders[spectrum.searched][-1]) + 1, late.teeth)
    stands = (power[orders] / spectrum.floor[orders * late.count]).max(axis=1) > _STANDS_OUT
    return motion.change(orders[stands].astype(float), power[orders[stands]])


def _alternating(revolutions: Revolutions) -> Real:
    """Give the part that changes its sign from tooth to tooth, (n_places / teeth, n_channels)."""
    turn = revolutions.mean_turn
    by_tooth = turn.reshape(revolutions.teeth, -1, turn.shape[1])
    signs = np.where(np.arange(revolutions.teeth) % 2, -1.0, 1.0)[:, None, None]
    return np.asarray((by_tooth * signs).mean(axis=0))
