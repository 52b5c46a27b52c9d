"""Selection of the modes that a band needs: candidates tried one after the other."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import Real

from ..shapes import modal_assurance
from .elimination import Elimination, Modes, eliminate, half_power_lines, inside, just_outside, participations
from .judging import judge, judge_again, judge_early
from .measured_lines import MeasuredLines
from .refinement import refine
from .steady_poles import Candidate

_ROUNDS = 4
_LOOKS = 3
_STEPS, _TOLERANCE = 8, 1e-3
_STEADY = 0.5  # share of the orders
_ALIKE = 0.9  # assurance of two participation vectors


@dataclass(frozen=True)
class Selection:
    """Modes that were taken, and candidates that were refused.

    Parameters
    ----------
    modes
        Modes in the order in which they were taken.
    taken
        The candidate that each mode started from.
    refused
        The other candidates, each with the reason why it was refused.
    lines
        Lines of the fit with their last weights.
    """

    modes: Modes
    taken: tuple[Candidate, ...]
    refused: tuple[tuple[Candidate, str], ...]
    lines: MeasuredLines


Reweigh = Callable[[MeasuredLines, Elimination], MeasuredLines]
LookAgain = Callable[[Modes, MeasuredLines, Elimination], Sequence[Candidate]]


def select_modes(
    found: Sequence[Candidate],
    lines: MeasuredLines,
    reweigh: Reweigh,
    look_again: LookAgain,
    *,
    n_modes: int | None = None,
) -> Selection:
    """Start from the steady candidates, leave out what is not needed, and add what is missed until a round adds none.

    Steady ones start together, because heavily damped modes that overlap cannot be judged one by one.

    Parameters
    ----------
    found
        Candidates in falling order of trust.
    lines
        All lines of the band.
    reweigh
        Gives the lines new weights from what a fit leaves.
    look_again
        Gives candidates from what a fit leaves: weak modes show there, once strong ones are taken away.
    n_modes
        Most modes to take; None: as many as are needed.
    """
    steady = _apart([one for one in found if one.share >= _STEADY][:n_modes])
    pending: Sequence[Candidate] = tuple(one for one in found if not any(one is other for other in steady))
    poles = np.array([one.pole for one in steady], dtype=complex)
    start = Modes(poles, participations(poles, lines)).scaled() if steady else Modes.none(lines.drive.shape[2])
    state = Selection(start, tuple(steady), (), lines)
    state = _refined(_without_needless(state, thorough=False), reweigh)
    state, pending = _added(state, pending, reweigh, n_modes)
    for _ in range(_LOOKS):
        before = len(state.modes.poles)
        if n_modes is not None and _n_inside(state) >= n_modes:
            break
        left = look_again(state.modes, state.lines, eliminate(state.modes, state.lines))
        state, pending = _added(state, (*left, *pending), reweigh, n_modes)
        if len(state.modes.poles) == before:
            break
    return _without_needless(state, thorough=True)


def _added(
    state: Selection, pending: Sequence[Candidate], reweigh: Reweigh, n_modes: int | None
) -> tuple[Selection, Sequence[Candidate]]:
    """Add candidates until a round adds none; also those that are left."""
    for _ in range(_ROUNDS):
        state, pending, added = _one_round(state, pending, n_modes)
        if not added:
            break
        state = _refined(state, reweigh)
    return state, pending


def _n_inside(state: Selection) -> int:
    return int(inside(state.modes, state.lines.band).sum())


def _refined(state: Selection, reweigh: Reweigh) -> Selection:
    refined = refine(state.modes, state.lines, steps=_STEPS, tolerance=_TOLERANCE)
    return replace(state, modes=refined.modes, lines=reweigh(state.lines, refined.elimination))


def _apart(steady: Sequence[Candidate]) -> list[Candidate]:
    """Drop candidates within the half-power band of a steadier one with a like participation."""
    apart: list[Candidate] = []
    for one in steady:
        near = [
            other
            for other in apart
            if abs(one.pole - other.pole) < 0.5 * (abs(one.pole.real) + abs(other.pole.real))
            or (
                abs(one.pole - other.pole) < abs(one.pole.real) + abs(other.pole.real)
                and modal_assurance(one.participation[None], other.participation[None])[0, 0] > _ALIKE
            )
        ]
        if not near:
            apart.append(one)
    return apart


def _one_round(
    state: Selection, pending: Sequence[Candidate], n_modes: int | None
) -> tuple[Selection, tuple[Candidate, ...], bool]:
    """Try each pending candidate once."""
    later: list[Candidate] = []
    refused: list[tuple[Candidate, str]] = []
    added = False
    elimination = eliminate(state.modes, state.lines)
    for candidate in pending:
        if n_modes is not None and _n_inside(state) >= n_modes:
            refused.append((candidate, f"not among the {n_modes} asked for"))
            continue
        if _known(candidate, state.modes):
            continue
        verdict = judge(candidate, state.modes, elimination, state.lines)
        if verdict.reason:
            later.append(candidate)
            refused.append((candidate, verdict.reason))
            continue
        modes = state.modes.chosen(~verdict.near).joined(verdict.modes)
        near = np.flatnonzero(verdict.near)
        taken = [state.taken[n] for n in np.flatnonzero(~verdict.near)] + [state.taken[n] for n in near] + [candidate]
        state, added = replace(state, modes=modes, taken=tuple(taken)), True
        elimination = eliminate(modes, state.lines)
    return replace(state, refused=(*state.refused, *refused)), tuple(later), added


def _known(candidate: Candidate, modes: Modes) -> bool:
    """Whether a mode stands where the candidate does."""
    if not len(modes.poles):
        return False
    distance = np.abs(np.log(modes.poles / candidate.pole))
    return bool(distance.min() < 0.1 * candidate.damping_ratio)


def _without_needless(state: Selection, *, thorough: bool) -> Selection:
    """Try each mode again as a candidate beside all others, the least steady first, and leave out what fails."""
    order = np.argsort([candidate.share for candidate in state.taken], kind="stable")
    for candidate in [state.taken[number] for number in order]:
        number = next(n for n, one in enumerate(state.taken) if one is candidate)
        others = np.arange(len(state.modes.poles)) != number
        last = state.modes.chosen(others).joined(state.modes.chosen(~others))
        found = eliminate(last, state.lines)
        if state.lines.stated and not thorough:
            reason = judge_early(candidate, last, found, state.lines)
        else:
            reason = judge_again(candidate, last, found, state.lines, thorough=thorough)
        reason = reason or _strayed(candidate, complex(last.poles[-1]), state.lines)
        if reason:
            taken = tuple(one for one in state.taken if one is not candidate)
            rest = state.modes.chosen(others)
            if thorough:
                rest = refine(rest, state.lines, steps=_STEPS, tolerance=_TOLERANCE).modes
            state = replace(state, modes=rest, taken=taken, refused=(*state.refused, (candidate, reason)))
    return state


def _strayed(start: Candidate, pole: complex, lines: MeasuredLines) -> str:
    """Whether a mode moved by several bandwidths since it was a candidate, or far out of the band; empty where not.

    One that moved just outside stands for a mode there, and stays as an out-of-band term.
    """
    frequency, size = abs(pole) / (2 * np.pi), abs(pole)
    low, high = lines.band
    damping = max(start.damping_ratio, -pole.real / size, 0.0025)
    if just_outside(pole, lines.band):
        return ""
    if low < frequency < high and abs(pole - start.pole) <= min(4 * damping, 0.3) * abs(start.pole):
        return ""
    return f"refinement drives it to {frequency:.4g} Hz"


_COLOUR = 0.1  # correlation of neighbouring lines' errors from which a mode may stand for two
_SHIFTS = (-1.0, 1.0)  # half bandwidths from the mode
_PEAKS = 3
_ROUNDING = 1e-12  # share of the power below which nothing is left
_LEFT = 1.5  # times the noise expected: less is no reason to look
_SMOOTH = 5  # lines
_TRUST = 0.3  # as if three orders in ten had the pole


def hidden_candidates(modes: Modes, lines: MeasuredLines, found: Elimination) -> Iterator[Candidate]:
    """Poles to try beside modes whose errors have memory, and where most is left.

    Parameters
    ----------
    modes, lines, found
        The fit so far.
    """
    power = found.power(lines)
    if power.sum() < _ROUNDING * np.sum(np.abs(lines.values) ** 2):
        return
    for pole in modes.poles:
        here = half_power_lines(complex(pole), lines)
        if not here.any() or power[here].sum() < _LEFT * lines.noise[here].sum():
            continue
        if found.colour(lines, here) > max(_COLOUR, 3 / np.sqrt(here.sum() * lines.values[0].size)):
            for shift in _SHIFTS:
                yield _candidate(complex(pole) + 1j * shift * abs(pole.real), modes)
    if len(modes.poles):
        damping = float(np.median(modes.damping_ratios))
        for frequency in _peaks(lines, power):
            omega = 2 * np.pi * frequency
            yield _candidate(omega * complex(-damping, np.sqrt(1 - damping**2)), modes)


def _candidate(pole: complex, modes: Modes) -> Candidate:
    return Candidate(pole, _TRUST, 0, np.ones(modes.left.shape[1], dtype=complex))


def _peaks(lines: MeasuredLines, power: Real) -> list[float]:
    """Frequencies (Hz) of the largest separate maxima of the error's power, smoothed over a few lines."""
    if len(power) <= 2 * _SMOOTH:
        return []
    level = np.convolve(power / np.median(power), np.ones(_SMOOTH) / _SMOOTH, "same")
    top = np.flatnonzero((level[1:-1] > level[:-2]) & (level[1:-1] >= level[2:])) + 1
    expected = np.convolve(lines.noise / np.median(power), np.ones(_SMOOTH) / _SMOOTH, "same")
    top = top[level[top] > 2 * _LEFT * expected[top]]
    order = top[np.argsort(-level[top])][:_PEAKS]
    return [float(lines.frequencies[line]) for line in order]
