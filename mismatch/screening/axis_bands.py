"""What a force of unknown spectrum along a joint's axis would explain of a residual, in narrow bands."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..joints import JointAxis, tip_axes
from ..models import Hypothesis, response_to_joint
from .whitened_residual import FloorRecord

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


def reached_by(record: FloorRecord, hypothesis: Hypothesis, axis: JointAxis) -> Complex:
    """Responses at the lines to a unit force along each entry of an axis, (n_lines, n_responses, n_entries)."""
    if axis.scales is None:
        return np.asarray(record.through @ tip_axes(hypothesis.model)[1])
    return response_to_joint(hypothesis, record.lines, axis)


@dataclass(frozen=True)
class AxisBands:
    """Statistics of the lines of one recording, for ``r = G d u + noise`` with a force u along the axis d.

    Parameters
    ----------
    pull : (n_lines, n_entries)
        ``G^H V^-1 r``.
    weight : (n_lines, n_entries, n_entries)
        ``G^H V^-1 G``.
    starts : (n_bands,)
        First line of each band.
    counts : (n_bands,)
        Number of lines of each band.
    """

    pull: Complex
    weight: Complex
    starts: NDArray[np.int64]
    counts: Real

    @property
    def chance(self) -> float:
        """What noise alone gains on average: half a unit in each band, where z > 1."""
        return 0.5 * len(self.starts)


def axis_bands(record: FloorRecord, reached: Complex) -> AxisBands:
    """Statistics for responses (n_lines, n_responses, n_axes) to a unit force along each axis."""
    reach = record.white @ reached
    rest = np.einsum("kij,kj->ki", record.white, record.residual)
    pull = np.einsum("kij,ki->kj", reach.conj(), rest)
    weight = reach.conj().swapaxes(1, 2) @ reach
    edges = np.unique(np.linspace(0, len(rest), min(150, max(4, len(rest) // 12)) + 1).astype(int))
    return AxisBands(pull, weight, edges[:-1], np.diff(edges).astype(float))


def gain_along(bands: AxisBands, direction: Real) -> float:
    """Twice the log likelihood gained by a force along a unit vector (n_entries,), its spectrum free in each band."""
    power = np.abs(bands.pull @ direction) ** 2
    size = np.real(np.einsum("i,kij,j->k", direction, bands.weight, direction))
    z = np.add.reduceat(power / np.maximum(size, 1e-300), bands.starts) / bands.counts
    z = np.maximum(z, 1.0)
    return float(2 * np.sum(bands.counts * (z - 1 - np.log(z))))
