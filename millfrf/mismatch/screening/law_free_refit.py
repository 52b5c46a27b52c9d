"""Refit of modes and of a joint's place to recordings, with a joint force of free spectrum and no assumed law."""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
import scipy

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real

from ..inference.numerics import Limits, descend, plain_step
from ..joints.joint_axis import JointAxis, modal_scales, tip_axes
from ..models.first_motion import predict_lines
from ..models.fitting import Fit
from ..models.hypothesis import Hypothesis
from ..models.linear_lines import linear_lines
from ..models.misfit import fitted_noise, levels, through_structure
from ..models.modal_lines import line_products
from ..records.noise_model import NoiseModel, quiet_noise, whitening
from .whitened_residual import FORCE_SHARE

ROUGH_LINES, REFIT_LINES = 200, 600  # lines of each recording with which starts are compared, and the refit is made

ROUGH, REFIT = Limits(10, 10.0), Limits(25, 3.0)  # steps of both

MOST_STARTS = 16  # most patterns of signs of the participations from which refits start

MOST_PURSUED = 3

NEARLY = 2.0  # a start is pursued if its cost is at most this times that of the best start

LEAST_LEFT = 0.05  # least share of a response's noise that the projection is taken to leave


@dataclass(frozen=True)
class LawFreeFit:
    """Modes, and participations of a joint, that leave least of the recordings if the joint's force is free.

    Parameters
    ----------
    hypothesis
        Refitted modes, with the linear causes of the start.
    axis
        Participation of each mode in the joint, (n_modes,).
    noises
        Noise of each recording, inferred from what no force of the joint can explain.
    matrix : (size + n_modes - 1, size + n_modes - 1)
        Normal matrix of the numbers of the modes, with their prior, and of the angles of the axis.
    rest
        Power that no force of this joint can explain, in units of the noise of the quietest bands; about 1 if
        there is no other cause.
    moved
        ``|u|^2`` of the modes in laboratory errors.
    """

    hypothesis: Hypothesis
    axis: JointAxis
    noises: tuple[NoiseModel, ...]
    matrix: Real
    rest: float
    moved: float

    @cached_property
    def covariance(self) -> Real:
        """Covariance of the participations, (n_modes, n_modes); wider by a rest above 1."""
        size, slopes = self.hypothesis.shape.size, self.axis.angle_slopes
        angles = np.linalg.pinv(self.matrix, hermitian=True)[size:, size:]
        return np.asarray(max(1.0, self.rest) * slopes @ angles @ slopes.T)

    @cached_property
    def tip_deflection(self) -> Real:
        """Deflection at the tip for a unit of the joint's, along the axes of forces and responses, (n_axes,)."""
        motion = np.linalg.pinv(self._tip_participations) @ self.axis.entries
        return np.asarray(motion / max(float(motion @ motion), 1e-300))

    @cached_property
    def _tip_participations(self) -> Real:
        """Participations of the modes for a unit deflection of the tip along each axis, (n_modes, n_axes)."""
        assert self.axis.scales is not None
        model = self.hypothesis.model
        return np.asarray(np.real(model.right @ tip_axes(model)[0] / self.axis.scales.seen[:, None]))

    def direction(self) -> tuple[Real, Real, float]:
        """Return the direction at the tip nearest to the participations, its errors, and what it leaves of them.

        The first two are (n_axes,), along the axes that forces and responses share; the largest entry is positive. The
        last is the root of the sum of squares of the participations that no direction at the tip has, of which the sum
        is 1. It counts as an error of the participations, so that the direction of a joint away from the tip is unsure.
        """
        motion, inverse = self.tip_deflection, np.linalg.pinv(self._tip_participations)
        size = float(np.linalg.norm(motion))
        along = motion / size * np.sign(motion[np.argmax(np.abs(motion))])
        left = float(np.linalg.norm(self.axis.entries - self._tip_participations @ motion / size**2))
        surplus = max(1, len(self.axis.entries) - len(along))
        covariance = self.covariance + left**2 / surplus * np.eye(len(self.axis.entries))
        tangent = (np.eye(len(along)) - np.outer(along, along)) @ inverse * size
        return along, np.sqrt(np.maximum(np.diag(tangent @ covariance @ tangent.T), 0.0)), left


def law_free_refit(lines: list[WindowedSpectrum], start: Fit) -> LawFreeFit | None:
    """Refit the modes and the place of one joint, whatever its law; None if a single response leaves nothing to fit.

    With the response h to a unit force of the joint, whitened, the projection ``P = I - h h^H / |h|^2`` of every line
    removes any force of the joint. ``|P (Y - H F)|^2 + |u|^2`` is minimised over the numbers u of the modes and the
    joint's participations, from the nominal modes and from each pattern of signs of the participations (variable
    projection; Golub & Pereyra, Inverse Problems 19, 2003). Spectra are those of a rectangular window, in which the
    motion at both ends of a recording is a sum of modes (Pintelon & Schoukens, System Identification, 2nd ed., section
    6.3), which is removed as well. An ordinary refit bends the modes until they describe a part of the force.
    """
    shape = start.hypothesis.shape
    if lines[0].measured.shape[1] < 2:
        return None
    whole = [rectangular(recording) for recording in lines]
    residuals = [each.measured - predict_lines(start.hypothesis, each).response for each in lines]
    noises = tuple(
        _quiet(noise, residual, each) for noise, residual, each in zip(start.noises, residuals, whole, strict=True)
    )
    rough, problem = (
        _Problem([recording.thinned(count) for recording in whole], start.hypothesis, noises)
        for count in (ROUGH_LINES, REFIT_LINES)
    )
    nominal, scales = replace(start.hypothesis, u=np.zeros(start.hypothesis.shape.size)), modal_scales(shape.nominal)
    axes = [JointAxis(entries, scales) for entries in _sign_patterns(len(scales.seen))]
    states = sorted((descend(rough, rough.state(nominal, axis), ROUGH).state for axis in axes), key=rough.cost)
    near = [state for state in _distinct(states) if rough.cost(state) <= NEARLY * rough.cost(states[0])]
    ends = [descend(problem, problem.state(each.hypothesis, each.axis), REFIT).state for each in near[:MOST_PURSUED]]
    state = min(ends, key=problem.cost)
    problem = _Problem(problem.lines, state.hypothesis, problem.noises_of(state))
    end = descend(problem, problem.state(state.hypothesis, state.axis), REFIT)
    state = end.state
    moved = float(shape.prior_precision @ state.hypothesis.u**2)
    return LawFreeFit(state.hypothesis, state.axis, problem.noises, end.matrix, _rest(state.parts), moved)


def rectangular(lines: WindowedSpectrum) -> WindowedSpectrum:
    """Return the lines of a recording without taper, from the end of the forces' ramp to where they fade out."""
    n, rate = len(lines.recording.force), lines.recording.rate
    ramp = min(int(rate), n // 20)
    begin = lines.start if lines.recording.at_rest else max(lines.start, ramp)
    length = scipy.fft.prev_fast_len(n - ramp - begin, real=True)
    axis = np.arange(length // 2 + 1) * rate / length
    nearest = np.searchsorted(0.5 * (lines.frequencies[1:] + lines.frequencies[:-1]), axis)
    # gaps between compared lines, as of a tone that was removed, stay gaps
    band = np.flatnonzero(np.abs(axis - lines.frequencies[nearest]) <= 0.75 * rate / len(lines.window))
    part = replace(
        lines,
        start=begin,
        window=np.full(length, 1 / np.sqrt(length)),
        band=band,
        frequencies=axis[band],
        trust=lines.trust[nearest[band]],
        noise=None,
    )
    force = part.signal(part.force_lines)
    return replace(part, force_here=part.cut(force), measured=part.cut(part.recording.response))


def _sign_patterns(count: int) -> list[Real]:
    """Return unit vectors with all patterns of signs, or a fixed selection of many; the common sign has no effect."""
    if 2 ** (count - 1) <= MOST_STARTS:
        signs = np.array([[1.0, *others] for others in product((1.0, -1.0), repeat=count - 1)])
    else:
        signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(MOST_STARTS, count))
    return list(signs / np.sqrt(count))


def _distinct(states: list["_State"]) -> list["_State"]:
    """Return the states, best first, without those that reached the participations of a better one."""
    kept: list[_State] = []
    for state in states:
        if all(abs(float(state.axis.entries @ other.axis.entries)) < 0.99 for other in kept):
            kept.append(state)
    return kept


@dataclass(frozen=True)
class RefitPart:
    """One recording at one state: whitened quantities of its lines."""

    reach: Complex  # response to a unit of each participation, (n_lines, n_responses, n_modes)
    along: Complex  # unit vector of the response to the joint's force, (n_lines, n_responses)
    force: Complex  # force of the joint that fits best, (n_lines,), N
    error: Complex  # residual without a force of the joint, (n_lines, n_responses)
    transients: Complex  # responses to the motion at both ends, (n_lines, n_responses, n_transients)
    residual: Real  # residual without force and transients, real above imaginary, (2 * n_lines * n_responses,)
    ends: Real  # orthonormal columns of the transients, (2 * n_lines * n_responses, n_transients)
    total: Complex  # forces on the excitations, with that of the joint, (n_lines, n_excitations), N
    shown: Complex  # whitened matrix from displacements to responses, (n_lines, n_responses, n_responses)

    def projected(self, columns: Complex) -> Real:
        """Return columns (n_lines, n_responses, n_columns) without the joint's force and transients, as real ones."""
        return without(self.ends, stacked(off(self.along, columns)))


@dataclass(frozen=True)
class _State:
    """Modes and axis, and every recording there."""

    hypothesis: Hypothesis
    axis: JointAxis
    parts: tuple[RefitPart, ...]


@dataclass(frozen=True)
class _Problem:
    """Least squares of the projected residual, with the covariance of the noise fixed."""

    lines: list[WindowedSpectrum]
    reference: Hypothesis
    noises: tuple[NoiseModel, ...]

    @cached_property
    def whites(self) -> list[Complex]:
        """Whitening of each recording's lines."""
        return [
            whitening(fitted_noise(recording, through_structure(self.reference, recording), noise))
            for recording, noise in zip(self.lines, self.noises, strict=True)
        ]

    def state(self, hypothesis: Hypothesis, axis: JointAxis) -> _State:
        parts = (
            refit_part(hypothesis, axis, recording, white)
            for recording, white in zip(self.lines, self.whites, strict=True)
        )
        return _State(hypothesis, axis, tuple(parts))

    def cost(self, state: _State) -> float:
        prior = float(state.hypothesis.shape.prior_precision @ state.hypothesis.u**2)
        cost = 2 * sum(float(part.residual @ part.residual) for part in state.parts) + prior
        return cost if np.isfinite(cost) else np.inf

    def normal_equations(self, state: _State) -> tuple[Real, Real]:
        shape, slopes = state.hypothesis.shape, state.axis.angle_slopes
        size = shape.size + slopes.shape[1]
        matrix, gradient = np.diag(np.append(shape.prior_precision, np.full(slopes.shape[1], 1e-6))), np.zeros(size)
        gradient[: shape.size] = -shape.prior_precision * state.hypothesis.u
        model = state.hypothesis.reach_with(state.axis).model
        for recording, part in zip(self.lines, state.parts, strict=True):
            out = np.empty((2, *part.along.shape, size))
            shape.write_slopes(model, recording.frequencies, part.total, part.shown, out)
            turned = (part.reach @ slopes) * part.force[:, None, None]
            out[0, ..., shape.size :], out[1, ..., shape.size :] = turned.real, turned.imag
            columns = part.projected(out[0] + 1j * out[1])
            matrix += 2 * columns.T @ columns
            gradient += 2 * columns.T @ part.residual
        return matrix, gradient

    def step(self, state: _State, matrix: Real, gradient: Real) -> Real:
        del state
        return plain_step(matrix, gradient)

    def moved(self, state: _State, step: Real) -> _State:
        size = state.hypothesis.shape.size
        hypothesis = replace(state.hypothesis, u=state.hypothesis.u + step[:size])
        return self.state(hypothesis, state.axis.rotated(step[size:]))

    def settled(self, state: _State) -> _State:
        return state

    def noises_of(self, state: _State) -> tuple[NoiseModel, ...]:
        """Infer the noise of each recording from what no force of the joint explains."""
        return tuple(
            _noise(recording, white, part, noise)
            for recording, white, part, noise in zip(self.lines, self.whites, state.parts, self.noises, strict=True)
        )


def refit_part(hypothesis: Hypothesis, axis: JointAxis, lines: WindowedSpectrum, white: Complex) -> RefitPart:
    linear, reach = linear_lines(hypothesis, lines, axis), hypothesis.reach_with(axis)
    forces = reach.forces(linear.around.pushed(lines.force_here))
    seen = line_products(white, linear.shown)
    error = line_products(white, lines.measured) - line_products(seen, line_products(linear.closed, forces))
    columns = line_products(seen, linear.closed @ reach.paths[-1].columns)
    response = columns @ axis.entries
    size = np.maximum(np.linalg.norm(response, axis=1), 1e-300)
    along = response / size[:, None]
    force = np.einsum("kp,kp->k", along.conj(), error) / size
    transients = _transients(hypothesis, lines, seen, white)
    ends = orthonormal(stacked(off(along, transients)))
    residual = without(ends, stacked(off(along, error[:, :, None]))[:, 0])
    total = forces + force[:, None] * reach.paths[-1].push
    if linear.around.feedback is not None:
        moved = line_products(linear.closed, total)
        total = total - reach.forces(line_products(linear.around.feedback, moved))
        seen = linear.returned(seen)
    return RefitPart(columns, along, force, error, transients, residual, ends, np.ascontiguousarray(total), seen)


def _transients(hypothesis: Hypothesis, lines: WindowedSpectrum, seen: Complex, white: Complex) -> Complex:
    """Return whitened responses to the motion at both ends: modes, and smooth terms of what lies outside the band."""
    model, s = hypothesis.model, 2j * np.pi * lines.frequencies
    own = model.right[None] / (s[:, None, None] - model.poles[:, None])
    other = model.right.conj()[None] / (s[:, None, None] - model.poles.conj()[:, None])
    modes = np.concatenate([own + other, 1j * (own - other)], axis=1).swapaxes(1, 2)
    slope = (lines.frequencies / lines.frequencies[-1])[:, None]
    n = lines.measured.shape[1]
    smooth = [factor * np.eye(n) * level[:, None] for level in (np.ones_like(slope), slope) for factor in (1, 1j)]
    scale = np.linalg.norm(np.linalg.norm(modes, axis=0), axis=0)
    return np.concatenate([line_products(seen, modes / scale), line_products(white, np.concatenate(smooth, axis=2))], 2)


def off(along: Complex, columns: Complex) -> Complex:
    """Remove from columns (n_lines, n_responses, n_columns) their parts along a unit vector of each line."""
    shares = np.einsum("kp,kpc->kc", along.conj(), columns)
    return np.asarray(columns - along[:, :, None] * shares[:, None, :])


def stacked(columns: Complex) -> Real:
    """Return columns (n_lines, n_responses, n_columns) as real ones, real parts above imaginary parts."""
    return np.concatenate([columns.real, columns.imag]).reshape(-1, columns.shape[2])


def orthonormal(columns: Real) -> Real:
    """Return orthonormal columns that span the same space."""
    sizes = np.linalg.norm(columns, axis=0)
    left, values, _ = np.linalg.svd(columns / np.where(sizes > 0, sizes, 1.0), full_matrices=False)
    return np.asarray(left[:, values > 1e-9 * values[0]])


def without(ends: Real, columns: Real) -> Real:
    """Return columns without their parts along orthonormal ones."""
    return np.asarray(columns - ends @ (ends.T @ columns))


def _noise(lines: WindowedSpectrum, white: Complex, part: RefitPart, before: NoiseModel) -> NoiseModel:
    """Infer the noise of a recording; the residual of each response is raised by what the free force takes of it."""
    parts = part.residual.reshape(2, *part.along.shape)
    root = np.linalg.inv(white)
    residual = np.einsum("kij,kj->ki", root, parts[0] + 1j * parts[1])
    taken = np.abs(np.einsum("kij,kj->ki", root, part.along)) ** 2 / np.sum(np.abs(root) ** 2, axis=2)
    # a response that shows nothing but the joint's force says nothing about its noise
    return _quiet(before, residual / np.sqrt(np.maximum(1 - taken, LEAST_LEFT)), lines)


def _quiet(noise: NoiseModel, residual: Complex, lines: WindowedSpectrum) -> NoiseModel:
    """Return flat noise, of which the quietest fifth of narrow bands has this level by chance.

    The relative noise of the forces is the share :data:`FORCE_SHARE` of that of the responses.
    """
    count = max(1.0, len(residual) / min(150, max(4, len(residual) // 12)))
    quiet = quiet_noise(noise, residual)
    responses = quiet.responses + np.log(count / scipy.stats.gamma.ppf(0.2, count))
    response_level, force_level = levels(lines)
    share = np.median(np.exp(0.5 * responses[:, 0]) / response_level)
    return replace(quiet, responses=responses, forces=2 * np.log(np.maximum(FORCE_SHARE * share * force_level, 1e-30)))


def _rest(parts: tuple[RefitPart, ...]) -> float:
    """Return the mean power of the projected residual for each of its degrees of freedom, in units of the noise."""
    power = sum(2 * float(part.residual @ part.residual) for part in parts)
    return power / float(sum(2 * len(part.force) * (part.along.shape[1] - 1) - part.ends.shape[1] for part in parts))
