"""Where a joint may sit: at the tip, between points or in the modes, ranked by what a force there would explain."""

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from foundation import DegreeOfFreedom

from ..joints import JointAxis, ModalScales, modal_scales, tip_axes
from ..models import Hypothesis
from .axis_bands import AxisBands, axis_bands, gain_along, reached_by
from .joint_direction import find_direction
from .whitened_residual import Floor

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

STARTS = 3
"""Beginnings from which the parts of the modes are sought."""


@dataclass(frozen=True, eq=False)
class JointPlace:
    """A place at which a joint may act.

    Parameters
    ----------
    name
        The place in words.
    axis
        Axis of a joint there.
    gain
        Twice the log likelihood that one force there explains, its spectrum free, beyond what noise gains and what
        the numbers that were chosen cost.
    """

    name: str
    axis: JointAxis
    gain: float

    def told(self) -> dict[str, Any]:
        """The place as a diagnosis lists it."""
        return {"place": self.name, "evidence": round(self.gain, 1)}


def joint_places(floor: Floor, hypothesis: Hypothesis, margin: float) -> tuple[JointPlace, ...]:
    """Places of a joint, that which is taken first, and then those that cannot be told from it, best first.

    The tip's direction is taken unless another place explains more by the margin; then comes a point or a pair of
    points, and last parts of the modes that are free.

    Parameters
    ----------
    floor
        Residual of the fit so far.
    hypothesis
        Hypothesis of the fit so far.
    margin
        Share of the gain by which a more general place must explain more.
    """
    cost = float(np.log(2 * sum(record.residual.size for record in floor.records)))
    seen = find_direction(floor, hypothesis)
    tip = JointPlace("at the tip", seen.axis, seen.gain - cost * (len(seen.axis.entries) - 1))
    scales = modal_scales(hypothesis.model)
    whole = JointAxis(np.eye(len(scales.seen))[0], scales)
    bands = [axis_bands(record, reached_by(record, hypothesis, whole)) for record in floor.records]
    chance = sum(one.chance for one in bands)

    def place(name: str, parts: Real, numbers: int) -> JointPlace:
        unit = parts / np.linalg.norm(parts)
        return JointPlace(name, JointAxis(unit, scales), _gain(bands, unit) - chance - cost * numbers)

    points = [place(name, parts, 0) for name, parts in _points(hypothesis, scales).items()]
    starts = [one.axis.entries for one in points] + list(np.eye(len(scales.seen)))
    starts.append(_parts(hypothesis.model.right @ tip_axes(hypothesis.model)[0] @ seen.axis.entries, scales))
    free = place("inside", _best_parts(bands, starts), len(scales.seen) - 1)
    ranked = sorted([tip, *points, free], key=lambda one: -one.gain)
    near = [one for one in ranked if one.gain >= ranked[0].gain / (1 + margin)]
    order = [one for one in near if one is tip] + [one for one in near if one in points] + [free]
    # free parts imitate every place: that they explain as much says nothing against one
    return (order[0], *(one for one in near if one not in (order[0], free)))


def _points(hypothesis: Hypothesis, scales: ModalScales) -> dict[str, Real]:
    """Parts of the modes in a joint between a response and ground, and between two responses along one axis."""
    model = hypothesis.model
    points = [DegreeOfFreedom.parse(label) for label in model.responses]
    moves = [point.sign * model.right[:, k] for k, point in enumerate(points)]
    at_tip = set(np.flatnonzero(tip_axes(model)[0].any(axis=1)))
    found = {f"{model.responses[k]} to ground": moves[k] for k in range(len(points)) if k not in at_tip}
    for one, other in combinations(range(len(points)), 2):
        if points[one].axis == points[other].axis:
            between = f"between {points[one].node} and {points[other].node} along {points[one].axis}"
            found[between] = moves[one] - moves[other]
    parts = {name: _parts(motion, scales) for name, motion in found.items()}
    return {name: one for name, one in parts.items() if one.any()}


def _parts(motion: Complex, scales: ModalScales) -> Real:
    """Real part of each mode in a motion (n_modes,) of modal coordinates."""
    return np.asarray(np.real(motion * scales.seen.conj()) / np.maximum(np.abs(scales.seen) ** 2, 1e-300))


def _gain(bands: list[AxisBands], parts: Real) -> float:
    return sum(gain_along(one, parts) for one in bands)


def _best_parts(bands: list[AxisBands], starts: list[Real]) -> Real:
    """Parts of the modes that explain most, from the best starts; the lines of a band are weighed as at the start."""
    units = [start / np.linalg.norm(start) for start in starts]
    best = sorted(units, key=lambda parts: -_gain(bands, parts))[:STARTS]
    for _ in range(2):
        best = [_refined(bands, parts) for parts in best]
    return max([*best, *units], key=lambda parts: _gain(bands, parts))


def _refined(bands: list[AxisBands], start: Real) -> Real:
    """Parts near a start that explain most where the weights of lines within a band stay what they are there."""
    counts = np.concatenate([one.counts for one in bands])
    pulls, weights = (np.concatenate(parts) for parts in zip(*(_band_means(one, start) for one in bands), strict=True))

    def negative(parts: Real) -> tuple[float, Real]:
        power, size = np.einsum("bij,i,j->b", pulls, parts, parts), np.einsum("bij,i,j->b", weights, parts, parts)
        z = np.maximum(power / size, 1.0)
        slope = (1 - 1 / z) * counts / size
        toward = np.einsum("b,bij,j->i", slope, pulls, parts) - np.einsum("b,bij,j->i", slope * z, weights, parts)
        return float(-2 * np.sum(counts * (z - 1 - np.log(z)))), -4 * toward

    found = minimize(negative, start, jac=True, method="L-BFGS-B").x
    return np.asarray(found / np.linalg.norm(found))


def _band_means(bands: AxisBands, parts: Real) -> tuple[Real, Real]:
    """Means over each band of pull and weight, every line in units of its weight along ``parts``."""
    size = np.maximum(np.real(np.einsum("i,kij,j->k", parts, bands.weight, parts)), 1e-300)
    outer = np.real(bands.pull[:, :, None] * bands.pull[:, None, :].conj())
    each = (np.add.reduceat(one / size[:, None, None], bands.starts) for one in (outer, np.real(bands.weight)))
    pull, weight = (one / bands.counts[:, None, None] for one in each)
    return pull, weight
