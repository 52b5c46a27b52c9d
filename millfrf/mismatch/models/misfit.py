"""Whitened residual of one recording under a hypothesis, its most likely noise, and derivatives of its lines."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real
from modal_fit import ModalModel

from ..records.noise_loops import whitened_columns, whitened_squares
from ..records.noise_model import NoiseModel, fit_noise, inexactness, whitening_and_determinant
from .first_motion import has_diverged, predict_lines, with_first_motion_adapted
from .hypothesis import Hypothesis, Predicted, Surround, start_pulse, surround, with_excitation
from .joint_tangents import JointChange, joint_changes
from .linear_lines import LinearLines, cut_products, cut_spectra, few_columns, linear_lines
from .modal_lines import add_outer, line_products, receptance_at
from .ringing import write_modal_changes
from .settings import FITTING


@dataclass(frozen=True)
class Misfit:
    """Prediction of a hypothesis for one recording, with residual, noise and misfit."""

    predicted: Predicted
    linear: LinearLines | None  # matrices of the linear part at the lines; None if they cannot be computed
    # whitening W of the residual at each line, lower triangular, with ``W^H W = V^-1``, (n_lines, n_responses,
    # n_responses)
    white: Complex
    residual: Complex  # residual lines, measured minus predicted, in the responses' units, (n_lines, n_responses)
    misfit: float  # misfit ``2 sum ln det V + r^H V^-1 r`` over the lines
    noise: NoiseModel


def misfit_under(lines: WindowedSpectrum, hypothesis: Hypothesis, noise: NoiseModel) -> Misfit:
    """Return the misfit under a given noise; infinite if the prediction is not finite."""
    try:
        predicted = predict_lines(hypothesis, lines)
        residual = lines.measured - predicted.response
        return _misfit_of(lines, predicted, linear_lines(hypothesis, lines), residual, noise)
    except np.linalg.LinAlgError:
        empty = np.zeros((0, 0), dtype=complex)
        return Misfit(Predicted(empty, empty, empty, ()), None, empty, empty, np.inf, noise)


def with_noise(
    lines: WindowedSpectrum, hypothesis: Hypothesis, noise: NoiseModel | None, seen: Misfit | None = None
) -> Misfit:
    """Return the misfit under the noise that fits the residual best.

    ``noise``: noise at the start of the search; None: taken from the residual. ``seen``: earlier result of the same
    hypothesis, whose prediction is reused.
    Raises ``numpy.linalg.LinAlgError`` if the simulation diverges, so that the predicted response is not finite.
    """
    predicted = seen.predicted if seen is not None else predict_lines(hypothesis, lines)
    residual = lines.measured - predicted.response
    if has_diverged(residual, lines):
        raise np.linalg.LinAlgError(f"the response predicted for {lines.recording.name} is not finite")
    linear = seen.linear if seen is not None and seen.linear is not None else linear_lines(hypothesis, lines)
    forces = None if lines.noise is None else np.einsum("kqq->kq", lines.noise.forces).real.mean(axis=0)
    inexact = inexactness(lines.measured)
    fitted = fit_noise(lines.frequencies, residual, linear.through, levels(lines), noise, forces, inexact)
    return _misfit_of(lines, predicted, linear, residual, fitted)


def least_misfit(hypothesis: Hypothesis, lines: WindowedSpectrum) -> float:
    """Return the misfit to one recording under its likeliest noise; infinite if the simulation diverges."""
    try:
        return with_noise(lines, hypothesis, None).misfit
    except np.linalg.LinAlgError:
        return np.inf


def through_structure(hypothesis: Hypothesis, lines: WindowedSpectrum) -> Complex:
    """Return the matrix from measured forces to responses at the lines, (n_lines, n_responses, n_excitations)."""
    return linear_lines(hypothesis, lines).through


def known_noise(lines: WindowedSpectrum, through: Complex, noise: NoiseModel) -> Complex:
    """Return the covariance of the noise, (n_lines, n_responses, n_responses).

    It is the measured covariance if noise was measured, otherwise the inferred one, which also contains errors of the
    form of the model.

    ``through``: matrix from measured forces to responses at the lines, (n_lines, n_responses, n_excitations).
    """
    if lines.noise is None:
        return noise.covariance(lines.frequencies, through)
    return lines.noise.covariance(lines.frequencies, through)


def fitted_noise(lines: WindowedSpectrum, through: Complex, noise: NoiseModel) -> Complex:
    """Return the covariance of noise and errors of the signals that a fit assumes, (n_lines, n_responses, n_responses).

    ``through``: matrix from measured forces to responses at the lines, (n_lines, n_responses, n_excitations).
    """
    return noise.covariance(lines.frequencies, through, inexactness(lines.measured))


def is_below_noise(hypothesis: Hypothesis, lines: WindowedSpectrum) -> bool:
    """Return whether a residual is clearly smaller than the measured noise.

    The measured noise then contains a response to the forces: forces that repeat only approximately, as at constant
    speed, change from period to period.
    """
    if lines.noise is None:
        return False
    covariance = lines.noise.covariance(lines.frequencies, through_structure(hypothesis, lines))
    residual_power = np.sum(np.abs(lines.measured - predict_lines(hypothesis, lines).response) ** 2, axis=0)
    return bool((residual_power < FITTING.below_noise * np.einsum("kpp->p", covariance).real).any())


def relative_residual_power(hypothesis: Hypothesis, lines: WindowedSpectrum) -> Real:
    """Return the ratio of residual power to response power for each response of a recording, (n_responses,)."""
    residual = lines.measured - predict_lines(hypothesis, lines).response
    return np.asarray(np.sum(np.abs(residual) ** 2, axis=0) / np.sum(np.abs(lines.measured) ** 2, axis=0))


SILENT = 1e-6  # least level of a channel over that of the loudest one: digits of a converter of 20 bit


def levels(lines: WindowedSpectrum) -> tuple[Real, Real]:
    """Return the root mean square over the lines of each response and of each force.

    They scale noise: a silent channel, which has none, gets a small part of the loudest one's.
    """
    sizes = (np.sqrt(np.mean(np.abs(part) ** 2, axis=0)) for part in (lines.measured, lines.force_here))
    responses, forces = (np.maximum(size, SILENT * size.max()) for size in sizes)
    return responses, forces


def whitened(white: Complex, lines: Complex) -> Real:
    """Return whitened lines as real columns, real parts above imaginary parts.

    ``lines`` has the shape (n_lines, n_responses, n_columns), the result (2 * n_lines * n_responses, n_columns).
    """
    out = np.empty((2, *lines.shape))
    whitened_columns(white, np.ascontiguousarray(lines), out)
    return out.reshape(-1, lines.shape[2])


def _misfit_of(
    lines: WindowedSpectrum, predicted: Predicted, linear: LinearLines, residual: Complex, noise: NoiseModel
) -> Misfit:
    """Return the misfit of a residual under a given noise; the misfit is infinite if it cannot be computed."""
    if has_diverged(residual, lines):
        return Misfit(predicted, linear, residual, residual, np.inf, noise)
    white, log_determinant = whitening_and_determinant(fitted_noise(lines, linear.through, noise))
    misfit = 2 * (log_determinant + whitened_squares(white, np.ascontiguousarray(residual), np.empty(len(residual))))
    return Misfit(predicted, linear, white, residual, misfit if np.isfinite(misfit) else np.inf, noise)


@dataclass(frozen=True)
class Slopes:
    """Factors of the derivative of the response lines, which are multiplied block by block of lines."""

    hypothesis: Hypothesis
    model: ModalModel  # modal model with all excitations, including those of joints and of the first motion
    frequencies: Real  # frequencies of the lines, (n_lines,), Hz
    # total force on the modes, on all excitations including those of joints, (n_lines, n_excitations), N
    force: Complex
    # matrix from displacements to measured responses, with feedback included, (n_lines, n_responses, n_responses)
    shown: Complex
    # for each joint and each rotation of its axis: response lines to a unit of its force, (n_lines, n_responses),
    # derivative of this force by fitted numbers, (n_lines, n_columns), and the first of these columns
    pushed: tuple[tuple[Complex, Complex, int], ...]
    # for each number of a linear cause: its column, and the derivative of the response lines, (n_lines, n_responses)
    direct: tuple[tuple[int, Complex], ...]

    def of(self, part: slice, white: Complex | None = None) -> Real:
        """Return the derivative at the lines ``part``, real and imaginary parts, (2, n_lines, n_responses, size).

        It is whitened by ``white`` unless this is None.
        """
        hypothesis, shape = self.hypothesis, self.hypothesis.shape

        def seen(lines: Complex) -> Complex:
            return lines[part] if white is None else line_products(white[part], lines[part])

        shown = seen(self.shown)
        out = np.empty((2, *shown.shape[:2], hypothesis.size))
        shape.write_slopes(self.model, self.frequencies[part], self.force[part], shown, out)
        out[..., shape.size :] = 0.0
        for response, change, first in self.pushed:
            add_outer(seen(response), change[part], first, out)
        for column, change in self.direct:
            add_outer(seen(change), np.ones((shown.shape[0], 1), dtype=complex), column, out)
        return out


def jacobian(hypothesis: Hypothesis, lines: WindowedSpectrum, predicted: Predicted, *, exact: bool = False) -> Complex:
    """Return the derivative of the response lines by u and the coordinates of causes, (n_lines, n_responses, size).

    If it must be ``exact``, and for a short recording, whose lines leak, it is computed over the whole recording and
    then cut. The first motion adapts to each number.
    """
    if predicted.first is None and not exact:
        parts = slopes(hypothesis, lines, predicted, linear_lines(hypothesis, lines)).of(slice(None))
        return np.asarray(parts[0] + 1j * parts[1])
    whole = lines.whole()
    linear = linear_lines(hypothesis, whole)
    factors = slopes(hypothesis, whole, predicted, linear)
    changes = np.empty((2, *lines.measured.shape, hypothesis.size))
    if linear.around.response is not None or linear.around.feedback is not None:
        real, imaginary = factors.of(slice(None))
        for some in few_columns(hypothesis.size):
            _write_parts(cut_spectra(real[..., some] + 1j * imaginary[..., some], lines), changes[..., some])
    else:
        write_modal_changes(hypothesis.shape, factors.model, factors.force, lines, changes)
        changes[..., hypothesis.shape.size :] = 0.0
        for column, change in factors.direct:
            _write_parts(cut_spectra(change[:, :, None], lines), changes[..., column : column + 1])
        _add_pushes(factors, lines, changes)
    return with_first_motion_adapted(predicted, lines, changes)


def _add_pushes(factors: Slopes, lines: WindowedSpectrum, changes: Real) -> None:
    """Add the windowed responses to the changes of the joint forces, which are known in single precision."""
    for response, change, first in factors.pushed:
        for some, cut in cut_products(response, change, lines):
            own = changes[..., first + some.start : first + some.stop]
            own += np.array([cut.real, cut.imag])


def _write_parts(values: Complex, out: Real) -> None:
    out[0], out[1] = values.real, values.imag


def slopes(hypothesis: Hypothesis, lines: WindowedSpectrum, predicted: Predicted, linear: LinearLines) -> Slopes:
    """Return the factors of the derivative of the response lines by u and the coordinates of causes."""
    changes = joint_changes(hypothesis, lines, predicted) if predicted.joints else ()
    reach = hypothesis.reach
    total_force = reach.forces(linear.around.pushed(lines.force_here))
    for change in changes:
        total_force = total_force - change.force[:, None] * change.push
    force = total_force
    if linear.around.feedback is not None:
        force = total_force - reach.forces(
            line_products(linear.around.feedback, line_products(linear.closed, total_force))
        )
    model = reach.model
    if predicted.first is not None:
        model, force = with_excitation(model, predicted.first), np.column_stack([force, start_pulse(lines)])
    return Slopes(
        hypothesis,
        model,
        lines.frequencies,
        np.ascontiguousarray(force),
        linear.returned(linear.shown),
        tuple(pushed for change in changes for pushed in _pushed(change, linear)),
        tuple(_direct(hypothesis, lines, linear, total_force)),
    )


def _pushed(change: JointChange, linear: LinearLines) -> Iterator[tuple[Complex, Complex, int]]:
    """Yield the entries ``pushed`` of :class:`Slopes` for a joint force and for the rotations of the joint's axis."""

    yield linear.to_joint(change.push), change.change, change.first
    for k, turn in enumerate(change.turns.T):
        yield linear.to_joint(turn), change.force[:, None], change.angles + k


def _direct(
    hypothesis: Hypothesis, lines: WindowedSpectrum, linear: LinearLines, felt: Complex
) -> Iterator[tuple[int, Complex]]:
    """Yield the entries ``direct`` of :class:`Slopes`: column and difference quotient of each number of a linear cause.

    ``felt`` is the total force on the modes.
    """
    linear_ones = [np.full(cause.size, cause.axis is None) for cause in hypothesis.causes]
    columns = np.flatnonzero(np.concatenate([np.zeros(0, dtype=bool), *linear_ones]))
    if not len(columns):
        return
    receptance = linear.receptance
    if hypothesis.model.residuals is not None and hypothesis.model.residuals.lower.any():
        receptance = receptance_at(hypothesis.reach.model, lines.frequencies)[:, : receptance.shape[1]]
    forces = hypothesis.reach.forces
    joint = forces(linear.around.pushed(lines.force_here)) - felt

    def response(around: Surround) -> Complex:
        through = receptance if around.feedback is None else around.closed(linear.receptance)
        displacement = line_products(through, forces(around.pushed(lines.force_here)) - joint)
        return around.shown(displacement * lines.kinematic)

    coordinates, plain = hypothesis.coordinates(), response(linear.around)
    steps = hypothesis.difference_steps()
    for k in columns:
        perturbed = coordinates.copy()
        perturbed[k] += steps[k]
        moved = surround(hypothesis.with_causes(perturbed), lines.frequencies)
        yield hypothesis.shape.size + int(k), (response(moved) - plain) / steps[k]
