"""Gauss-Newton fits to whole recordings: modal parameters with a prior, the numbers of causes, and the noise."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real

from ..inference.numerics import Descended, Limits, descend, plain_step
from ..inference.work import count_work
from ..physics.linear_causes import MODAL_PARAMETERS
from ..physics.protocol import ChainPhysics
from ..records.noise_model import NoiseModel, flat_noise
from .first_motion import predict_lines
from .hypothesis import Hypothesis
from .misfit import Misfit, jacobian, least_misfit, misfit_under, relative_residual_power, slopes, whitened, with_noise
from .settings import FITTING

THREADS = 2

SAVED_STEPS = 3  # the fit to all lines may take so many fewer steps after a fit to thinned lines

BEGINNING = 1 / 3  # part of a recording to which a strongly nonlinear law is fitted first

CONVERGENCE, CONVERGENCE_STEPS = 0.3, 4  # gain in misfit that is no longer significant, and most steps

BLOCK = 512  # lines whose derivatives are computed together


@dataclass(frozen=True)
class Fit:
    """A hypothesis fitted to recordings."""

    hypothesis: Hypothesis
    noises: tuple[NoiseModel, ...]  # noise of each recording, in the order of the recordings
    misfit: float  # misfit ``2 sum ln det V + r^H V^-1 r``, summed over lines and recordings
    deviation: float  # square ``|u|^2`` of the deviation from the nominal model in lab errors, weighted by the prior
    # ``misfit + deviation + n_cause_numbers ln N``: Bayes' information criterion with a prior for the modes
    score: float
    covariance: Real  # covariance of u and the causes' coordinates, (size, size)


@dataclass(frozen=True)
class Rival:
    """Fit to the same recordings with which a new fit competes: the new fit is useless if it misses the goal."""

    fit: Fit
    # amount by which the cost ``misfit + |u|^2`` of the new fit may be higher; negative if it must be lower
    behind: float = 0.0

    @property
    def goal(self) -> float:
        """Largest cost at which the new fit is useful."""
        return self.fit.misfit + self.fit.deviation + self.behind

    def goal_on(self, few: list[WindowedSpectrum], lines: list[WindowedSpectrum]) -> float:
        """Return the goal for the thinned recordings ``few`` instead of all ``lines``."""
        hypothesis, share = self.fit.hypothesis, sum(map(_count, few)) / sum(map(_count, lines))
        states = [
            with_noise(recording, hypothesis, noise) for recording, noise in zip(few, self.fit.noises, strict=True)
        ]
        return sum(state.misfit for state in states) + self.fit.deviation + share * self.behind


def _count(lines: WindowedSpectrum) -> int:
    return len(lines.frequencies)


def fit(
    lines: list[WindowedSpectrum],
    start: Hypothesis,
    noises: tuple[NoiseModel, ...] | None = None,
    *,
    iterations: int = 8,
    tolerance: float = 3.0,
    fixed_noise: bool = False,
    rival: Rival | None = None,
    exact: bool = False,
) -> Fit:
    """Fit a hypothesis to recordings.

    Minimises ``misfit + |u|^2`` by Gauss-Newton steps with step halving, and with Levenberg's damping if halving fails.
    The noise is estimated again at each step, so that all causes are compared with the noise that fits their residual
    best. A long recording is first fitted on a part of its lines.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    start
        Hypothesis from which the fit starts.
    noises
        Noise of each recording at the start; None: estimated from the residual of ``start``.
    iterations
        Largest number of steps.
    tolerance
        Significant gain in misfit: the fit ends after two smaller gains, or if a tenth of it is not expected.
    fixed_noise
        Whether ``noises`` are fixed, not estimated.
    rival
        Competing fit: this fit ends early if its steps are too small to reach the goal of the rival. None: no rival.
    exact
        Whether the derivatives leak from line to line like the prediction. Without it they are wrong by up to a tenth:
        sums of numbers that cancel each other then seem to be determined (:func:`converged`).

    Returns
    -------
    Fit
        Misfit and score are infinite if the simulation of the start diverges.
    """
    try:
        return _fit(lines, start, noises, Limits(iterations, tolerance), fixed_noise, rival, exact)
    except np.linalg.LinAlgError:
        size = start.size
        return Fit(start, noises or (), np.inf, _deviation(start), np.inf, np.zeros((size, size)))


def _fit(
    lines: list[WindowedSpectrum],
    start: Hypothesis,
    noises: tuple[NoiseModel, ...] | None,
    limits: Limits,
    fixed_noise: bool,
    rival: Rival | None,
    exact: bool,
) -> Fit:
    """Fit as described for :func:`fit`.

    Raises ``numpy.linalg.LinAlgError`` if the simulation of the start diverges.
    """
    hypothesis, start_noises = start, noises
    with ThreadPoolExecutor(THREADS) as pool:
        thinned = [recording.thinned(FITTING.thinned_lines) for recording in lines]
        if any(thinned_recording is not recording for thinned_recording, recording in zip(thinned, lines, strict=True)):
            thinned_limits = replace(limits, goal=np.inf if rival is None else rival.goal_on(thinned, lines))
            state = _descended(pool, thinned, hypothesis, start_noises, thinned_limits, fixed_noise, exact).state
            hypothesis, start_noises = state.hypothesis, tuple(recorded.noise for recorded in state.seen)
            limits = replace(limits, max_steps=max(0, limits.max_steps - SAVED_STEPS))
        limits = limits if rival is None else replace(limits, goal=rival.goal)
        end = _descended(pool, lines, hypothesis, start_noises, limits, fixed_noise, exact)
        hypothesis, seen = end.state.hypothesis, end.state.seen
        if not fixed_noise:
            fresh = list(pool.map(with_noise, lines, [hypothesis] * len(lines), [None] * len(lines), seen))
            # the noise that was updated from a bad start may not have converged: the better of both estimates is kept
            seen = [min(pair, key=lambda recorded: recorded.misfit) for pair in zip(seen, fresh, strict=True)]
    misfit, deviation = sum(recorded.misfit for recorded in seen), _deviation(hypothesis)
    count = 2 * sum(recording.measured.size for recording in lines)
    numbers = sum(cause.size for cause in hypothesis.causes)
    # a complex factor may be moved from one vector of a mode to the other: two numbers of each mode have no effect
    numbers += hypothesis.shape.added * (hypothesis.shape.per_mode - 2)
    return Fit(
        hypothesis,
        tuple(recorded.noise for recorded in seen),
        misfit,
        deviation,
        misfit + deviation + numbers * float(np.log(count)),
        np.asarray(np.linalg.pinv(end.matrix, hermitian=True), dtype=float),
    )


def converged(fitted: Fit, lines: list[WindowedSpectrum]) -> Fit:
    """Return a fit after steps with exact derivatives under the same noise, and with the covariance that they give.

    A law and the modes may replace each other, for instance a constant stiffness of a joint. Such sums of numbers are
    determined by the prior alone, which derivatives of a few per cent error hide.
    """
    exact = fit(
        lines,
        fitted.hypothesis,
        fitted.noises,
        iterations=CONVERGENCE_STEPS,
        tolerance=CONVERGENCE,
        fixed_noise=True,
        exact=True,
    )
    return exact if np.isfinite(exact.score) else fitted


@dataclass(frozen=True)
class _State:
    """State of a descent: a hypothesis, and the misfit of every recording."""

    hypothesis: Hypothesis
    seen: list[Misfit]


@dataclass(frozen=True)
class _Problem:
    """Cost, normal equations and steps of a hypothesis for the descent; recordings are processed in threads."""

    pool: ThreadPoolExecutor
    lines: list[WindowedSpectrum]
    fixed_noise: bool
    exact: bool

    def cost(self, state: _State) -> float:
        return sum(misfit.misfit for misfit in state.seen) + _deviation(state.hypothesis)

    def normal_equations(self, state: _State) -> tuple[Real, Real]:
        """Return normal matrix and gradient, with the prior of u and a very weak prior of the causes.

        The weak prior keeps the equations solvable.
        """
        hypothesis = state.hypothesis
        size, count = hypothesis.shape.size, hypothesis.size
        count_work(sum(_derived_values(hypothesis, recording) for recording in self.lines))
        parts = list(
            self.pool.map(
                _normal_of, self.lines, [hypothesis] * len(self.lines), state.seen, [self.exact] * len(self.lines)
            )
        )
        precision = np.full(count, 1e-6)
        precision[:size] = hypothesis.shape.prior_precision
        matrix = sum((part[0] for part in parts), np.diag(precision))
        gradient = sum((part[1] for part in parts), np.zeros(count))
        gradient[:size] -= hypothesis.shape.prior_precision * hypothesis.u
        return matrix, gradient

    def step(self, state: _State, matrix: Real, gradient: Real) -> Real:
        return _within_limits(state.hypothesis, matrix, gradient)

    def moved(self, state: _State, step: Real) -> _State:
        hypothesis = _moved(state.hypothesis, step)
        count_work(sum(_predicted_values(hypothesis, recording) for recording in self.lines))
        noises = [misfit.noise for misfit in state.seen]
        return _State(hypothesis, list(self.pool.map(misfit_under, self.lines, [hypothesis] * len(self.lines), noises)))

    def settled(self, state: _State) -> _State:
        if self.fixed_noise:
            return state
        hypotheses = [state.hypothesis] * len(self.lines)
        noises = [misfit.noise for misfit in state.seen]
        return replace(state, seen=list(self.pool.map(with_noise, self.lines, hypotheses, noises, state.seen)))


def _descended(
    pool: ThreadPoolExecutor,
    lines: list[WindowedSpectrum],
    start: Hypothesis,
    noises: tuple[NoiseModel, ...] | None,
    limits: Limits,
    fixed_noise: bool,
    exact: bool,
) -> Descended[_State]:
    """Run the Gauss-Newton steps from a start and return the final state."""
    current = list(noises) if noises is not None else [None] * len(lines)
    count_work(sum(_predicted_values(start, recording) for recording in lines))
    if fixed_noise and noises is not None:
        seen = list(pool.map(misfit_under, lines, [start] * len(lines), noises))
    else:
        seen = list(pool.map(with_noise, lines, [start] * len(lines), current))
    return descend(_Problem(pool, lines, fixed_noise, exact), _State(start, seen), limits)


def misfit_without_fit(lines: Sequence[WindowedSpectrum], hypothesis: Hypothesis) -> float:
    """Return the misfit of a hypothesis to all recordings under its likeliest noise; infinite if it diverges."""
    count_work(sum(_predicted_values(hypothesis, recording) for recording in lines))
    return sum(least_misfit(hypothesis, recording) for recording in lines)


def _predicted_values(hypothesis: Hypothesis, lines: WindowedSpectrum) -> int:
    """Return the number of values of a simulation: samples of all responses and of the joints simulated with them."""
    return lines.padded * (int(lines.measured.shape[1]) + _simulated_joints(hypothesis))


def _derived_values(hypothesis: Hypothesis, lines: WindowedSpectrum) -> int:
    """Return the number of values of a Jacobian: for each number, lines of all responses and samples of joints."""
    return hypothesis.size * (lines.measured.size + lines.padded * _simulated_joints(hypothesis))


def _simulated_joints(hypothesis: Hypothesis) -> int:
    return sum(law.seen is None for law in hypothesis.laws)


def fit_of_beginning(
    lines: list[WindowedSpectrum], start: Hypothesis, noises: tuple[NoiseModel, ...] | None = None, *, iterations: int
) -> Fit:
    """Fit a hypothesis to the first third of each recording.

    The error of a strongly nonlinear law grows along a free simulation, and a fit to the whole recording ends where
    most of the recording is not explained. The first part is explained first, and leads to the fit of the whole.
    Arguments and result are as for :func:`fit`.
    """
    return fit([recording.between(0.0, BEGINNING) for recording in lines], start, noises, iterations=iterations)


def residual(fitted: Fit, lines: list[WindowedSpectrum]) -> list[Complex]:
    """Return the residual of each recording, (n_lines, n_responses)."""
    return [recording.measured - predict_lines(fitted.hypothesis, recording).response for recording in lines]


def _normal_of(lines: WindowedSpectrum, hypothesis: Hypothesis, seen: Misfit, exact: bool) -> tuple[Real, Real]:
    """Return normal matrix and gradient of one recording, summed over blocks of lines that fit into the cache."""
    assert seen.linear is not None
    if exact or seen.predicted.first is not None:
        slope = whitened(seen.white, jacobian(hypothesis, lines, seen.predicted, exact=exact))
        return 2 * slope.T @ slope, 2 * slope.T @ whitened(seen.white, seen.residual[:, :, None])[:, 0]
    parts = slopes(hypothesis, lines, seen.predicted, seen.linear)
    matrix, gradient = np.zeros((hypothesis.size, hypothesis.size)), np.zeros(hypothesis.size)
    for start in range(0, len(seen.residual), BLOCK):
        part = slice(start, start + BLOCK)
        slope = parts.of(part, seen.white).reshape(-1, hypothesis.size)
        matrix += slope.T @ slope
        gradient += slope.T @ whitened(seen.white[part], seen.residual[part, :, None])[:, 0]
    return 2 * matrix, 2 * gradient


def _within_limits(hypothesis: Hypothesis, matrix: Real, gradient: Real) -> Real:
    """Return the step that solves the normal equations within the limits of the numbers.

    Numbers at a limit that the step would push beyond it are fixed, and the equations are solved for the other numbers.
    """
    step = plain_step(matrix, gradient)
    blocked = np.concatenate([np.zeros(hypothesis.shape.size), hypothesis.blocked()])
    fixed_noise = np.zeros(len(step), dtype=bool)
    while (blocked * step > 0).any():
        fixed_noise |= blocked * step > 0
        step = np.zeros(len(step))
        step[~fixed_noise] = plain_step(matrix[np.ix_(~fixed_noise, ~fixed_noise)], gradient[~fixed_noise])
    return step


def _moved(hypothesis: Hypothesis, step: Real) -> Hypothesis:
    size = hypothesis.shape.size
    moved = replace(hypothesis, u=hypothesis.u + step[:size])
    if not hypothesis.causes:
        return moved
    longest = np.concatenate([cause.longest_steps() for cause in hypothesis.causes])
    return moved.stepped(hypothesis.coordinates() + np.clip(step[size:], -longest, longest))


def _deviation(hypothesis: Hypothesis) -> float:
    return float(hypothesis.shape.prior_precision @ hypothesis.u**2)


def modes_are_implausible(fitted: Fit) -> bool:
    """Return whether the nominal modes deviate more than usual laboratory errors explain."""
    return MODAL_PARAMETERS.implausible(*_modal_deviation(fitted))


def excess_of_modes(fitted: Fit) -> float:
    """Return the excess ``|u|^2 - n`` of the deviation of the nominal modes, at least 0.

    For usual laboratory errors, ``|u|^2`` has the mean n, the number of degrees of freedom.
    """
    deviation, count = _modal_deviation(fitted)
    return max(0.0, deviation - count)


def _modal_deviation(fitted: Fit) -> tuple[float, int]:
    """Return ``|u|^2`` of the nominal modes in lab errors, and its number of degrees of freedom."""
    shape = fitted.hypothesis.shape
    rows = shape.deviations(fitted.hypothesis.u)
    # two numbers of each mode only move a complex factor between its vectors and are no degrees of freedom
    return float(np.sum(rows**2)), shape.nominal_modes * (shape.per_mode - 2)


def plain_fit(
    lines: list[WindowedSpectrum], start: Hypothesis, *, iterations: int, exact: float = FITTING.plain_error
) -> Fit:
    """Fit by unweighted least squares, with the same weight at every frequency and level.

    No noise is inferred. Each response is scaled by its power over all recordings. ``exact`` is the assumed error of
    every line as a share of the response; the smaller this error, the weaker the influence of the prior.
    """
    power = np.mean([np.mean(np.abs(recording.measured) ** 2, axis=0) for recording in lines], axis=0)
    noises = tuple(
        flat_noise(recording.frequencies, exact**2 * power, recording.force_here.shape[1]) for recording in lines
    )
    return fit(lines, start, noises, iterations=iterations, fixed_noise=True)


def even_fit(lines: list[WindowedSpectrum], fitted: Fit, *, iterations: int) -> Fit:
    """Fit by least squares with the same weight of weak and loud recordings.

    Minimises ``sum_k sum |r_k|^2 / P_k`` with the residual r_k and the power P_k of each response in recording k. If no
    law has the true form, no noise model describes the residual: maximum likelihood then fits mainly the lines with
    small inferred noise, and plain least squares mainly the loudest recording. The noise is estimated after the fit.
    The score is defined as for :func:`fit`, and infinite if the simulation diverges.
    """
    noises = tuple(
        flat_noise(
            recording.frequencies,
            FITTING.plain_error**2 * np.mean(np.abs(recording.measured) ** 2, axis=0),
            recording.force_here.shape[1],
        )
        for recording in lines
    )
    even = fit(lines, fitted.hypothesis, noises, iterations=iterations, fixed_noise=True)
    return fit(lines, even.hypothesis, fitted.noises or None, iterations=0) if np.isfinite(even.score) else even


def converged_gain(gained: float) -> float:
    """Return the gain in score of a step below which a fit has converged."""
    return max(FITTING.tolerance, FITTING.tolerance_share * gained)


def converged_fit(lines: list[WindowedSpectrum], fitted: Fit, gained: float = 0.0) -> Fit:
    """Fit to convergence; if the modes are then implausible, fit again from the nominal model and keep the better fit.

    A cause that changes the stiffness and the frequencies of the modes are strongly correlated: a fit may end where the
    modes describe a part of the cause. If a fit has not converged, its remaining gain would count for the next cause.
    """
    least = converged_gain(gained)
    first = fit(lines, fitted.hypothesis, fitted.noises, iterations=FITTING.iterations, tolerance=least)
    if not modes_are_implausible(first) or not first.hypothesis.has_added_physics:
        return first
    start, rival = at_nominal_modes(first.hypothesis), Rival(first, -least)
    restarted = fit(lines, start, first.noises, iterations=FITTING.iterations, tolerance=least, rival=rival)
    return min(first, restarted, key=lambda candidate: candidate.score)


def neglects_a_recording(lines: list[WindowedSpectrum], hypothesis: Hypothesis, largest: float) -> bool:
    """Return whether the largest error of a recording is above ``largest`` and far above the smallest error.

    Such a fit neglects the recording with the largest error.
    """
    errors = [float(np.sqrt(np.mean(relative_residual_power(hypothesis, recording)))) for recording in lines]
    return max(errors) > max(largest, FITTING.neglected * min(errors))


def following_all(lines: list[WindowedSpectrum], fitted: Fit, largest: float) -> Fit:
    """Return the fit, or, if it neglects a recording, a better fit that starts by plain least squares.

    Noise is inferred from the residual. A recording that a law does not yet describe is taken for noise and has little
    weight, even if different numbers of the law would describe it. Plain least squares gives weight to all recordings.
    """
    if not np.isfinite(fitted.score) or not neglects_a_recording(lines, fitted.hypothesis, largest):
        return fitted
    plain = plain_fit(lines, fitted.hypothesis, iterations=FITTING.restart_iterations, exact=FITTING.restart_error)
    refitted = fit(lines, plain.hypothesis, iterations=FITTING.restart_iterations)
    return min(fitted, refitted, key=lambda candidate: candidate.score)


def with_chain_from_belief(lines: list[WindowedSpectrum], fitted: Fit) -> Fit:
    """Return the fit, or a better fit of the same causes that starts from the nominal modes.

    The last cause is linear and starts without an effect. If the refitted modes describe its whole effect, a fit from
    these modes cannot find it.
    """
    *others, cause = fitted.hypothesis.causes
    assert isinstance(cause.physics, ChainPhysics)
    absent = replace(cause, values=cause.physics.start(fitted.hypothesis.shape.nominal))
    start = at_nominal_modes(replace(fitted.hypothesis, causes=(*others, absent)))
    refitted = fit(lines, start, iterations=FITTING.iterations)
    return min(fitted, refitted, key=lambda candidate: candidate.score)


def at_nominal_modes(hypothesis: Hypothesis) -> Hypothesis:
    """Return the hypothesis with the nominal modes reset to their nominal numbers; causes and added modes are kept."""
    shape, u = hypothesis.shape, hypothesis.u.copy()
    u[: shape.per_mode * shape.nominal_modes] = 0.0
    return replace(hypothesis, u=u)
