"""Candidate locations and directions of a joint, from the residual of a linear fit."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Complex, DegreeOfFreedom, Real

from ..joints.joint_axis import JointAxis, ModalScales, tip_axes
from ..joints.joint_law import JointMotion
from ..joints.joint_reach import modal_scales
from ..models.hypothesis import Hypothesis, predict_lines
from ..models.misfit import response_to_joint
from ..models.modal_lines import receptance_at
from .whitened_residual import Floor, FloorRecord


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


@dataclass(frozen=True)
class JointSighting:
    """Where the residual's force points.

    Parameters
    ----------
    axis
        Direction at the tip; its largest entry is positive.
    gain
        Twice the log likelihood that one force along it explains, its spectrum free, beyond what noise gains.
    share
        Gain as a share of what a force in any direction would explain.
    """

    axis: JointAxis
    gain: float
    share: float


def find_direction(floor: Floor, hypothesis: Hypothesis) -> JointSighting:
    """Most likely direction of a single force of unknown spectrum.

    For each narrow band the residual ``r = G d u + noise`` has the statistic
    ``z = mean |h^H V^-1 r|^2 / (h^H V^-1 h)``, h = G d, one under noise alone; the likelihood gained is
    ``2 n (z - 1 - ln z)`` where z > 1. The start is the first eigenvector of the force that the residual asks for,
    ``sum w Re(F F^H)``, ``F = G^-1 r``.
    """
    columns = tip_axes(hypothesis.model)[1]
    reaches = [record.through @ columns for record in floor.records]
    bands = [axis_bands(record, reach) for record, reach in zip(floor.records, reaches, strict=True)]
    n = columns.shape[1]

    def gain(direction: Real) -> float:
        return sum(gain_along(parts, direction / np.linalg.norm(direction)) for parts in bands)

    tries = np.random.default_rng(0).normal(size=(60 * n, n))
    tries = np.vstack([tries, np.eye(n), *map(_eigenvectors, floor.records, reaches)])
    best = max(tries, key=gain)
    if n > 1:
        answer = scipy.optimize.minimize(lambda d: -gain(d), best / np.linalg.norm(best), method="Nelder-Mead")
        best = answer.x
    direction = best / np.linalg.norm(best)
    direction = direction * np.sign(direction[np.argmax(np.abs(direction))])
    # noise alone gains half a unit a band on average where z > 1
    chance = 0.5 * sum(len(parts.starts) for parts in bands)
    everything = sum(_gain_of_all(parts) for parts in bands) - n * chance
    found = gain(direction) - chance
    return JointSighting(JointAxis(direction), found, found / max(everything, 1e-12))


def _gain_of_all(bands: AxisBands) -> float:
    """Gain of a force that is free in every direction, counted as that many separate forces."""
    inverse = np.linalg.pinv(bands.weight, hermitian=True)
    power = np.real(np.einsum("ki,kij,kj->k", bands.pull.conj(), inverse, bands.pull))
    n = bands.pull.shape[1]
    z = np.maximum(np.add.reduceat(power, bands.starts) / bands.counts / n, 1.0)
    return float(2 * n * np.sum(bands.counts * (z - 1 - np.log(z))))


def _eigenvectors(record: FloorRecord, reached: Complex) -> Real:
    back = np.linalg.pinv(reached)
    force = np.einsum("kqp,kp->kq", back, record.residual)
    spread = back @ np.linalg.inv(record.white)
    weight = 1 / np.maximum(np.sum(np.abs(spread) ** 2, axis=(1, 2)), 1e-300)
    return np.asarray(np.linalg.eigh(np.real((force * weight[:, None]).T @ force.conj()))[1].T)


@dataclass(frozen=True)
class SeenMotion:
    """Best estimate of a joint's motion and force in one recording.

    Parameters
    ----------
    deflection, velocity : (n_samples,), m, m/s
        Most likely motion along the joint's axis.
    force : (n_samples,), N
        Most likely force along the axis given its spectrum.
    """

    deflection: Real
    velocity: Real
    force: Real


def seen_motion(record: FloorRecord, hypothesis: Hypothesis, axis: JointAxis) -> SeenMotion:
    """Motion along a joint's axis: the model's, corrected by the force that the residual asks for.

    The force is the posterior mean ``u = lambda h^H (V + lambda h h^H)^-1 r`` with lambda from the residual's power in
    each band (Wiener's filter), so that noise is not integrated where nothing is seen.
    """
    lines = record.lines
    reach = hypothesis.reach_with(axis)
    path = reach.paths[-1]
    predicted = predict_lines(hypothesis, lines)
    n = len(lines.recording.force)
    frequencies = lines.padded_frequencies
    whole = np.zeros((lines.padded, lines.measured.shape[1]))
    whole[:n] = lines.recording.response - scipy.fft.irfft(predicted.spectrum, n=lines.padded, axis=0)[:n]
    run_in = np.ones(n)
    run_in[: lines.start] = np.linspace(0, 1, lines.start) ** 4
    whole[:n] *= run_in[:, None]
    rest = scipy.fft.rfft(whole, axis=0)
    filtered = _wiener(record, reached_by(record, hypothesis, axis) @ axis.entries)
    inside = (frequencies >= lines.frequencies[0]) & (frequencies <= lines.frequencies[-1])
    gains = np.zeros((len(frequencies), filtered.shape[1]), dtype=complex)
    for p in range(filtered.shape[1]):
        gains[inside, p] = np.interp(frequencies[inside], lines.frequencies, filtered[:, p].real)
        gains[inside, p] += 1j * np.interp(frequencies[inside], lines.frequencies, filtered[:, p].imag)
    force = np.einsum("kp,kp->k", gains, rest)
    compliance = path.along @ receptance_at(reach.model, frequencies)
    felt = reach.forces(lines.force_lines) - reach.forces(predicted.joint)
    displacement = np.einsum("kq,kq->k", compliance, felt) + (compliance @ path.push) * force
    deflection = scipy.fft.irfft(displacement, n=lines.padded)[:n]
    velocity = scipy.fft.irfft(2j * np.pi * frequencies * displacement, n=lines.padded)[:n]
    return SeenMotion(deflection, velocity, -scipy.fft.irfft(force, n=lines.padded)[:n])


def _wiener(record: FloorRecord, reached: Complex) -> Complex:
    """Row ``lambda h^H (V + lambda h h^H)^-1`` at the lines for responses h (n_lines, n_responses) to the force."""
    bands = axis_bands(record, reached[:, :, None])
    power = np.abs(bands.pull[:, 0]) ** 2
    size = np.maximum(np.real(bands.weight[:, 0, 0]), 1e-300)
    z = np.add.reduceat(power / size, bands.starts) / bands.counts
    typical = np.add.reduceat(size, bands.starts) / bands.counts
    excess = np.maximum(z - 1, 0) / typical
    centres = bands.starts + bands.counts / 2
    variance = np.interp(np.arange(len(size)), centres, excess)
    reach = record.white @ reached[:, :, None]
    row = np.einsum("kij,ki->kj", record.white, reach[:, :, 0].conj())
    return np.asarray((variance / (1 + variance * size))[:, None] * row)


class MovingJoint(Protocol):
    """Motion of a joint in one recording, as it was seen or as a hypothesis predicts it."""

    @property
    def deflection(self) -> Real:
        """Deflection of the joint at each instant, m."""

    @property
    def velocity(self) -> Real:
        """Velocity of the joint at each instant, m/s."""


def motion_of(seen: Sequence[MovingJoint], stiffness: float) -> JointMotion:
    """Sizes of a joint's motion over all recordings.

    The reach counts from zero and not from the mean, as play and knees lie where the joint stands.

    Parameters
    ----------
    seen
        The joint's motion in each recording.
    stiffness
        Static stiffness of the structure along the joint's direction, N/m.
    """
    deflections = np.concatenate([one.deflection for one in seen])
    velocities = np.concatenate([one.velocity for one in seen])
    strongest = max(seen, key=lambda one: float(np.std(one.deflection)))
    return JointMotion(
        float(np.std(strongest.deflection)),
        float(np.std(strongest.velocity)),
        2.5 * float(np.abs(deflections).max()),
        2.5 * float(np.abs(velocities).max()),
        stiffness,
    )


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

    found = scipy.optimize.minimize(negative, start, jac=True, method="L-BFGS-B").x
    return np.asarray(found / np.linalg.norm(found))


def _band_means(bands: AxisBands, parts: Real) -> tuple[Real, Real]:
    """Means over each band of pull and weight, every line in units of its weight along ``parts``."""
    size = np.maximum(np.real(np.einsum("i,kij,j->k", parts, bands.weight, parts)), 1e-300)
    outer = np.real(bands.pull[:, :, None] * bands.pull[:, None, :].conj())
    each = (np.add.reduceat(one / size[:, None, None], bands.starts) for one in (outer, np.real(bands.weight)))
    pull, weight = (one / bands.counts[:, None, None] for one in each)
    return pull, weight
