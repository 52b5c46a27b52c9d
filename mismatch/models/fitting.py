"""Gauss-Newton on whole recordings: modal parameters within a lab's error, the numbers of causes, and the noise."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimation import WindowedSpectrum

from ..noise.noise_model import NoiseModel
from .hypothesis import Explanation, predict_lines
from .jacobian import jacobian
from .misfit import Assessed, assess, whitened, with_noise

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

THREADS = 2

ENOUGH, LEFT_OUT = 4000, 3
"""Lines of a recording on which a fit begins if it has more, and the steps on all lines that this saves."""

MORE_THAN_EXPECTED, LONGER = 1.5, 3.0
"""Gain of a step over the gain that was expected of it from which a longer one is tried, and how much longer."""


@dataclass(frozen=True)
class Fit:
    """An explanation fitted to recordings.

    Parameters
    ----------
    explanation
        At its best.
    noises
        One a recording.
    misfit
        ``2 sum ln det V + r^H V^-1 r`` over lines and recordings.
    deviation
        |u|^2, in lab errors.
    score
        ``misfit + deviation + n_cause_numbers ln N``: Bayes' information criterion with the lab's belief as prior.
    covariance : (size, size)
        Of u and the causes' coordinates.
    """

    explanation: Explanation
    noises: tuple[NoiseModel, ...]
    misfit: float
    deviation: float
    score: float
    covariance: Real


def fit(
    lines: list[WindowedSpectrum],
    start: Explanation,
    noises: tuple[NoiseModel, ...] | None = None,
    *,
    iterations: int = 8,
    tolerance: float = 3.0,
) -> Fit:
    """Fit an explanation to recordings.

    Minimises ``misfit + |u|^2`` by Gauss-Newton with step halving (Levenberg's damping where halving fails); noise is
    estimated anew at each step, so causes compete on what they leave, not on a noise that one of them assumed. Of long
    recordings every few lines come first.

    Parameters
    ----------
    lines
        Recordings.
    start
        To begin with.
    noises
        To begin with; None: from the residual of ``start``.
    iterations
        At most.
    tolerance
        Of the misfit: two gains below it end the fit, or a tenth of it expected.
    """
    explanation, known = start, noises
    with ThreadPoolExecutor(THREADS) as pool:
        rough = [one.thinned(ENOUGH) for one in lines]
        if any(few is not one for few, one in zip(rough, lines, strict=True)):
            explanation, seen, _ = _descended(pool, rough, explanation, known, (iterations, tolerance))
            known = tuple(one.noise for one in seen)
            iterations = max(0, iterations - LEFT_OUT)
        explanation, seen, matrix = _descended(pool, lines, explanation, known, (iterations, tolerance))
        cold = list(pool.map(with_noise, lines, [explanation] * len(lines), [None] * len(lines), seen))
    # a noise that crept along from a bad beginning may have stopped short: of two searches the better counts
    seen = [min(pair, key=lambda one: one.misfit) for pair in zip(seen, cold, strict=True)]
    misfit = sum(one.misfit for one in seen)
    deviation = _deviation(explanation)
    count = 2 * sum(one.measured.size for one in lines)
    numbers = sum(cause.size for cause in explanation.causes)
    # a mode's length may be shared between its vectors at will: two numbers of each are no freedom
    numbers += explanation.shape.added * (explanation.shape.per_mode - 2)
    return Fit(
        explanation,
        tuple(one.noise for one in seen),
        misfit,
        deviation,
        misfit + deviation + numbers * float(np.log(count)),
        np.asarray(np.linalg.pinv(matrix, hermitian=True), dtype=float),
    )


def _descended(
    pool: ThreadPoolExecutor,
    lines: list[WindowedSpectrum],
    start: Explanation,
    noises: tuple[NoiseModel, ...] | None,
    limits: tuple[int, float],
) -> tuple[Explanation, list[Assessed], Real]:
    """Where Gauss-Newton's steps end, the recordings there, and the normal matrix; limits as for :func:`fit`."""
    iterations, tolerance = limits
    explanation = start
    current = list(noises) if noises is not None else [None] * len(lines)
    seen = list(pool.map(with_noise, lines, [explanation] * len(lines), current))
    matrix, gradient = _normal_equations(pool, lines, explanation, seen)
    damping, idle = 0.0, 0
    for _ in range(iterations):
        cost = _cost(seen, explanation)
        step = _solved(matrix + damping * np.diag(np.diag(matrix)), gradient)
        # where a law is stiffer than its derivatives can follow there is no step either
        if not step @ gradient >= 0.1 * tolerance or not np.isfinite(step).all():
            break
        trial, again, trial_cost = _downhill(pool, lines, explanation, (step, float(step @ gradient)), seen)
        if not trial_cost < cost:
            if damping > 1:
                break
            damping = max(10 * damping, 0.1)
            continue
        damping /= 10
        explanation = trial
        seen = list(pool.map(with_noise, lines, [trial] * len(lines), [one.noise for one in again], again))
        # the noise may still be settling when a step gains nothing
        idle = idle + 1 if cost - _cost(seen, explanation) < tolerance else 0
        if idle == 2:
            break
        matrix, gradient = _normal_equations(pool, lines, explanation, seen)
    return explanation, seen, matrix


def residual(fitted: Fit, lines: list[WindowedSpectrum]) -> list[Complex]:
    """What a fit leaves of each recording, (n_lines, n_responses)."""
    return [one.measured - predict_lines(fitted.explanation, one).response for one in lines]


def _solved(matrix: Real, gradient: Real) -> Real:
    try:
        return np.asarray(np.linalg.solve(matrix, gradient), dtype=float)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.lstsq(matrix, gradient, rcond=1e-12)[0], dtype=float)


def _normal_of(lines: WindowedSpectrum, explanation: Explanation, seen: Assessed) -> tuple[Real, Real]:
    slope = whitened(seen.white, jacobian(explanation, lines, seen.predicted))
    small = whitened(seen.white, seen.rest[:, :, None])[:, 0]
    return 2 * (slope.T @ slope), 2 * (slope.T @ small)


def _normal_equations(
    pool: ThreadPoolExecutor, lines: list[WindowedSpectrum], explanation: Explanation, seen: list[Assessed]
) -> tuple[Real, Real]:
    """Normal equations with the lab's belief about u, and a belief so weak that it only keeps them solvable."""
    size, count = explanation.shape.size, explanation.size
    parts = list(pool.map(_normal_of, lines, [explanation] * len(lines), seen))
    belief = np.full(count, 1e-6)
    belief[:size] = explanation.shape.belief
    matrix = sum((part[0] for part in parts), np.diag(belief))
    gradient = sum((part[1] for part in parts), np.zeros(count))
    gradient[:size] -= explanation.shape.belief * explanation.u
    return matrix, gradient


def _downhill(
    pool: ThreadPoolExecutor,
    lines: list[WindowedSpectrum],
    here: Explanation,
    step: tuple[Real, float],
    seen: list[Assessed],
) -> tuple[Explanation, list[Assessed], float]:
    """Where a step (and the gain expected of it) leads, shortened until it gains, lengthened while that gains more."""
    way, expected = step
    cost = _cost(seen, here)
    for _ in range(4):
        trial, again = _try(pool, lines, here, way, seen)
        trial_cost = _cost(again, trial)
        if trial_cost < cost:
            break
        way = way / 4
    while cost - trial_cost > MORE_THAN_EXPECTED * expected:
        # a valley that is longer than its derivatives say, as those leave leakage out
        way = LONGER * way
        farther, then = _try(pool, lines, here, way, seen)
        if not _cost(then, farther) < trial_cost:
            break
        trial, again, trial_cost = farther, then, _cost(then, farther)
    return trial, again, trial_cost


def _try(
    pool: ThreadPoolExecutor, lines: list[WindowedSpectrum], here: Explanation, step: Real, seen: list[Assessed]
) -> tuple[Explanation, list[Assessed]]:
    """The explanation a step away, under the noise so far."""
    trial = _moved(here, step)
    return trial, list(pool.map(assess, lines, [trial] * len(lines), [one.noise for one in seen]))


def _moved(explanation: Explanation, step: Real) -> Explanation:
    size = explanation.shape.size
    moved = replace(explanation, u=explanation.u + step[:size])
    if not explanation.causes:
        return moved
    longest = np.concatenate([cause.longest_steps() for cause in explanation.causes])
    return moved.with_causes(explanation.coordinates() + np.clip(step[size:], -longest, longest))


def _cost(seen: list[Assessed], explanation: Explanation) -> float:
    return sum(one.misfit for one in seen) + _deviation(explanation)


def _deviation(explanation: Explanation) -> float:
    return float(explanation.shape.belief @ explanation.u**2)
