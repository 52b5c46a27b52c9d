"""Likely places and directions of a joint, from the residual of a linear fit."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import BandRecording
from millfrf.core import Complex, DegreeOfFreedom, Real

from ..joints.joint_axis import JointAxis, ModalScales, modal_scales, tip_axes
from ..joints.joint_law import JointMotion
from ..models.first_motion import predict_lines
from ..models.hypothesis import Hypothesis, start_pulse, with_excitation
from ..models.linear_lines import response_to_joint
from ..models.modal_lines import receptance_at
from .whitened_residual import Floor, FloorRecord


def response_to_force(record: FloorRecord, hypothesis: Hypothesis, axis: JointAxis) -> Complex:
    """Return the response lines to a unit force along each entry of an axis, (n_lines, n_responses, n_entries).

    Entries are directions at the tip or participations of modes.
    """
    if axis.scales is None:
        return np.asarray(record.through @ tip_axes(hypothesis.model)[1])
    return response_to_joint(hypothesis, record.lines, axis)


@dataclass(frozen=True)
class AxisBands:
    """Statistics of the residual r of one recording, ``r = G d u + noise``, for a force u along the axis d.

    G is the response to a unit force along each entry of the axis, V the covariance of the noise.
    """

    pull: Complex  # ``G^H V^-1 r``, (n_lines, n_entries)
    weight: Complex  # ``G^H V^-1 G``, (n_lines, n_entries, n_entries)
    starts: NDArray[np.int64]  # first line of each band, (n_bands,)
    counts: Real  # number of lines of each band, (n_bands,)

    @property
    def chance(self) -> float:
        """Mean gain that noise alone gives: half a unit in each band."""
        return 0.5 * len(self.starts)


def axis_bands(record: FloorRecord, reached: Complex) -> AxisBands:
    """Return the statistics of a recording for the responses ``reached`` to a unit force along each entry.

    The shape of ``reached`` is (n_lines, n_responses, n_entries).
    """
    reach = record.white @ reached
    white_residual = np.einsum("kij,kj->ki", record.white, record.residual)
    pull = np.einsum("kij,ki->kj", reach.conj(), white_residual)
    weight = reach.conj().swapaxes(1, 2) @ reach
    edges = np.unique(np.linspace(0, len(white_residual), min(150, max(4, len(white_residual) // 12)) + 1).astype(int))
    return AxisBands(pull, weight, edges[:-1], np.diff(edges).astype(float))


def gain_along(bands: AxisBands, direction: Real) -> float:
    """Return twice the gain in log likelihood of a force along a unit vector (n_entries,) with a free spectrum."""
    power = np.abs(bands.pull @ direction) ** 2
    size = np.real(np.einsum("i,kij,j->k", direction, bands.weight, direction))
    z = np.add.reduceat(power / np.maximum(size, 1e-300), bands.starts) / bands.counts
    z = np.maximum(z, 1.0)
    return float(2 * np.sum(bands.counts * (z - 1 - np.log(z))))


@dataclass(frozen=True)
class JointDirection:
    """Likeliest direction of the force that explains a residual."""

    axis: JointAxis  # direction at the tip; its largest entry is positive
    gain: float
    share: float  # gain, divided by the gain of forces in all directions at once


def find_direction(floor: Floor, hypothesis: Hypothesis) -> JointDirection:
    """Return the most likely direction d of a single force u of unknown spectrum that explains the residual.

    The residual is ``r = G d u + noise``. With h = G d, the statistic of each narrow band of n lines is ``z = mean |h^H
    V^-1 r|^2 / (h^H V^-1 h)``, which is 1 for noise alone. The gain in likelihood is ``2 n (z - 1 - ln z)`` if z > 1.
    The search starts at the first eigenvector of ``sum w Re(F F^H)`` with the force ``F = G^-1 r``.
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
    # the mean gain of noise alone is half a unit in each band
    chance = 0.5 * sum(len(parts.starts) for parts in bands)
    total_gain = sum(_gain_of_all(parts) for parts in bands) - n * chance
    net_gain = gain(direction) - chance
    return JointDirection(JointAxis(direction), net_gain, net_gain / max(total_gain, 1e-12))


def _gain_of_all(bands: AxisBands) -> float:
    """Return the gain of separate forces along all entries of the axis at once."""
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
class EstimatedMotion:
    """Best estimate of the motion and force of a joint in one recording."""

    # most likely deflection (m) and velocity (m/s) along the joint's axis, each (n_samples,)
    deflection: Real
    velocity: Real
    force: Real  # most likely force along the axis, given its power in each band, (n_samples,), N


def estimated_motion(record: FloorRecord, hypothesis: Hypothesis, axis: JointAxis) -> EstimatedMotion:
    """Estimate the motion along the axis of a joint and the joint force from the residual.

    The motion is the motion of the model plus the motion due to the force that explains the residual. The force is the
    posterior mean ``u = lambda h^H (V + lambda h h^H)^-1 r`` with lambda from the power of the residual in each band
    (Wiener filter), so that noise is not integrated in bands where the force has no power.
    """
    lines = record.lines
    reach = hypothesis.reach_with(axis)
    path = reach.paths[-1]
    predicted = predict_lines(hypothesis, lines)
    n = len(lines.recording.force)
    frequencies = lines.padded_frequencies
    residual = np.zeros((lines.padded, lines.measured.shape[1]))
    residual[:n] = lines.recording.response - scipy.fft.irfft(predicted.spectrum, n=lines.padded, axis=0)[:n]
    run_in = np.ones(n)
    run_in[: lines.start] = np.linspace(0, 1, lines.start) ** 4
    residual[:n] *= run_in[:, None]
    residual_spectrum = scipy.fft.rfft(residual, axis=0)
    filtered = _wiener(record, response_to_force(record, hypothesis, axis) @ axis.entries)
    in_band = (frequencies >= lines.frequencies[0]) & (frequencies <= lines.frequencies[-1])
    gains = np.zeros((len(frequencies), filtered.shape[1]), dtype=complex)
    for p in range(filtered.shape[1]):
        gains[in_band, p] = np.interp(frequencies[in_band], lines.frequencies, filtered[:, p].real)
        gains[in_band, p] += 1j * np.interp(frequencies[in_band], lines.frequencies, filtered[:, p].imag)
    force = np.einsum("kp,kp->k", gains, residual_spectrum)
    model, force_lines = reach.model, reach.forces(lines.force_lines) - reach.forces(predicted.joint)
    if predicted.first is not None:
        model = with_excitation(model, predicted.first)
        force_lines = np.column_stack([force_lines, start_pulse(lines)])
    compliance = path.along @ receptance_at(model, frequencies)
    displacement = np.einsum("kq,kq->k", compliance, force_lines)
    displacement += (compliance[:, : len(path.push)] @ path.push) * force
    deflection = scipy.fft.irfft(displacement, n=lines.padded)[:n]
    velocity = scipy.fft.irfft(2j * np.pi * frequencies * displacement, n=lines.padded)[:n]
    return EstimatedMotion(deflection, velocity, -scipy.fft.irfft(force, n=lines.padded)[:n])


def force_variance(record: FloorRecord, hypothesis: Hypothesis, axis: JointAxis) -> Real:
    """Return the variance of a joint's force at each line, from the power of the residual in bands, (n_lines,), N^2."""
    reached = response_to_force(record, hypothesis, axis) @ axis.entries
    return _variance(axis_bands(record, reached[:, :, None]))


def _variance(bands: AxisBands) -> Real:
    power = np.abs(bands.pull[:, 0]) ** 2
    size = np.maximum(np.real(bands.weight[:, 0, 0]), 1e-300)
    z = np.add.reduceat(power / size, bands.starts) / bands.counts
    typical = np.add.reduceat(size, bands.starts) / bands.counts
    excess = np.maximum(z - 1, 0) / typical
    return np.asarray(np.interp(np.arange(len(size)), bands.starts + bands.counts / 2, excess))


def _wiener(record: FloorRecord, reached: Complex) -> Complex:
    """Return the filter ``lambda h^H (V + lambda h h^H)^-1`` from residual to force, (n_lines, n_responses).

    ``reached`` is the response h to a unit force, (n_lines, n_responses).
    """
    bands = axis_bands(record, reached[:, :, None])
    size, variance = np.maximum(np.real(bands.weight[:, 0, 0]), 1e-300), _variance(bands)
    reach = record.white @ reached[:, :, None]
    row = np.einsum("kij,ki->kj", record.white, reach[:, :, 0].conj())
    return np.asarray((variance / (1 + variance * size))[:, None] * row)


class JointTrajectory(Protocol):
    """Motion of a joint in one recording, estimated or predicted."""

    @property
    def deflection(self) -> Real:
        """Deflection of the joint at each instant, m."""

    @property
    def velocity(self) -> Real:
        """Velocity of the joint at each instant, m/s."""


def motion_of(
    trajectories: Sequence[JointTrajectory], stiffness: float, recordings: Iterable[BandRecording]
) -> JointMotion:
    """Return the size of the motion of a joint over all recordings.

    The largest deflection is measured from zero, not from the mean, as play and knees are centred at the rest position.

    ``stiffness``: static stiffness of the structure along the joint's direction, N/m.
    """
    recordings, deflections = list(recordings), np.concatenate([state.deflection for state in trajectories])
    lengths = [recording.duration for recording in recordings]
    velocities = np.concatenate([state.velocity for state in trajectories])
    strongest = max(trajectories, key=lambda state: float(np.std(state.deflection)))
    return JointMotion(
        float(np.std(strongest.deflection)),
        float(np.std(strongest.velocity)),
        2.5 * float(np.abs(deflections).max()),
        2.5 * float(np.abs(velocities).max()),
        stiffness,
        swept_range(recordings),
        (min(lengths), max(lengths)),
    )


def swept_range(recordings: Iterable[BandRecording]) -> tuple[float, float] | None:
    """Return the least and the largest frequency of the forces' line that sweeps, Hz; None unless all have one."""
    lines = [recording.swept_line for recording in recordings]
    known = [line for line in lines if line is not None]
    return (min(map(min, known)), max(map(max, known))) if len(known) == len(lines) else None


def static_stiffness(hypothesis: Hypothesis, axis: JointAxis) -> float:
    """Return the static stiffness of the structure along the axis of a joint, N/m."""
    reach = hypothesis.reach_with(axis)
    static = reach.model.receptance(np.array([hypothesis.model.natural_frequencies.min() / 20]))[0]
    return float(1 / abs(reach.paths[-1].along @ static @ reach.paths[-1].push))


STARTS = 3  # starts of the search for participations


@dataclass(frozen=True, eq=False)
class JointPlace:
    """Possible place of a joint."""

    name: str  # description of the place
    axis: JointAxis
    # twice the gain in log likelihood of one force with a free spectrum, minus the mean gain of noise and the cost of
    # the numbers of the place
    gain: float

    def content(self) -> dict[str, Any]:
        """Return the entry of the place in a diagnosis."""
        return {"place": self.name, "evidence": round(self.gain, 1)}


def joint_places(floor: Floor, hypothesis: Hypothesis, margin: float) -> tuple[JointPlace, ...]:
    """Return the likeliest place of a joint, followed by the places that are equally likely, best first.

    The direction at the tip is preferred unless the gain of a different place is larger by more than ``margin``. A
    point or a pair of points is preferred next, and free participations of the modes last.
    """
    cost = float(np.log(2 * sum(record.residual.size for record in floor.records)))
    direction = find_direction(floor, hypothesis)
    tip = JointPlace("at the tip", direction.axis, direction.gain - cost * (len(direction.axis.entries) - 1))
    scales = modal_scales(hypothesis.model)
    all_modes = JointAxis(np.eye(len(scales.seen))[0], scales)
    bands = [axis_bands(record, response_to_force(record, hypothesis, all_modes)) for record in floor.records]
    chance = sum(band.chance for band in bands)

    def place(name: str, parts: Real, numbers: int) -> JointPlace:
        unit = parts / np.linalg.norm(parts)
        return JointPlace(name, JointAxis(unit, scales), _gain(bands, unit) - chance - cost * numbers)

    points = [place(name, parts, 0) for name, parts in _points(hypothesis, scales).items()]
    starts = [place.axis.entries for place in points] + list(np.eye(len(scales.seen)))
    starts.append(
        _participations(hypothesis.model.right @ tip_axes(hypothesis.model)[0] @ direction.axis.entries, scales)
    )
    free = place("inside", _best_participations(bands, starts), len(scales.seen) - 1)
    ranked = sorted([tip, *points, free], key=lambda place: -place.gain)
    likely = [candidate for candidate in ranked if candidate.gain >= ranked[0].gain / (1 + margin)]
    order = (
        [candidate for candidate in likely if candidate is tip]
        + [candidate for candidate in likely if candidate in points]
        + [free]
    )
    # free participations can imitate every place, and are therefore not listed as an alternative place
    return (order[0], *(candidate for candidate in likely if candidate not in (order[0], free)))


def _points(hypothesis: Hypothesis, scales: ModalScales) -> dict[str, Real]:
    """Return the participations for each joint between a response and ground, and between two responses along one axis.

    The keys are descriptions of the places.
    """
    model = hypothesis.model
    points = [DegreeOfFreedom.parse(label) for label in model.responses]
    moves = [point.sign * model.right[:, k] for k, point in enumerate(points)]
    at_tip = set(np.flatnonzero(tip_axes(model)[0].any(axis=1)))
    motions = {f"{model.responses[k]} to ground": moves[k] for k in range(len(points)) if k not in at_tip}
    for first, second in combinations(range(len(points)), 2):
        if points[first].axis == points[second].axis:
            between = f"between {points[first].node} and {points[second].node} along {points[first].axis}"
            motions[between] = moves[first] - moves[second]
    parts = {name: _participations(motion, scales) for name, motion in motions.items()}
    return {name: part for name, part in parts.items() if part.any()}


def _participations(motion: Complex, scales: ModalScales) -> Real:
    """Return the real participation of each mode for a deflection (n_modes,) per unit of the modal coordinates."""
    return np.asarray(np.real(motion * scales.seen.conj()) / np.maximum(np.abs(scales.seen) ** 2, 1e-300))


def _gain(bands: list[AxisBands], parts: Real) -> float:
    return sum(gain_along(band, parts) for band in bands)


def _best_participations(bands: list[AxisBands], starts: list[Real]) -> Real:
    """Return the participations with the largest gain, among all ``starts`` and refinements of the best starts."""
    units = [start / np.linalg.norm(start) for start in starts]
    best = sorted(units, key=lambda parts: -_gain(bands, parts))[:STARTS]
    for _ in range(2):
        best = [_refined(bands, parts) for parts in best]
    return max([*best, *units], key=lambda parts: _gain(bands, parts))


def _refined(bands: list[AxisBands], start: Real) -> Real:
    """Return better participations near a start; the weights of the lines in each band are kept as at the start."""
    counts = np.concatenate([band.counts for band in bands])
    pulls, weights = (
        np.concatenate(parts) for parts in zip(*(_band_means(band, start) for band in bands), strict=True)
    )

    def negative(parts: Real) -> tuple[float, Real]:
        power, size = np.einsum("bij,i,j->b", pulls, parts, parts), np.einsum("bij,i,j->b", weights, parts, parts)
        z = np.maximum(power / size, 1.0)
        slope = (1 - 1 / z) * counts / size
        toward = np.einsum("b,bij,j->i", slope, pulls, parts) - np.einsum("b,bij,j->i", slope * z, weights, parts)
        return float(-2 * np.sum(counts * (z - 1 - np.log(z)))), -4 * toward

    direction = scipy.optimize.minimize(negative, start, jac=True, method="L-BFGS-B").x
    return np.asarray(direction / np.linalg.norm(direction))


def _band_means(bands: AxisBands, parts: Real) -> tuple[Real, Real]:
    """Return the means over each band of ``Re(pull pull^H)`` and of ``Re(weight)``.

    Both are divided at each line by the weight along ``parts``. Each has the shape (n_bands, n_entries, n_entries).
    """
    size = np.maximum(np.real(np.einsum("i,kij,j->k", parts, bands.weight, parts)), 1e-300)
    outer = np.real(bands.pull[:, :, None] * bands.pull[:, None, :].conj())
    each = (np.add.reduceat(sums / size[:, None, None], bands.starts) for sums in (outer, np.real(bands.weight)))
    pull, weight = (means / bands.counts[:, None, None] for means in each)
    return pull, weight
