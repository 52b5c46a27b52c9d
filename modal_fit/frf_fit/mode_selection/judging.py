"""Whether the data need a candidate: its trial fit in the neighbourhood, and the reasons to refuse it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..variable_projection.elimination import Elimination, Modes, Real, eliminate
from ..variable_projection.neighbourhood import (
    around,
    half_power_lines,
    mode_power,
    outside_power,
    participation,
    without_modes,
)
from ..variable_projection.refinement import refine
from ..variable_projection.whitened_lines import MeasuredLines
from .needed import CLEAN, NEAR, NEEDED, Trial, as_good_without, copy_of_near_mode, most_missed, unneeded
from .steady_poles import Candidate

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
