"""Whether natural frequencies move between recordings or within one: a score test of a likelihood fit."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import scipy

from millfrf.core import Complex, Index, Real

from ..settings import SETTINGS
from .likelihood_fit import Optimum
from .likelihood_model import LikelihoodModel, LikelihoodProblem
from .normal_equations import PIECE, constant_derivatives, corrected_force, real_products, unknowns_of_test

OVERSAMPLING = 4  # samples per line with which motion is multiplied by time

GROUP = 4  # neighbouring lines whose errors may depend on each other


@dataclass(frozen=True)
class MovingPoles:
    """Relative motion of the natural frequencies of a fit, to first order.

    Parameters
    ----------
    frequencies : (n_modes,), Hz
        Natural frequencies of the fit.
    shift : (n_tests, n_modes)
        Natural frequency in the middle of each recording over its mean over all recordings, minus 1.
    change : (n_tests, n_modes)
        Relative change of the natural frequency from the beginning to the end of each recording.
    shift_error, change_error : (n_tests, n_modes)
        Standard errors.
    p_value : (n_modes,)
        Probability of a motion as large as this of natural frequencies that are constant.
    """

    frequencies: Real
    shift: Real
    change: Real
    shift_error: Real
    change_error: Real
    p_value: Real

    def of(self, modes: Index) -> "MovingPoles":
        """Return the motion of some modes."""
        return MovingPoles(*(getattr(self, field.name)[..., modes] for field in fields(self)))

    @staticmethod
    def joined(parts: Sequence["MovingPoles"]) -> "MovingPoles":
        """Return the motions of the modes of several parts of a band as one."""
        names = [field.name for field in fields(MovingPoles)]
        return MovingPoles(*(np.concatenate([getattr(part, name) for part in parts], axis=-1) for name in names))

    def warning(self, recordings: Sequence[str]) -> str:
        """Return a sentence on the mode that moves most clearly; empty if no mode moves.

        Parameters
        ----------
        recordings
            Names of the recordings.
        """
        clearly = np.flatnonzero(self.p_value < SETTINGS.moving_p_value / len(self.p_value))
        if not len(clearly):
            return ""
        mode = int(clearly[self.p_value[clearly].argmin()])
        values = np.array([self.shift[:, mode], self.change[:, mode]])
        errors = np.array([self.shift_error[:, mode], self.change_error[:, mode]])
        kind, test = divmod(int(np.abs(values / errors).argmax()), len(recordings))
        size = f"{100 * values[kind, test]:+.2g} \u00b1 {100 * errors[kind, test]:.1g} %"
        how = f"{size} within {recordings[test]}" if kind else f"{size} off its mean in {recordings[test]}"
        return (
            f"natural frequencies move (near {self.frequencies[mode]:.4g} Hz: {how}; score test, "
            f"p = {self.p_value[mode]:.0e}): the structure drifts, its joints are not linear, or clocks run apart. An "
            "FRF or a fit is a mean that its error bars do not describe, and some of its modes may only imitate this "
            "motion; 'millfrf diagnose' with a nominal model tells which"
        )


def moving_poles(optimum: Optimum) -> MovingPoles:
    """Test whether the natural frequencies of a fit are constant, one mode at a time.

    With ``p_r (1 + a_tr + b_tr (tau / T - 1 / 2))`` for the pole r at the time tau of test t, the derivatives of the
    response by a and b are those of a mode driven by ``p_r q_r`` and by this times time, with the modal coordinate
    ``q_r``. The gradient of the likelihood by a and b is zero on average if the poles are constant (Rao's score test).
    Everything that constant dynamics could add is left out of it: what the unknowns of the fit take up, and for each
    pole any matrices R and S in ``R / (s - p) + S / (s - p)^2``, as of a mode that the fit lacks. The covariance of the
    gradient is that of the sums over groups of lines, so that noise may have any spectrum (White, Econometrica 48, 817,
    1980). The motion of a mode may also show in its neighbours.

    Parameters
    ----------
    optimum
        Constant poles, with all other unknowns of least squares.
    """
    model, n_tests = optimum.at.model, optimum.problem.spectra.n_tests
    n_modes = len(model.poles)
    constant, cross, own, scores = _products(optimum)
    taken_up = _pseudo_inverse(constant) @ cross
    # in units in which a motion moves the response, free of the fit, by one
    unit = 1 / np.sqrt(np.maximum(np.diag(own), 1e-300))
    information = (own - cross.T @ taken_up) * np.outer(unit, unit)
    gradients = np.concatenate([moving - fitted @ taken_up[where] for where, fitted, moving in scores]) * unit
    places = np.arange(len(information)).reshape(n_tests, 2, n_modes)
    motions = []
    for r in range(n_modes):
        mode = places[..., r].ravel()
        motions.append(_motion(information[np.ix_(mode, mode)], gradients[:, mode], unit[mode]))
    moves, errors, p_values = (np.array(values) for values in zip(*motions, strict=True))
    shift, change = moves.reshape(n_modes, n_tests, 2).transpose(2, 1, 0)
    shift_error, change_error = errors.reshape(n_modes, n_tests, 2).transpose(2, 1, 0)
    return MovingPoles(np.abs(model.poles) / (2 * np.pi), shift, change, shift_error, change_error, p_values)


def _pseudo_inverse(matrix: Real) -> Real:
    """Return the inverse of a symmetric matrix, zero along directions that it hardly holds."""
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    return np.asarray(np.linalg.pinv(matrix * np.outer(scale, scale), 1e-9, hermitian=True) * np.outer(scale, scale))


def _motion(information: Real, gradients: Real, unit: Real) -> tuple[Real, Real, float]:
    """Return the motion of a mode, shift and change of each test, its standard errors, and the p-value of no motion.

    ``gradients`` (n_groups, 2 n_tests) and the information are per ``unit`` (2 n_tests,) of each motion. A shift of all
    tests alike is none. Wald's statistic with an estimated covariance has Hotelling's distribution.
    """
    n_groups, n_tests = len(gradients), gradients.shape[1] // 2
    inverse = unit[:, None] * np.linalg.pinv(information, 1e-7, hermitian=True)
    moves, spread = inverse @ gradients.sum(axis=0), inverse @ gradients.T
    covariance = spread @ spread.T * n_groups / (n_groups - 1)
    contrasts = np.zeros((2 * n_tests - 1, 2 * n_tests))
    contrasts[: n_tests - 1, ::2] = np.linalg.svd(np.ones((1, n_tests)))[2][1:]  # differences between tests
    contrasts[n_tests - 1 :, 1::2] = np.eye(n_tests)
    estimate, count, freedom = contrasts @ moves, len(contrasts), n_groups - len(contrasts)
    if freedom < 1:
        return moves, np.sqrt(np.diag(covariance)), 1.0
    squares = estimate @ np.linalg.pinv(contrasts @ covariance @ contrasts.T, 1e-10, hermitian=True) @ estimate
    p_value = float(scipy.stats.f.sf(float(squares) * freedom / (count * (n_groups - 1)), count, freedom))
    return moves, np.sqrt(np.diag(covariance)), p_value


def _products(optimum: Optimum) -> tuple[Real, Real, Real, list[tuple[Index, Real, Real]]]:
    """Return products of derivatives: of constant dynamics, of these with motions, of motions; and gradients.

    For each test, the gradients are the places of its constant unknowns, the part by these (n_groups, n_places), and
    the part by all motions (n_groups, n_motions).
    """
    problem, at = optimum.problem, optimum.at
    n_tests, n_modes, n_unknowns = problem.spectra.n_tests, len(at.model.poles), at.model.pack().size
    n_responses, n_excitations, _ = at.frf.shape
    n_further, n_moves = 4 * n_modes * n_excitations * n_responses, 2 * n_modes * n_tests
    constant = np.zeros((n_unknowns + n_further,) * 2)
    cross, own, scores = np.zeros((len(constant), n_moves)), np.zeros((n_moves, n_moves)), []
    places, force = at.model.places(), corrected_force(problem, optimum.noise, at)
    for number, lines in enumerate(problem.spectra.lines_of_tests):
        where = np.concatenate([unknowns_of_test(places, number), n_unknowns + np.arange(n_further)])
        moving = np.arange(2 * n_modes) + 2 * n_modes * number
        motions = _derivatives(problem, at.model, force[:, lines], number, lines)
        gradients = []
        for first in range(0, lines.stop - lines.start, PIECE):
            piece = slice(lines.start + first, min(lines.start + first + PIECE, lines.stop))
            fixed = constant_derivatives(problem, at.model, force[:, piece], number, piece)
            further = _further_derivatives(problem, at.model, force[:, piece], piece)
            columns = np.concatenate([fixed, further, motions[..., first : first + PIECE]])
            weighted = at.weights.weighted(columns, piece)
            products = real_products(columns, weighted)
            n = len(where)
            constant[np.ix_(where, where)] += products[:n, :n]
            cross[np.ix_(where, moving)] += products[:n, n:]
            own[np.ix_(moving, moving)] += products[n:, n:]
            by_line = np.sum((columns.conj() * at.weighted_error[:, piece]).real, axis=1)
            gradients.append(np.add.reduceat(by_line, range(0, by_line.shape[1], GROUP), axis=1).T)
        rows = np.concatenate(gradients)
        by_motion = np.zeros((len(rows), n_moves))
        by_motion[:, moving] = rows[:, len(where) :]
        scores.append((where, rows[:, : len(where)], by_motion))
    return constant, cross, own, scores


def _further_derivatives(problem: LikelihoodProblem, model: LikelihoodModel, force: Complex, lines: slice) -> Complex:
    """Return the responses (n, n_responses, n_lines) to each force through 1 / (s - p) and 1 / (s - p)^2."""
    s, differentiation = problem.spectra.s[lines], problem.differentiation[:, lines]
    columns = []
    for power in (1, 2):
        plus, minus = ((s - poles[:, None]) ** -power for poles in (model.poles, model.poles.conj()))
        for gain in (1.0, 1j):
            functions = gain * plus[:, None] * force + np.conj(gain) * minus[:, None] * force
            columns.append(functions.reshape(-1, len(s)))
    moved = np.concatenate(columns)
    n = len(differentiation)
    result = np.zeros((n, len(moved), n, len(s)), dtype=complex)
    for response in range(n):
        result[response, :, response] = differentiation[response] * moved
    return result.reshape(-1, n, len(s))


def _derivatives(
    problem: LikelihoodProblem, model: LikelihoodModel, force: Complex, number: int, lines: slice
) -> Complex:
    """Return the derivatives (2 n_modes, n_responses, n_lines) of a test by the motions of its poles."""
    s, poles, differentiation = problem.spectra.s[lines], model.poles[:, None], problem.differentiation[:, lines]
    result = []
    for multiplied in (lambda lines: lines, _times_time):
        upper = poles / (s - poles) * multiplied((model.left @ force + model.transient[number][:, None]) / (s - poles))
        mirrored = (model.left.conj() @ force) / (s - poles.conj())
        lower = poles.conj() / (s - poles.conj()) * multiplied(mirrored)
        result.append(upper[:, None] * model.right[..., None] + lower[:, None] * model.right.conj()[..., None])
    return np.asarray(differentiation * np.concatenate(result))


def _times_time(lines: Complex) -> Complex:
    """Return the lines (..., n_lines) of a motion times ``tau / T - 1 / 2``."""
    count = lines.shape[-1]
    length = scipy.fft.next_fast_len(OVERSAMPLING * count)
    ramp = np.arange(length) / length - 0.5
    return np.asarray(np.fft.fft(np.fft.ifft(lines, length) * ramp)[..., :count])
