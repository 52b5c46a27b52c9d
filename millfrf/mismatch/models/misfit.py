"""Residual of one recording under a hypothesis, whitened, and its most likely noise."""

from dataclasses import dataclass

import numpy as np

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real

from ..joints.joint_axis import JointAxis
from ..noise.loops import size_of_white, whitened_columns
from ..noise.noise_model import NoiseModel, fit_noise, inexactness, whitening_and_determinant
from .hypothesis import Hypothesis, Predicted, Surround, predict_lines, surround
from .modal_lines import line_products


@dataclass(frozen=True)
class LinearLines:
    """Matrices of the linear part, worked out once for all that needs them: misfit, noise and derivatives.

    Parameters
    ----------
    around
        Matrices of the linear causes.
    receptance : (n_lines, n_responses, n_reached), m/N
        Receptance H of the modal model, with the excitations that joints reach behind its own.
    closed : (n_lines, n_responses, n_reached), m/N
        Receptance ``T H`` with the feedback of linear causes around it.
    shown : (n_lines, n_responses, n_responses)
        Matrix ``C Q`` from displacements to measured quantities: Q their kinematic factors, C the measuring chain.
    through : (n_lines, n_responses, n_excitations)
        Matrix from measured forces, trusted as far as they are, to measured responses.
    """

    around: Surround
    receptance: Complex
    closed: Complex
    shown: Complex
    through: Complex

    def returned(self, matrix: Complex) -> Complex:
        """``M T``, with T the factor ``I - T H K`` of the feedback, for a matrix M (n_lines, n, n_responses)."""
        if self.around.feedback is None:
            return matrix
        own = self.closed[:, :, : self.around.feedback.shape[1]]
        return matrix - line_products(line_products(matrix, own), self.around.feedback)


def linear_lines(hypothesis: Hypothesis, lines: WindowedSpectrum, *more: JointAxis) -> LinearLines:
    """The linear part of a hypothesis at the lines of a recording.

    Parameters
    ----------
    hypothesis
        Hypothesis whose linear part is wanted.
    lines
        Windowed spectrum of the recording.
    more
        Axes of further joints that may push.

    Raises
    ------
    numpy.linalg.LinAlgError
        The feedback around the structure is singular at a line.
    """
    around = surround(hypothesis, lines.frequencies)
    n, m = len(hypothesis.model.responses), len(hypothesis.model.excitations)
    receptance = hypothesis.reach_with(*more).model.receptance(lines.frequencies)[:, :n]
    if around.response is None:
        shown = np.zeros((len(receptance), n, n), dtype=complex)
        shown[:, np.arange(n), np.arange(n)] = lines.kinematic
    else:
        shown = around.response * lines.kinematic[:, None, :]
    closed = around.closed(receptance)
    through = line_products(shown, closed[:, :, :m])
    if around.force is not None:
        through = line_products(through, around.force)
    return LinearLines(around, receptance, closed, shown, line_products(through, lines.trust))


def response_to_joint(hypothesis: Hypothesis, lines: WindowedSpectrum, axis: JointAxis) -> Complex:
    """Responses at the lines to a unit force along each entry of an axis, (n_lines, n_responses, n_entries)."""
    linear = linear_lines(hypothesis, lines, axis)
    columns = hypothesis.reach_with(axis).paths[-1].columns
    return line_products(linear.shown, linear.closed @ columns)


OUTDONE = 0.7
"""Power of a residual over that of measured noise below which that was not noise alone."""


@dataclass(frozen=True)
class Misfit:
    """One recording under a hypothesis.

    Parameters
    ----------
    predicted
        What the hypothesis predicts for the recording.
    linear
        Matrices of its linear part at the lines; None where they cannot be made.
    white : (n_lines, n_responses, n_responses)
        Whitening W of the residual at each line, lower triangular, with ``W^H W = V^-1``.
    rest : (n_lines, n_responses)
        Residual lines, measured minus predicted, in the responses' units.
    misfit
        Misfit ``2 sum ln det V + r^H V^-1 r`` over the lines.
    noise
        Noise whose covariance at the lines is V.
    """

    predicted: Predicted
    linear: LinearLines | None
    white: Complex
    rest: Complex
    misfit: float
    noise: NoiseModel


def misfit_under(lines: WindowedSpectrum, hypothesis: Hypothesis, noise: NoiseModel) -> Misfit:
    """Misfit under a given noise; infinite where a prediction is not finite or cannot be made."""
    try:
        predicted = predict_lines(hypothesis, lines)
        rest = lines.measured - predicted.response
        return _misfit_of(lines, predicted, linear_lines(hypothesis, lines), rest, noise)
    except np.linalg.LinAlgError:
        nothing = np.zeros((0, 0), dtype=complex)
        return Misfit(Predicted(nothing, nothing, nothing, ()), None, nothing, nothing, np.inf, noise)


def with_noise(
    lines: WindowedSpectrum, hypothesis: Hypothesis, noise: NoiseModel | None, seen: Misfit | None = None
) -> Misfit:
    """Misfit under the noise that fits the residual best.

    Parameters
    ----------
    lines
        Windowed spectrum of the recording.
    hypothesis
        Hypothesis that predicts it.
    noise
        Noise that the search begins with; None: taken from the residual.
    seen
        The same recording under the same hypothesis and another noise, if it was predicted before.

    Raises
    ------
    numpy.linalg.LinAlgError
        The hypothesis predicts no finite response: simulated freely, it runs away.
    """
    predicted = seen.predicted if seen is not None else predict_lines(hypothesis, lines)
    rest = lines.measured - predicted.response
    if not np.isfinite(rest).all():
        raise np.linalg.LinAlgError(f"the response predicted for {lines.recording.name} is not finite")
    linear = seen.linear if seen is not None and seen.linear is not None else linear_lines(hypothesis, lines)
    forces = None if lines.noise is None else np.einsum("kqq->kq", lines.noise.forces).real.mean(axis=0)
    inexact = inexactness(lines.measured)
    found = fit_noise(lines.frequencies, rest, linear.through, levels(lines), noise, forces, inexact)
    return _misfit_of(lines, predicted, linear, rest, found)


def least_misfit(hypothesis: Hypothesis, lines: WindowedSpectrum) -> float:
    """Misfit of a hypothesis to one recording under its likeliest noise; infinite where it runs away."""
    try:
        return with_noise(lines, hypothesis, None).misfit
    except np.linalg.LinAlgError:
        return np.inf


def through_structure(hypothesis: Hypothesis, lines: WindowedSpectrum) -> Complex:
    """Matrix from measured forces to measured responses at the lines, (n_lines, n_responses, n_excitations)."""
    return linear_lines(hypothesis, lines).through


def known_noise(lines: WindowedSpectrum, through: Complex, noise: NoiseModel) -> Complex:
    """Covariance of what is noise beyond doubt, (n_lines, n_responses, n_responses): measured, else inferred.

    Parameters
    ----------
    lines
        Windowed lines of the recording.
    through : (n_lines, n_responses, n_excitations)
        Matrix from measured forces to responses at the lines.
    noise
        Noise that was inferred from a residual, which holds the errors of the model's form, too.
    """
    if lines.noise is None:
        return noise.covariance(lines.frequencies, through)
    return lines.noise.covariance(lines.frequencies, through)


def fitted_noise(lines: WindowedSpectrum, through: Complex, noise: NoiseModel) -> Complex:
    """Covariance of what a fit takes for noise and for error of the signal, (n_lines, n_responses, n_responses).

    Parameters
    ----------
    lines
        Windowed lines of the recording.
    through : (n_lines, n_responses, n_excitations)
        Matrix from measured forces to responses at the lines.
    noise
        Noise that was fitted to the recording.
    """
    return noise.covariance(lines.frequencies, through, inexactness(lines.measured))


def outdoes_noise(hypothesis: Hypothesis, lines: WindowedSpectrum) -> bool:
    """Whether a hypothesis leaves clearly less of any response than the noise that was measured, which is then none.

    Forces that repeat only nearly, as at constant speed, change from period to period, and responses with them.

    Parameters
    ----------
    hypothesis
        A fitted hypothesis.
    lines
        Windowed lines of the recording.
    """
    if lines.noise is None:
        return False
    covariance = lines.noise.covariance(lines.frequencies, through_structure(hypothesis, lines))
    rest = np.sum(np.abs(lines.measured - predict_lines(hypothesis, lines).response) ** 2, axis=0)
    return bool((rest < OUTDONE * np.einsum("kpp->p", covariance).real).any())


def shares_left(hypothesis: Hypothesis, lines: WindowedSpectrum) -> Real:
    """Power that a hypothesis leaves of each response of one recording, as a share of the response's, (n_responses,).

    Parameters
    ----------
    hypothesis
        What predicts the recording.
    lines
        Windowed lines of the recording.
    """
    rest = lines.measured - predict_lines(hypothesis, lines).response
    return np.asarray(np.sum(np.abs(rest) ** 2, axis=0) / np.sum(np.abs(lines.measured) ** 2, axis=0))


def levels(lines: WindowedSpectrum) -> tuple[Real, Real]:
    """Root mean square over the lines of each response and of each force."""
    return (
        np.sqrt(np.mean(np.abs(lines.measured) ** 2, axis=0)),
        np.sqrt(np.mean(np.abs(lines.force_here) ** 2, axis=0)),
    )


def whitened(white: Complex, lines: Complex) -> Real:
    """Whitened lines (n_lines, n, n_columns) as real columns (2 n_lines n, n_columns), real above imaginary parts."""
    out = np.empty((2, *lines.shape))
    whitened_columns(white, np.ascontiguousarray(lines), out)
    return out.reshape(-1, lines.shape[2])


def _misfit_of(
    lines: WindowedSpectrum, predicted: Predicted, linear: LinearLines, rest: Complex, noise: NoiseModel
) -> Misfit:
    """Misfit of a residual under a given noise; infinite where it is not finite."""
    if not np.isfinite(rest).all():
        return Misfit(predicted, linear, rest, rest, np.inf, noise)
    white, log_determinant = whitening_and_determinant(fitted_noise(lines, linear.through, noise))
    misfit = 2 * (log_determinant + size_of_white(white, np.ascontiguousarray(rest), np.empty(len(rest))))
    return Misfit(predicted, linear, white, rest, misfit if np.isfinite(misfit) else np.inf, noise)
