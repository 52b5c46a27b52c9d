"""How the size of a line changes over a recording."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .orders import Revolutions

Real = NDArray[np.float64]

PARTS = 8
"""Parts into which a recording is divided."""
_RISE = np.log(3.0)
_STRAIGHT = 0.97  # correlation of a growing line's logarithm with time; eight sizes of noise have it once in 30000
_SPREAD = 1.5  # lines of resolution of a part on either side of the line that still count


@dataclass(frozen=True)
class Course:
    """Size of a line in eight equal parts of a recording.

    Parameters
    ----------
    sizes : (8,)
        Root mean square, all channels together.
    """

    sizes: Real

    @property
    def growth(self) -> float:
        """Last eighth over first."""
        return float(self.sizes[-1] / max(self.sizes[0], 1e-300))

    @property
    def dies_out(self) -> bool:
        """Whether it falls by 30 % or more over the first half of the recording, and again over the second."""
        first, middle, last = self.sizes[0], self.sizes[3:5].mean(), self.sizes[-1]
        return bool(middle < 0.7 * first and last < 0.7 * middle)

    @property
    def grows(self) -> bool:
        """Whether it rises threefold or more, as straight on a logarithmic scale as noise hardly ever does."""
        logarithm = np.log(np.maximum(self.sizes, 1e-300))
        if logarithm.std() < 1e-9:
            return False
        along = np.arange(PARTS)
        rise = float(np.polyfit(along, logarithm, 1)[0]) * (PARTS - 1)
        return bool(rise > _RISE and np.corrcoef(along, logarithm)[0, 1] > _STRAIGHT)

    @property
    def steadiness(self) -> float:
        """Standard deviation of the power over its mean after the first quarter: 1 for noise, 0 for a limit cycle."""
        power = self.sizes[PARTS // 4 :] ** 2
        return float(power.std() / max(power.mean(), 1e-300))


def course_of(revolutions: Revolutions, order: float) -> Course:
    """Size of the line at an order over the recording."""
    rest = revolutions.residual.reshape(revolutions.samples.shape)
    length = revolutions.count // PARTS
    return Course(np.array([_size(rest[k * length : (k + 1) * length], order) for k in range(PARTS)]))


def _size(part: Real, order: float) -> float:
    flat = part.reshape(-1, part.shape[2])
    window = np.hanning(len(flat) + 2)[1:-1]
    turns = np.arange(len(flat)) / part.shape[1]
    shifts = np.arange(-_SPREAD, _SPREAD + 0.25, 0.5) / len(part)
    waves = np.exp(-2j * np.pi * np.outer(order + shifts, turns)) * window
    return float(np.sqrt(np.sum(np.abs(waves @ flat) ** 2)) / window.sum())
