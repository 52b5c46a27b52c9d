"""Selection of the modes that a band needs: candidates are tried one after the other, and doubts about the choice."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import Real

from ..settings import SETTINGS
from ..shapes import modal_assurance
from .acceptance import reject_again, reject_early, try_candidate
from .candidates import Candidate
from .elimination import Elimination, Modes, eliminate, just_outside, participations
from .measured_lines import MeasuredLines, half_power_lines, peak_rise
from .refinement import refine

Reweigh = Callable[[MeasuredLines, Elimination], MeasuredLines]
SearchResidual = Callable[[Modes, MeasuredLines, Elimination], Sequence[Candidate]]


@dataclass(frozen=True)
class Selection:
    """Accepted modes, rejected candidates, and the weighted lines."""

    modes: Modes
    accepted: tuple[Candidate, ...]  # for each mode the candidate from which it started
    rejected: tuple[tuple[Candidate, str], ...]  # the other candidates, each with its reason
    lines: MeasuredLines  # with their last weights

    @property
    def n_inside(self) -> int:
        """Return the number of modes in the band."""
        return int(self.modes.inside(self.lines.band).sum())

    def without(self, number: int, reason: str) -> "Selection":
        """Return the selection with one mode rejected."""
        others = np.arange(len(self.accepted)) != number
        rejected = (*self.rejected, (self.accepted[number], reason))
        accepted = (*self.accepted[:number], *self.accepted[number + 1 :])
        return replace(self, modes=self.modes.chosen(others), accepted=accepted, rejected=rejected)


def select_modes(
    candidates: Sequence[Candidate],
    lines: MeasuredLines,
    reweigh: Reweigh,
    search_residual: SearchResidual,
    n_modes: int | None,
) -> Selection:
    """Start from the most stable candidates, remove needless modes, and add missing ones until none is found.

    The most stable candidates start together, because heavily damped modes that overlap cannot be tested one by one.

    Parameters
    ----------
    candidates
        Candidates, the most stable first.
    lines
        All lines of the band.
    reweigh
        Gives the lines new weights from the residual of a fit.
    search_residual
        Finds candidates in the residual of a fit, where weak modes show that strong ones hide.
    n_modes
        Largest number of modes; None: as many as are needed.
    """
    stable = _separate([c for c in candidates if c.order_share >= SETTINGS.steady_candidate][:n_modes])
    pending: Sequence[Candidate] = tuple(c for c in candidates if not any(c is other for other in stable))
    start = Modes(np.zeros(0, dtype=complex), np.zeros((0, lines.drive.shape[2]), dtype=complex))
    if stable:
        poles = np.array([candidate.pole for candidate in stable], dtype=complex)
        start = Modes(poles, participations(poles, lines)).scaled()
    state = _without_needless(Selection(start, tuple(stable), (), lines), thorough=False)
    state = _refined(state, reweigh)
    state, pending = _added(state, pending, reweigh, n_modes)
    for _ in range(SETTINGS.residual_searches):
        before = len(state.modes.poles)
        if n_modes is not None and state.n_inside >= n_modes:
            break
        hidden = search_residual(state.modes, state.lines, eliminate(state.modes, state.lines))
        state, pending = _added(state, (*hidden, *pending), reweigh, n_modes)
        if len(state.modes.poles) == before:
            break
    return _without_needless(state, thorough=True)


def _added(
    state: Selection, pending: Sequence[Candidate], reweigh: Reweigh, n_modes: int | None
) -> tuple[Selection, Sequence[Candidate]]:
    """Add candidates until a round adds none; return the selection and the candidates that remain."""
    for _ in range(SETTINGS.selection_rounds):
        state, pending, added = _one_round(state, pending, n_modes)
        if not added:
            break
        state = _refined(state, reweigh)
    return state, pending


def _refined(state: Selection, reweigh: Reweigh) -> Selection:
    refined = refine(state.modes, state.lines, SETTINGS.selection_effort)
    return replace(state, modes=refined.modes, lines=reweigh(state.lines, refined.elimination))


def _separate(stable: Sequence[Candidate]) -> list[Candidate]:
    """Drop candidates very close to a more stable one, or within its half-power band with a similar participation."""
    separate: list[Candidate] = []
    for candidate in stable:
        if not any(_same_mode(candidate, other) for other in separate):
            separate.append(candidate)
    return separate


def _same_mode(first: Candidate, second: Candidate) -> bool:
    distance, width = abs(first.pole - second.pole), abs(first.pole.real) + abs(second.pole.real)
    assurance = modal_assurance(first.participation[None], second.participation[None])[0, 0]
    return bool(distance < 0.5 * width or (distance < width and assurance > SETTINGS.same_participation))


def _one_round(
    state: Selection, pending: Sequence[Candidate], n_modes: int | None
) -> tuple[Selection, tuple[Candidate, ...], bool]:
    """Try each pending candidate once.

    Returns the selection, the candidates to try again later, and whether a mode was added.
    """
    later: list[Candidate] = []
    rejected: list[tuple[Candidate, str]] = []
    added = False
    elimination = eliminate(state.modes, state.lines)
    for candidate in pending:
        if n_modes is not None and state.n_inside >= n_modes:
            rejected.append((candidate, f"not among the {n_modes} asked for"))
            continue
        if _is_known(candidate, state.modes):
            continue
        result = try_candidate(candidate, state.modes, elimination, state.lines)
        if result.reason:
            later.append(candidate)  # it may be needed once other modes are there
            rejected.append((candidate, result.reason))
            continue
        modes = state.modes.chosen(~result.near).joined(result.modes)
        order = np.concatenate([np.flatnonzero(~result.near), np.flatnonzero(result.near)])
        accepted = (*(state.accepted[number] for number in order), candidate)
        state, added = replace(state, modes=modes, accepted=accepted), True
        elimination = eliminate(modes, state.lines)
    return replace(state, rejected=(*state.rejected, *rejected)), tuple(later), added


def _is_known(candidate: Candidate, modes: Modes) -> bool:
    """Return whether one of the modes has the pole of the candidate already."""
    distance = np.abs(np.log(modes.poles / candidate.pole))
    return bool(distance.min(initial=np.inf) < 0.1 * candidate.damping_ratio)


def _without_needless(state: Selection, *, thorough: bool) -> Selection:
    """Test each mode against a fit without it, the least stable mode first, and remove those that are not needed."""
    order = np.argsort([candidate.order_share for candidate in state.accepted], kind="stable")
    for candidate in [state.accepted[number] for number in order]:
        number = next(n for n, accepted in enumerate(state.accepted) if accepted is candidate)
        is_other = np.arange(len(state.modes.poles)) != number
        others = state.modes.chosen(is_other)
        reordered = others.joined(state.modes.chosen(~is_other))
        elimination = eliminate(reordered, state.lines)
        if state.lines.has_covariance and not thorough:
            reason = reject_early(candidate, reordered, elimination, state.lines)
        else:
            reason = reject_again(candidate, reordered, elimination, state.lines, thorough=thorough)
        reason = reason or _moved_away(candidate, complex(reordered.poles[-1]), state.lines)
        if reason:
            if thorough:
                others = refine(others, state.lines, SETTINGS.selection_effort).modes
            accepted = tuple(other for other in state.accepted if other is not candidate)
            state = replace(state, modes=others, accepted=accepted, rejected=(*state.rejected, (candidate, reason)))
    return state


def _moved_away(start: Candidate, pole: complex, lines: MeasuredLines) -> str:
    """Return a reason where a mode moved far from its start or out of the band, else an empty text.

    A mode that moved just outside the band stays: it represents a mode there, as an out-of-band term.

    One that moved just outside represents a mode there, and stays as an out-of-band term.
    """
    frequency, size = abs(pole) / (2 * np.pi), abs(pole)
    low, high = lines.band
    damping = max(start.damping_ratio, -pole.real / size, 0.0025)
    if just_outside(pole, lines.band):
        return ""
    if low < frequency < high and abs(pole - start.pole) <= min(4 * damping, 0.3) * abs(start.pole):
        return ""
    return f"refinement drives it to {frequency:.4g} Hz"


def hidden_candidates(modes: Modes, lines: MeasuredLines, elimination: Elimination) -> Iterator[Candidate]:
    """Yield poles to try: on both sides of modes with correlated residuals, and where the residual is largest."""
    power = elimination.power(lines)
    if power.sum() < SETTINGS.rounding_share * np.sum(np.abs(lines.values) ** 2):
        return
    for pole in modes.poles:
        near = half_power_lines(complex(pole), lines)
        if not near.any() or power[near].sum() < SETTINGS.search_misfit * lines.noise[near].sum():
            continue
        # beyond three standard errors of a correlation of this many values
        significant = max(SETTINGS.hidden_correlation, 3 / np.sqrt(near.sum() * lines.values[0].size))
        if elimination.autocorrelation(lines, near) > significant:
            for shift in (-1.0, 1.0):  # half bandwidths
                yield _candidate(complex(pole) + 1j * shift * abs(pole.real), modes)
    if len(modes.poles):
        damping = float(np.median(modes.damping_ratios))
        for frequency in _peaks(lines, power):
            omega = 2 * np.pi * frequency
            yield _candidate(omega * complex(-damping, np.sqrt(1 - damping**2)), modes)


def _candidate(pole: complex, modes: Modes) -> Candidate:
    return Candidate(pole, SETTINGS.hidden_order_share, 0, np.ones(modes.left.shape[1], dtype=complex))


def _peaks(lines: MeasuredLines, power: Real) -> list[float]:
    """Return the frequencies (Hz) of the three largest maxima of the residual's power, smoothed over five lines."""
    if len(power) <= 10:
        return []
    window = np.ones(5) / 5
    level = np.convolve(power / np.median(power), window, "same")
    top = np.flatnonzero((level[1:-1] > level[:-2]) & (level[1:-1] >= level[2:])) + 1
    expected = np.convolve(lines.noise / np.median(power), window, "same")
    top = top[level[top] > 2 * SETTINGS.search_misfit * expected[top]]
    order = top[np.argsort(-level[top])][:3]
    return [float(lines.frequencies[line]) for line in order]


def off_columns(modes: Modes, selection: Selection) -> Iterator[str]:
    """Yield a sentence for each mode in the band that is further than a half bandwidth from every stable column."""
    columns = [c for c in _considered(selection) if c.n_orders > 0]
    for pole in modes.poles[modes.inside(selection.lines.band)]:
        if not any(_belong_together(complex(pole), column) for column in columns):
            yield f"the mode at {_named(complex(pole))} stands on no stable column of the chart; check it with --pick"


def peaks_without_mode(modes: Modes, selection: Selection) -> Iterator[str]:
    """Yield a sentence for each steady column at a peak of the response that is not a mode, the steadiest first."""
    reasons = {candidate.pole: reason for candidate, reason in selection.rejected}
    reported: list[Candidate] = []
    axis = selection.lines.frequencies
    spacing = selection.lines.spacing  # nothing narrower can be seen
    for column in sorted(_considered(selection), key=lambda candidate: -candidate.order_share):
        width = column.damping_ratio * column.frequency
        if column.order_share < SETTINGS.steady_candidate or column.pole not in reasons or width < spacing:
            continue
        if any(_belong_together(complex(pole), column) for pole in modes.poles) or any(
            abs(other.frequency - column.frequency) < width for other in reported
        ):
            continue
        others = np.abs(axis[:, None] - modes.frequencies).min(axis=1)
        if peak_rise(column.pole, np.abs(axis - column.frequency) < others, selection.lines) > 1:
            reported.append(column)
            share = f"{100 * column.order_share:.0f} % of the orders"
            yield f"no mode at {_named(column.pole)}, a peak and a stable column ({share}): {reasons[column.pole]}"


def _considered(selection: Selection) -> list[Candidate]:
    return [*selection.accepted, *(candidate for candidate, _ in selection.rejected)]


def _belong_together(pole: complex, column: Candidate) -> bool:
    return abs(pole - column.pole) <= abs(column.pole.real)


def _named(pole: complex) -> str:
    return f"{abs(pole) / (2 * np.pi):.4g} Hz ({-100 * pole.real / abs(pole):.2g} %)"
