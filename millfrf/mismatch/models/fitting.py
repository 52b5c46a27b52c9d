"""Gauss-Newton on whole recordings: modal parameters within a lab's error, the numbers of causes, and the noise."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real

from ..inference.descent import Descended, Limits, descend, plain_step
from ..noise.noise_model import NoiseModel
from ..physics.structural import MODAL_PARAMETERS
from .hypothesis import Hypothesis, predict_lines
from .line_slopes import slopes
from .misfit import Misfit, misfit_under, whitened, with_noise

THREADS = 2

ENOUGH, LEFT_OUT = 4000, 3
"""Lines of a recording on which a fit begins if it has more, and the steps on all lines that this saves."""

BLOCK = 512
"""Lines whose derivatives are worked out together."""


@dataclass(frozen=True)
class Fit:
    """A hypothesis fitted to recordings.

    Parameters
    ----------
    hypothesis
        The hypothesis with the numbers that fit best.
    noises
        Noise of each recording, in the order of the recordings.
    misfit
        Misfit ``2 sum ln det V + r^H V^-1 r``, summed over lines and recordings.
    deviation
        Square ``|u|^2`` of the deviation from the nominal model in lab errors, as far as it is believed.
    score
        ``misfit + deviation + n_cause_numbers ln N``: Bayes' information criterion with the lab's belief as prior.
    covariance : (size, size)
        Covariance of u and the causes' coordinates.
    """

    hypothesis: Hypothesis
    noises: tuple[NoiseModel, ...]
    misfit: float
    deviation: float
    score: float
    covariance: Real


@dataclass(frozen=True)
class Rival:
    """A fit of the same recordings that another must come near, so that it counts for anything.

    Parameters
    ----------
    fit
        The fit that is to be reached: of the same recordings, on the same lines.
    behind
        Cost ``misfit + |u|^2`` by which the other may stay behind; negative where it must be better.
    """

    fit: Fit
    behind: float = 0.0

    @property
    def goal(self) -> float:
        """Cost that the other must reach."""
        return self.fit.misfit + self.fit.deviation + self.behind

    def goal_on(self, few: list[WindowedSpectrum], lines: list[WindowedSpectrum]) -> float:
        """The same on a few of the lines."""
        hypothesis, share = self.fit.hypothesis, sum(map(_count, few)) / sum(map(_count, lines))
        seen = [with_noise(one, hypothesis, noise) for one, noise in zip(few, self.fit.noises, strict=True)]
        return sum(one.misfit for one in seen) + self.fit.deviation + share * self.behind


def _count(lines: WindowedSpectrum) -> int:
    return len(lines.frequencies)


def fit(
    lines: list[WindowedSpectrum],
    start: Hypothesis,
    noises: tuple[NoiseModel, ...] | None = None,
    *,
    iterations: int = 8,
    tolerance: float = 3.0,
    held: bool = False,
    rival: Rival | None = None,
) -> Fit:
    """Fit a hypothesis to recordings.

    Minimises ``misfit + |u|^2`` by Gauss-Newton with step halving (Levenberg's damping where halving fails); noise is
    estimated anew at each step, so causes compete on what they leave, not on a noise that one of them assumed. A long
    recording is fitted on every few of its lines first.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    start
        Hypothesis that the fit begins with.
    noises
        Noise of each recording that the fit begins with; None: estimated from the residual of ``start``.
    iterations
        Number of steps at most.
    tolerance
        Gain in misfit that counts: the fit ends after two smaller gains, or where less than a tenth of it is expected.
    held
        Whether ``noises`` are held, and not estimated.
    rival
        Another fit that this one must come near: it ends where its steps are too small for that. None: there is none.

    Returns
    -------
    Fit
        With an infinite misfit and score where the start runs away when it is simulated: nothing then speaks for it.
    """
    try:
        return _fit(lines, start, noises, Limits(iterations, tolerance), held, rival)
    except np.linalg.LinAlgError:
        size = start.size
        return Fit(start, noises or (), np.inf, _deviation(start), np.inf, np.zeros((size, size)))


def _fit(
    lines: list[WindowedSpectrum],
    start: Hypothesis,
    noises: tuple[NoiseModel, ...] | None,
    limits: Limits,
    held: bool,
    rival: Rival | None,
) -> Fit:
    """The fit of a start that can be simulated."""
    hypothesis, known = start, noises
    with ThreadPoolExecutor(THREADS) as pool:
        rough = [one.thinned(ENOUGH) for one in lines]
        if any(some is not one for some, one in zip(rough, lines, strict=True)):
            few = replace(limits, goal=np.inf if rival is None else rival.goal_on(rough, lines))
            state = _descended(pool, rough, hypothesis, known, few, held).state
            hypothesis, known = state.hypothesis, tuple(one.noise for one in state.seen)
            limits = replace(limits, most=max(0, limits.most - LEFT_OUT))
        limits = limits if rival is None else replace(limits, goal=rival.goal)
        end = _descended(pool, lines, hypothesis, known, limits, held)
        hypothesis, seen = end.state.hypothesis, end.state.seen
        if not held:
            cold = list(pool.map(with_noise, lines, [hypothesis] * len(lines), [None] * len(lines), seen))
            # a noise that crept along from a bad beginning may have stopped short: the better of two searches counts
            seen = [min(pair, key=lambda one: one.misfit) for pair in zip(seen, cold, strict=True)]
    misfit, deviation = sum(one.misfit for one in seen), _deviation(hypothesis)
    count = 2 * sum(one.measured.size for one in lines)
    numbers = sum(cause.size for cause in hypothesis.causes)
    # a mode's length may be shared between its vectors at will: two numbers of each are no freedom
    numbers += hypothesis.shape.added * (hypothesis.shape.per_mode - 2)
    return Fit(
        hypothesis,
        tuple(one.noise for one in seen),
        misfit,
        deviation,
        misfit + deviation + numbers * float(np.log(count)),
        np.asarray(np.linalg.pinv(end.matrix, hermitian=True), dtype=float),
    )


@dataclass(frozen=True)
class _State:
    """Where a descent stands: a hypothesis, and every recording under it."""

    hypothesis: Hypothesis
    seen: list[Misfit]


@dataclass(frozen=True)
class _Problem:
    """Misfit and deviation of a hypothesis as the descent sees them; the recordings are worked on in threads."""

    pool: ThreadPoolExecutor
    lines: list[WindowedSpectrum]
    held: bool

    def cost(self, state: _State) -> float:
        """The cost ``misfit + |u|^2``."""
        return sum(one.misfit for one in state.seen) + _deviation(state.hypothesis)

    def normal_equations(self, state: _State) -> tuple[Real, Real]:
        """Normal equations with the lab's belief about u; a very weak one about causes only keeps them solvable."""
        hypothesis = state.hypothesis
        size, count = hypothesis.shape.size, hypothesis.size
        parts = list(self.pool.map(_normal_of, self.lines, [hypothesis] * len(self.lines), state.seen))
        belief = np.full(count, 1e-6)
        belief[:size] = hypothesis.shape.belief
        matrix = sum((part[0] for part in parts), np.diag(belief))
        gradient = sum((part[1] for part in parts), np.zeros(count))
        gradient[:size] -= hypothesis.shape.belief * hypothesis.u
        return matrix, gradient

    def step(self, state: _State, matrix: Real, gradient: Real) -> Real:
        """The solution of the normal equations that passes no limit of a cause's numbers."""
        return _within_limits(state.hypothesis, matrix, gradient)

    def moved(self, state: _State, step: Real) -> _State:
        """The hypothesis a step away, under the noise so far."""
        there = _moved(state.hypothesis, step)
        noises = [one.noise for one in state.seen]
        return _State(there, list(self.pool.map(misfit_under, self.lines, [there] * len(self.lines), noises)))

    def settled(self, state: _State) -> _State:
        """The hypothesis under the noise that fits its residual best, or under that which is held."""
        if self.held:
            return state
        there = [state.hypothesis] * len(self.lines)
        noises = [one.noise for one in state.seen]
        return replace(state, seen=list(self.pool.map(with_noise, self.lines, there, noises, state.seen)))


def _descended(
    pool: ThreadPoolExecutor,
    lines: list[WindowedSpectrum],
    start: Hypothesis,
    noises: tuple[NoiseModel, ...] | None,
    limits: Limits,
    held: bool,
) -> Descended[_State]:
    """Where Gauss-Newton's steps end."""
    current = list(noises) if noises is not None else [None] * len(lines)
    if held and noises is not None:
        seen = list(pool.map(misfit_under, lines, [start] * len(lines), noises))
    else:
        seen = list(pool.map(with_noise, lines, [start] * len(lines), current))
    return descend(_Problem(pool, lines, held), _State(start, seen), limits)


def residual(fitted: Fit, lines: list[WindowedSpectrum]) -> list[Complex]:
    """What a fit leaves of each recording, (n_lines, n_responses)."""
    return [one.measured - predict_lines(fitted.hypothesis, one).response for one in lines]


def _normal_of(lines: WindowedSpectrum, hypothesis: Hypothesis, seen: Misfit) -> tuple[Real, Real]:
    """Normal matrix and gradient of one recording's misfit, added up over blocks of lines that a cache holds."""
    assert seen.linear is not None
    parts = slopes(hypothesis, lines, seen.predicted, seen.linear)
    matrix, gradient = np.zeros((hypothesis.size, hypothesis.size)), np.zeros(hypothesis.size)
    for start in range(0, len(seen.rest), BLOCK):
        part = slice(start, start + BLOCK)
        slope = parts.of(part, seen.white).reshape(-1, hypothesis.size)
        matrix += slope.T @ slope
        gradient += slope.T @ whitened(seen.white[part], seen.rest[part, :, None])[:, 0]
    return 2 * matrix, 2 * gradient


def _within_limits(hypothesis: Hypothesis, matrix: Real, gradient: Real) -> Real:
    """The plain solution; numbers at a limit that it pushes outwards stay there, and the others are solved again."""
    step = plain_step(matrix, gradient)
    blocked = np.concatenate([np.zeros(hypothesis.shape.size), hypothesis.blocked()])
    held = np.zeros(len(step), dtype=bool)
    while (blocked * step > 0).any():
        held |= blocked * step > 0
        step = np.zeros(len(step))
        step[~held] = plain_step(matrix[np.ix_(~held, ~held)], gradient[~held])
    return step


def _moved(hypothesis: Hypothesis, step: Real) -> Hypothesis:
    size = hypothesis.shape.size
    moved = replace(hypothesis, u=hypothesis.u + step[:size])
    if not hypothesis.causes:
        return moved
    longest = np.concatenate([cause.longest_steps() for cause in hypothesis.causes])
    return moved.stepped(hypothesis.coordinates() + np.clip(step[size:], -longest, longest))


def _deviation(hypothesis: Hypothesis) -> float:
    return float(hypothesis.shape.belief @ hypothesis.u**2)


def modes_are_odd(fitted: Fit) -> bool:
    """Whether the believed modes deviate from the nominal model by more than errors of the usual size do.

    Parameters
    ----------
    fitted
        A hypothesis fitted to recordings.
    """
    return MODAL_PARAMETERS.odd(*_modal_deviation(fitted))


def oddity_of_modes(fitted: Fit) -> float:
    """Excess ``|u|^2 - n`` of the believed modes' deviation over what errors of the usual size make it, 0 or more.

    Parameters
    ----------
    fitted
        A hypothesis fitted to recordings.
    """
    deviation, count = _modal_deviation(fitted)
    return max(0.0, deviation - count)


def _modal_deviation(fitted: Fit) -> tuple[float, int]:
    """``|u|^2`` of the believed modes in lab errors, and how many numbers it is the sum over."""
    shape = fitted.hypothesis.shape
    rows = shape.modal_rows(fitted.hypothesis.u)[: shape.believed]
    # the two numbers of each mode's scale are free
    return float(np.sum(rows**2)), shape.believed * (shape.per_mode - 2)
