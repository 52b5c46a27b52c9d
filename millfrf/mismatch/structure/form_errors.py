"""What numbers owe to the form of the law: how far parts of the recordings disagree on them beyond noise."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real

from ..models.fitting import Fit, fit
from ..models.hypothesis import held_values, predict_lines
from ..models.line_slopes import jacobian
from ..models.misfit import fitted_noise, through_structure
from ..noise.noise_model import NoiseModel, whitening
from ..physics.protocol import FormedPhysics, JointPhysics
from .held_out import block_slices

WIDER, WORSE = 15, 20.0
"""Steps at most of a fit of a wider form, and score by which it may be worse: else it did not end."""

PARTS = 3
"""Number of parts of each recording, by how hard the structure moves: weak, middle, strong."""

DISAGREE = 0.05
"""Chance below which parts are taken to disagree."""

NORMAL = 1.959964
"""Standard errors to a side of a 95 % interval."""


def with_form_spread(fitted: Fit, lines: Sequence[WindowedSpectrum]) -> Fit:
    """A fit whose covariance holds, beside the noise, what its numbers owe to the form of their laws.

    A law that has a wider form, with one shape number more, is fitted in that form too: the difference of its numbers
    and the growth of their errors count. A drift that is bent may be an exponential one. Where the true law has
    another form, the numbers that match it best differ between small and large motion. Each recording is cut into
    blocks of time, and these are put into a weak, a middle and a strong part; each part g has its own answer
    ``theta_g = theta + N_g^-1 J_g^T V^-1 r_g`` for every number, to first order and with the modes held. Where the
    parts disagree beyond their noise (Cochran's Q), the variance between them (DerSimonian & Laird 1986, Controlled
    Clinical Trials 7) is added, widened by Student's t for the few parts: it is not divided by their number, as a
    wrong form does not average out.

    Parameters
    ----------
    fitted
        The final fit.
    lines
        Windowed lines of the recordings that were fitted.
    """
    shape = fitted.hypothesis.shape
    believed = shape.per_mode * (len(shape.nominal.poles) - shape.added)
    told = np.arange(believed, fitted.hypothesis.size)
    told = told[(told < shape.modal_size) | (told >= shape.size)]
    modal = np.concatenate([np.arange(first, first + 2) for first in range(0, believed, shape.per_mode)])
    extra = np.zeros(fitted.hypothesis.size)
    extra += _of_wider_forms(fitted, list(lines)) + _of_other_forms(fitted, list(lines)) + _of_other_courses(fitted)
    extra[modal] += _between(fitted, lines, modal)
    if len(told):
        extra[told] += _between(fitted, lines, told)
    return replace(fitted, covariance=fitted.covariance + np.diag(extra))


def _of_wider_forms(fitted: Fit, lines: list[WindowedSpectrum]) -> Real:
    """Variance that each number gains when its law may take a wider form, (size,).

    The wider law is fitted like the named one. The squared difference of its number and the growth of its variance
    are what the named number owes to the form.
    """
    extra = np.zeros(fitted.hypothesis.size)
    at = fitted.hypothesis.shape.size
    for place, cause in enumerate(fitted.hypothesis.causes):
        own, at = slice(at, at + len(cause.values)), at + cause.size
        make: Callable[[], tuple[JointPhysics, float]] | None = getattr(cause.physics, "wider", None)
        if make is None:
            continue
        physics, shape_number = make()
        wider = replace(cause, physics=physics, values=np.append(held_values(cause), shape_number))
        causes = list(fitted.hypothesis.causes)
        causes[place] = wider
        again = fit(lines, replace(fitted.hypothesis, causes=tuple(causes)), fitted.noises, iterations=WIDER)
        if again.score > fitted.score + WORSE:
            continue
        there = again.hypothesis.causes[place].coordinates()[: len(cause.values)]
        moved = there - cause.coordinates()[: len(cause.values)]
        gained = np.diag(again.covariance)[own] - np.diag(fitted.covariance)[own]
        extra[own] = moved**2 + np.maximum(gained, 0.0)
    return extra


def _of_other_forms(fitted: Fit, lines: list[WindowedSpectrum]) -> Real:
    """Variance that numbers owe to another form of their law, by how likely that form is beside the named one, (size,).

    The squared difference counts by the likelihood of the other form over that of the named one (Bayes' information
    criterion), and whole where both are as likely: the interval shall hold either.
    """
    extra = np.zeros(fitted.hypothesis.size)
    at = fitted.hypothesis.shape.size
    for number, cause in enumerate(fitted.hypothesis.causes):
        own, at = slice(at, at + len(cause.values)), at + cause.size
        if not isinstance(cause.physics, FormedPhysics):
            continue
        for place, values in cause.physics.other_forms(cause.values, cause.place):
            causes = list(fitted.hypothesis.causes)
            causes[number] = replace(cause, place=place, values=values)
            again = fit(lines, replace(fitted.hypothesis, causes=tuple(causes)), fitted.noises, iterations=WIDER)
            moved = again.hypothesis.causes[number].coordinates() - cause.coordinates()
            extra[own] += min(1.0, np.exp(-(again.score - fitted.score) / 2)) * moved**2
    return extra


def _of_other_courses(fitted: Fit) -> Real:
    """Variance that numbers owe to another course in time that looks like the named one, (size,): the whole difference.

    Both predict alike within the noise, and the interval shall hold either.
    """
    extra = np.zeros(fitted.hypothesis.size)
    at = fitted.hypothesis.shape.size
    for cause in fitted.hypothesis.causes:
        own, at = slice(at, at + len(cause.values)), at + cause.size
        other: Callable[[Real], Real] | None = getattr(cause.physics, "other_course", None)
        if other is not None:
            count = len(cause.values)
            moved = replace(cause, values=other(cause.values)).coordinates()[:count] - cause.coordinates()[:count]
            extra[own] += moved**2
    return extra


def _between(fitted: Fit, lines: Sequence[WindowedSpectrum], which: NDArray[np.int64]) -> Real:
    """Variance between parts of the recordings for the coordinates ``which``."""
    parts = [
        part for one, noise in zip(lines, fitted.noises, strict=True) for part in _parts(fitted, one, noise, which)
    ]
    found = [_answer(matrix, gradient) for matrix, gradient in parts]
    steps, variances = np.array([step for step, _ in found]), np.array([variance for _, variance in found])
    return np.array([_variance(steps[:, k], variances[:, k]) for k in range(len(which))])


def _parts(
    fitted: Fit, lines: WindowedSpectrum, noise: NoiseModel, which: NDArray[np.int64]
) -> list[tuple[Real, Real]]:
    """Normal equations of the weak, the middle and the strong part of a recording."""
    hypothesis = fitted.hypothesis
    predicted = predict_lines(hypothesis, lines)
    white = whitening(fitted_noise(lines, through_structure(hypothesis, lines), noise))
    slopes = np.einsum("kij,kjc->kic", white, jacobian(hypothesis, lines, predicted)[:, :, which])
    rest = np.einsum("kij,kj->ki", white, lines.measured - predicted.response)
    n = len(lines.window)
    slope, left, moved = (_signal(lines, part) for part in (slopes, rest, predicted.response))
    blocks = block_slices(lines)
    size = np.mean(moved**2, axis=0)
    strength = np.array([np.mean(moved[block] ** 2 / size) for block in blocks])
    found = []
    for group in np.array_split(np.argsort(strength), min(PARTS, len(blocks))):
        matrix, gradient = np.zeros((len(which), len(which))), np.zeros(len(which))
        for number in group:
            own = slope[blocks[number]].reshape(-1, len(which))
            matrix += n * own.T @ own
            gradient += n * own.T @ left[blocks[number]].ravel()
        found.append((matrix, gradient))
    return found


def _signal(lines: WindowedSpectrum, part: Complex) -> Real:
    """Windowed signals in time of lines (n_lines, ...)."""
    spectrum = np.zeros((len(lines.window) // 2 + 1, *part.shape[1:]), dtype=complex)
    spectrum[lines.band] = part
    return np.asarray(scipy.fft.irfft(spectrum, n=len(lines.window), axis=0))


def _answer(matrix: Real, gradient: Real) -> tuple[Real, Real]:
    """Step to a part's own answer, and its variance by the noise; infinite where the part says nothing."""
    inverse = np.linalg.pinv(matrix + 1e-6 * np.eye(len(matrix)), hermitian=True)
    return inverse @ gradient, np.diag(inverse)


def _variance(steps: Real, variances: Real) -> float:
    """Between parts, for a 95 % interval of 1.96 standard errors; 0 where they agree."""
    weights = 1 / np.maximum(variances, 1e-300)
    freedom = len(steps) - 1
    mean = np.sum(weights * steps) / np.sum(weights)
    q = float(np.sum(weights * (steps - mean) ** 2))
    if freedom < 1 or q < scipy.stats.chi2.isf(DISAGREE, freedom):
        return 0.0
    shared = float(np.sum(weights) - np.sum(weights**2) / np.sum(weights))
    if shared <= 0:
        # one part alone knows the number: the others cannot disagree
        return 0.0
    between = (q - freedom) / shared
    return max(between, 0.0) * float(scipy.stats.t.ppf(0.975, freedom) / NORMAL) ** 2
