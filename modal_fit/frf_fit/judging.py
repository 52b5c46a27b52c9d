"""Statistical need for a candidate mode: its trial fit, and the reasons to reject it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Real

from ..shapes import modal_assurance
from .elimination import (
    Elimination,
    Modes,
    around,
    eliminate,
    half_power_lines,
    mode_power,
    outside_power,
    participation,
    without_modes,
)
from .measured_lines import MeasuredLines
from .refinement import refine
from .steady_poles import Candidate

CLEAN = 2.0  # misfit over the noise expected up to which noise alone decides
_WHITE = 0.35  # correlation of neighbouring lines' errors up to which they are noise, whatever its level
_RESOLVED = 3.0  # lines in half a bandwidth from which on errors of a model are smooth over the lines
_REACH = 4.0  # sums of half bandwidths
_COLOUR_LINES = 12  # to each side, that the correlation is taken over
NEEDED = 0.2  # misfit over the modes' own size that a missing mode leaves, where more than noise is left
_PLAIN = 0.6  # the same, where a candidate is taken although few orders have it
_STEADY = 0.5  # share of the orders that a candidate needs where more than noise is left
_GAIN = 1.5  # factor by which the misfit around the pole must fall there
_PLAINLY = 300.0  # the same, from which errors of the other modes cannot be what the candidate explains
_ALIKE = 0.6  # product of both vectors' modal assurance from which two near modes are one
NEAR = 3.0  # sums of half bandwidths within which two modes may be one
_ROUNDING = 1e-14  # share of the power below which a misfit is rounding


@dataclass(frozen=True)
class Trial:
    """Neighbourhood without and with a mode.

    Parameters
    ----------
    lines
        Lines of the neighbourhood, from which the far modes are subtracted.
    before, after
        Fits without and with the mode.
    modes
        The near modes; the mode in question stands last.
    far_power : (n_lines,)
        Power of the far modes on each line.
    """

    lines: MeasuredLines
    before: Elimination
    after: Elimination
    modes: Modes
    far_power: Real


def unneeded(candidate: Candidate, trial: Trial) -> str:
    """Why the data do not need the candidate; empty where they do."""
    if reason := as_good_without(trial):
        return reason
    share, gain, clean = most_missed(trial)
    if clean or gain > _PLAINLY:
        return ""
    if share < NEEDED:
        return f"it explains {100 * share:.0f} % of its neighbourhood, as errors of the other modes would"
    if candidate.share < _STEADY and share < _PLAIN:
        return f"found in only {100 * candidate.share:.0f} % of the orders, and the misfit is more than noise"
    if gain < _GAIN:
        return f"the misfit around it falls by a factor of {gain:.1f} only, and stays more than noise"
    return copy_of_near_mode(trial)


def as_good_without(trial: Trial) -> str:
    """Schwarz's criterion on the neighbourhood; a reason where the gain is within the penalty, else empty."""
    n_unknowns = 2 * (trial.lines.values.shape[2] + trial.lines.drive.shape[2])
    lines = trial.lines
    exact = _ROUNDING * float(np.mean(np.abs(lines.values) ** 2))
    variance = max(trial.after.cost / lines.n_values, _variance_at_mode(trial), exact)
    if lines.stated:
        variance = max(variance, float(lines.noise.sum()) / lines.n_values)
    memory = max(trial.after.colour(lines, np.ones(len(lines.s), dtype=bool)), 0.0)  # fewer independent values
    penalty = n_unknowns * float(np.log(lines.n_values)) * max(1 + 2 * memory, lines.correlation)
    return "the fit is as good without it" if trial.before.cost - trial.after.cost < penalty * variance else ""


def copy_of_near_mode(trial: Trial) -> str:
    """A reason where the last mode has the vectors of a near one, else empty."""
    alike, other = likeness(trial.modes, trial.after.right, len(trial.modes.poles) - 1)
    if alike > _ALIKE:
        return f"a copy of the mode at {other:.4g} Hz (assurance {alike:.2f}), and the misfit is more than noise"
    return ""


def _variance_at_mode(trial: Trial) -> float:
    """Mean squared misfit of a real value on the lines that the last mode lives from.

    Noise may go with the level of the FRF, as that of few averages does. A mode must then outdo the noise at its
    own resonance, and not the mean over the neighbourhood.
    """
    own = mode_power(trial.modes, trial.after.right, trial.lines)[:, -1]
    per_line = trial.lines.n_values / len(own)
    return float(own @ trial.after.power(trial.lines) / max(own.sum(), 1e-300)) / per_line


def most_missed(trial: Trial) -> tuple[float, float, bool]:
    """Give the near mode whose half-power band misses the candidate most.

    When two modes stand close, the fit without the candidate may sit on either.

    Returns
    -------
    share
        Misfit without the candidate over the size of all modes there.
    gain
        Factor by which the misfit falls.
    clean
        Whether what is left is noise.
    """
    modes, lines = trial.modes, trial.lines
    size = mode_power(modes, trial.after.right, lines).sum(axis=1) + outside_power(trial.after, lines)
    size = size + trial.far_power
    before, after = trial.before.power(lines), trial.after.power(lines)
    own = half_power_lines(complex(modes.poles[-1]), lines)
    best = (0.0, 1.0)
    for number in np.flatnonzero(_within_reach(modes, 4 * lines.spacing)):
        here = half_power_lines(complex(modes.poles[number]), lines)
        if here.any():
            share = float(np.sqrt(before[here].sum() / max(size[here].sum(), 1e-300)))
            best = max(best, (share, float(before[here].sum() / max(after[here].sum(), 1e-300))))
    return *best, _clean(trial, own, after)


def _within_reach(modes: Modes, least: float = 0.0) -> NDArray[np.bool_]:
    """Say which modes stand so near to the last one that their errors touch it; it counts too."""
    width = modes.frequencies * modes.damping_ratios
    distance = np.abs(modes.frequencies - modes.frequencies[-1])
    return np.asarray(distance <= np.maximum(_REACH * (width + width[-1]), least))


def _clean(trial: Trial, own: NDArray[np.bool_], after: Real) -> bool:
    """Whether what the fit with the candidate leaves is noise: of the level expected, or without memory."""
    lines = trial.lines
    where = own if own.any() else np.ones(len(after), dtype=bool)
    if after[where].sum() < CLEAN * lines.noise[where].sum():
        return True
    width = (trial.modes.frequencies * trial.modes.damping_ratios)[_within_reach(trial.modes)]
    if width.min() < _RESOLVED * lines.spacing:
        return False
    middle = float(np.mean(lines.frequencies[where]))
    reach = max(np.ptp(lines.frequencies[where]) / 2, _COLOUR_LINES * lines.spacing)
    return trial.after.colour(lines, np.abs(lines.frequencies - middle) <= reach) < _WHITE


def likeness(modes: Modes, right: NDArray[np.complex128], number: int) -> tuple[float, float]:
    """Largest product of both vectors' modal assurances with a near mode, and that mode's frequency (Hz)."""
    frequency, width = modes.frequencies, modes.frequencies * modes.damping_ratios
    near = np.abs(frequency - frequency[number]) < NEAR * (width + width[number])
    near[number] = False
    if not near.any():
        return 0.0, 0.0
    both = modal_assurance(right[[number]], right)[0] * modal_assurance(modes.left[[number]], modes.left)[0]
    most = int(np.argmax(np.where(near, both, -1.0)))
    return float(both[most]), float(frequency[most])


_TRIAL_STEPS, _TRIAL_TOLERANCE = 12, 1e-3
_DOUBTFUL = 0.4  # share of the orders below which a candidate is tried only where much is left
_MOST_OF_ALL = 2.0  # factor by which a mode that is left out may raise the misfit of the whole band
_OVERLAPPING = 1.0  # sums of half bandwidths
_NO_VIBRATION = 0.5  # damping ratio


@dataclass(frozen=True)
class Verdict:
    """Result of the trial of a candidate.

    Parameters
    ----------
    reason
        Reason why the candidate is no mode; empty where it is one.
    modes
        The modes of the neighbourhood with the candidate last, refined there.
    near : (n_modes,), bool
        Whether each of the modes so far was refined with it.
    """

    reason: str
    modes: Modes
    near: NDArray[np.bool_]


def judge(candidate: Candidate, modes: Modes, found: Elimination, lines: MeasuredLines) -> Verdict:
    """Fit the neighbourhood without and with a candidate and weigh the difference.

    Where the noise explains what the fit with the candidate leaves, Schwarz's criterion alone decides. Where more is
    left - shifts between set-ups, leakage, nonlinearity - errors have the shape of resonances, and a second mode
    beside a strong one always lowers the misfit. There a candidate must be one that the orders agree on, that takes
    away most of a misfit which no error of the other modes explains, and that is no copy of a near mode.

    Parameters
    ----------
    candidate
        Candidate whose pole is tried.
    modes, found
        Modes so far, and their elimination.
    lines
        All lines of the fit.
    """
    local, near, far_power = _neighbourhood(candidate, modes, found, lines)
    if candidate.share < _DOUBTFUL:
        at_first = eliminate(modes.chosen(near), local)
        if reason := _hopeless(candidate, modes.chosen(near), at_first, local, far_power):
            return Verdict(reason, modes, near)
    before = refine(modes.chosen(near), local, steps=_TRIAL_STEPS, tolerance=_TRIAL_TOLERANCE)
    left = participation(candidate.pole, local, before.elimination)
    start = before.modes.joined(Modes(np.array([candidate.pole]), left))
    after = refine(start, local, steps=_TRIAL_STEPS, tolerance=_TRIAL_TOLERANCE)
    trial = Trial(local, before.elimination, after.elimination, after.modes, far_power)
    return Verdict(_strayed(candidate, trial) or unneeded(candidate, trial), after.modes, near)


def judge_early(candidate: Candidate, modes: Modes, found: Elimination, lines: MeasuredLines) -> str:
    """Weigh the last of the modes that start together; the reason why it is not needed, or empty.

    For lines whose noise is known. Other modes may be missing yet, so that a misfit beyond the noise says nothing
    against this one: it stays unless the fit is as good without it, or unless it overlaps a mode that it is a copy of
    where more than noise is left.
    """
    pole = complex(modes.poles[-1])
    others = modes.chosen(np.arange(len(modes.poles) - 1))
    local, near, far_power = _neighbourhood(replace(candidate, pole=pole), others, found, lines)
    start = others.chosen(near).joined(modes.chosen(np.array([len(modes.poles) - 1])))
    trial = Trial(local, eliminate(others.chosen(near), local), eliminate(start, local), start, far_power)
    if not as_good_without(trial) and _alone(start, _OVERLAPPING):
        return ""
    before = refine(others.chosen(near), local, steps=_TRIAL_STEPS, tolerance=_TRIAL_TOLERANCE)
    after = refine(start, local, steps=_TRIAL_STEPS, tolerance=_TRIAL_TOLERANCE)
    trial = Trial(local, before.elimination, after.elimination, after.modes, far_power)
    if reason := as_good_without(trial):
        return reason
    return "" if _alone(start, _OVERLAPPING) or most_missed(trial)[2] else copy_of_near_mode(trial)


def judge_again(candidate: Candidate, modes: Modes, found: Elimination, lines: MeasuredLines, *, thorough: bool) -> str:
    """Weigh the last of the modes against the fit without it; give the reason why it is not needed, or empty.

    With poles held, leaving a mode out raises the misfit at least as much as with the others refined. That is enough
    for a mode that stands alone; else the others are refined with and without it. A mode that overlaps no other stays,
    too, where the misfit of the whole band doubles without it.

    Parameters
    ----------
    candidate
        Candidate that the mode started from.
    modes, found
        All modes, the one in question last, and their elimination.
    lines
        All lines of the fit.
    thorough
        Whether to refine the others too where the mode passes with poles held but does not stand alone.
    """
    pole = complex(modes.poles[-1])
    others = modes.chosen(np.arange(len(modes.poles) - 1))
    local, near, far_power = _neighbourhood(replace(candidate, pole=pole), others, found, lines)
    start = others.chosen(near).joined(modes.chosen(np.array([len(modes.poles) - 1])))
    held = Trial(local, eliminate(others.chosen(near), local), eliminate(start, local), start, far_power)
    if not unneeded(candidate, held) and (not thorough or _alone(start, 2 * NEAR)):
        return ""
    before = refine(others.chosen(near), local, steps=_TRIAL_STEPS, tolerance=_TRIAL_TOLERANCE)
    after = refine(start, local, steps=_TRIAL_STEPS, tolerance=_TRIAL_TOLERANCE)
    reason = unneeded(candidate, Trial(local, before.elimination, after.elimination, after.modes, far_power))
    if not reason or not _alone(start, _OVERLAPPING):
        return reason
    without = others.chosen(~near).joined(before.modes)
    return reason if eliminate(without, lines).cost < _MOST_OF_ALL * found.cost else ""


def _neighbourhood(
    candidate: Candidate, modes: Modes, found: Elimination, lines: MeasuredLines
) -> tuple[MeasuredLines, NDArray[np.bool_], Real]:
    """Lines around a candidate without the far modes, which modes are near, and the far modes' power there."""
    chosen = around(candidate.frequency, candidate.damping_ratio, lines)
    reach = np.ptp(lines.frequencies[chosen]) / 2
    near = np.abs(modes.frequencies - candidate.frequency) <= reach
    far, right = modes.chosen(~near), found.right[: len(modes.poles)][~near]
    local = without_modes(lines, far, right).part(chosen)
    return local, near, mode_power(far, right, lines).sum(axis=1)[chosen]


def _alone(modes: Modes, reach: float) -> bool:
    """Whether no other mode stands within ``reach`` sums of half bandwidths of the last one."""
    width = modes.frequencies * modes.damping_ratios
    apart = np.abs(modes.frequencies - modes.frequencies[-1])[:-1]
    return bool(np.all(apart > reach * (width[:-1] + width[-1])))


def _hopeless(candidate: Candidate, modes: Modes, found: Elimination, lines: MeasuredLines, far_power: Real) -> str:
    """Why a candidate need not be tried: too little is left where it stands; empty where it must be tried."""
    here = half_power_lines(candidate.pole, lines)
    left = found.power(lines)
    for pole in modes.poles:
        here |= half_power_lines(complex(pole), lines)
    if left[here].sum() < CLEAN * lines.noise[here].sum():
        return ""
    size = mode_power(modes, found.right, lines).sum(axis=1) + outside_power(found, lines) + far_power
    places = [half_power_lines(pole, lines) for pole in (candidate.pole, *modes.poles)]
    shares = [np.sqrt(left[here].sum() / max(size[here].sum(), 1e-300)) for here in places if here.any()]
    if not shares:  # all stand outside the lines
        return ""
    worst = float(max(shares))
    if worst < NEEDED:
        return f"only {100 * worst:.0f} % are left around it, as errors of the other modes would leave"
    return ""


def _strayed(candidate: Candidate, trial: Trial) -> str:
    """Why the refined pole is not the candidate any more; empty where it is."""
    pole = complex(trial.modes.poles[-1])
    frequency, damping = abs(pole) / (2 * np.pi), -pole.real / abs(pole)
    low, high = trial.lines.band
    if not low < frequency < high:
        return "refinement drives it out of the band"
    if damping > _NO_VIBRATION:
        return f"refinement makes it no vibration (damping ratio {damping:.2f})"
    reach = max(3 * abs(candidate.pole.real), 6 * np.pi * trial.lines.spacing)
    if abs(pole - candidate.pole) > reach:
        return f"refinement drives it from {candidate.frequency:.4g} to {frequency:.4g} Hz"
    return ""
