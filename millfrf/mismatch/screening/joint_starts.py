"""Starts of the fit of a joint law, and laws fitted at the place of an accepted law.

The resonance of a mode shifts with the square of its participation in the deflection of the joint. The sign of a
participation affects only the interaction of two modes. Each choice of signs is therefore a separate local minimum, and
a fit does not change the signs.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from estimation import WindowedSpectrum

from ..inference.search import Proposal, in_processes
from ..inference.settings import Settings
from ..joints.joint_axis import JointAxis, axis_over_modes
from ..models.fitting import Fit, Rival, at_nominal_modes, fit, fit_of_beginning
from ..models.hypothesis import Hypothesis
from ..physics.protocol import JointPhysics, LimitedPhysics, Physics, TwinPhysics, reported_name
from .score_tests import Screened, screen_joints
from .whitened_residual import linear_floor

ROUGH_LINES = 1000  # lines of a recording on which shapes of a law are compared

# most steps of a fit with free simulation, and significant gain of a step, as a number and as a share of the gain of
# the law; an accepted law is later fitted to convergence
FREE_STEPS, FREE_TOLERANCE, TOLERANCE_SHARE = 10, 10.0, 1e-4

# Largest share of the participations that may be out of phase (:attr:`JointAxis.out_of_phase`). The share is 0.17 to
# 0.4 for a damper between ground and one of three masses that damps their modes by 7 to 11 %
# (`tests/mismatch/test_phased_parts.py`), and 1 for a spring that imitates friction
MAX_OUT_OF_PHASE = 0.5

# Largest common phase of the participations (:attr:`JointAxis.common_phase`), rad. It is 0.05 to 0.15 for this damper,
# and 0.77 for a spring that imitates friction
MAX_COMMON_PHASE = 0.2

MIN_PARTICIPATION = 0.05  # participation of a mode below which its sign hardly matters

FLIP_STEPS, FLIPPED_STEPS = 4, 20  # most steps of the fit with each flipped sign, and of the best of these fits


def fit_on_estimated_motion(lines: list[WindowedSpectrum], current: Fit, screened: Screened) -> Fit:
    """Fit a law to the estimated motion, starting from the better of its two most promising shapes."""
    rough = [recording.thinned(ROUGH_LINES) for recording in lines]
    starts = [
        fit(rough, current.hypothesis.with_cause(cause), current.noises, iterations=2) for cause in screened.causes[:2]
    ]
    best = min(starts, key=lambda start: start.score)
    if not np.isfinite(best.score):
        return best
    return fit(lines, best.hypothesis, best.noises, iterations=4)


def significant_step_gain(gained: float) -> float:
    """Return the least significant gain in score of one step of the fit of a law that has gained ``gained``."""
    return max(FREE_TOLERANCE, TOLERANCE_SHARE * gained)


def with_free_simulation(lines: list[WindowedSpectrum], driven: Fit, gained: float, least: float = np.inf) -> Fit:
    """Fit the last law of a fit some steps further, with free simulation.

    If the result is worse than the fit to the estimated motion, the fit is tried again from the beginning of the
    recordings onwards. It replaces the first one if its score is lower by more than ``least``; if that is
    infinite, it is not tried.
    """
    causes = driven.hypothesis.causes
    free = replace(driven.hypothesis, causes=(*causes[:-1], replace(causes[-1], seen=None)))
    refit = partial(fit, lines, iterations=FREE_STEPS, tolerance=significant_step_gain(gained))
    fitted = refit(free, driven.noises)
    if fitted.score <= driven.score or not np.isfinite(least):
        return fitted
    start = fit_of_beginning(lines, free, driven.noises, iterations=FREE_STEPS)
    if not np.isfinite(start.score):
        return fitted
    again = refit(start.hypothesis, start.noises)
    return again if again.score < fitted.score - least else fitted


def started_at(lines: list[WindowedSpectrum], current: Fit, law: JointPhysics, axis: JointAxis) -> Fit | None:
    """Start a law along a given axis and fit it some steps; return None if the residual does not support the law there.

    A fit rotates the axis but does not leave a local minimum, so that each place of the joint needs a separate start.
    """
    screened = screen_joints(linear_floor(current, lines), current.hypothesis, axis, [law])
    if not screened:
        return None
    driven = fit_on_estimated_motion(lines, current, screened[0])
    return with_free_simulation(lines, driven, current.score - driven.score) if np.isfinite(driven.score) else None


def with_flipped_signs(lines: list[WindowedSpectrum], fitted: Fit, least: float) -> Fit:
    """Return the fit, or a better fit in which some participations in the last joint have the opposite sign.

    In each round, every single sign is flipped for trial, and the best flip is kept. The rounds end without a gain.
    """
    axis = fitted.hypothesis.causes[-1].axis
    while axis is not None and axis.scales is not None and len(axis.entries) > 1:
        modes = len(fitted.hypothesis.model.poles)
        large = np.flatnonzero(abs(axis.participations(modes)) > MIN_PARTICIPATION)
        flipped = [_along(fitted.hypothesis, axis.with_flipped_sign(int(mode), modes)) for mode in large]
        start = min(
            (fit(lines, hypothesis, iterations=FLIP_STEPS) for hypothesis in flipped), key=lambda fitted: fitted.score
        )
        if not np.isfinite(start.score):
            break
        rival = Rival(fitted, -least)
        better = fit(lines, start.hypothesis, start.noises, iterations=FLIPPED_STEPS, tolerance=10.0, rival=rival)
        if not better.score < fitted.score - least:
            break
        fitted, axis = better, better.hypothesis.causes[-1].axis
    return fitted


def with_phases(lines: list[WindowedSpectrum], fitted: Fit, least: float, gained: float = 0.0) -> Fit:
    """Return the fit, or a better fit in which each participation in the last joint has a phase.

    In a structure with real mode shapes all points of a mode move in phase, and participations are real. If damping is
    not proportional to stiffness and mass, the deflection of a joint may lead or lag.
    """
    axis = fitted.hypothesis.causes[-1].axis
    if axis is None or axis.scales is None or not np.isfinite(fitted.score):
        return fitted
    if len(axis.entries) > len(fitted.hypothesis.model.poles):
        return fitted
    start = _along(fitted.hypothesis, axis.with_phases())
    phased = _fit_from(lines, start, fitted, least, gained)
    return phased if phased.score < fitted.score - least and _in_phase(phased) else fitted


def moved_away_from_tip(lines: list[WindowedSpectrum], fitted: Fit, least: float, gained: float = 0.0) -> Fit:
    """Return the fit, or a better fit in which the last joint is moved from the tip to a place away from it.

    A joint at the tip has two or three numbers: each mode moves the joint as it moves the tip. A joint away from the
    tip has one participation and one phase for each mode.
    """
    axis = fitted.hypothesis.causes[-1].axis
    if axis is None or axis.scales is not None or not np.isfinite(fitted.score):
        return fitted
    start = _along(fitted.hypothesis, axis_over_modes(fitted.hypothesis.model, axis))
    moved = _fit_from(lines, start, fitted, least, gained)
    return moved if moved.score < fitted.score - least and _in_phase(moved) else fitted


def _fit_from(lines: list[WindowedSpectrum], start: Hypothesis, fitted: Fit, least: float, gained: float) -> Fit:
    """Fit from ``start``; stop early if no score significantly below that of ``fitted`` can be reached."""
    tolerance = significant_step_gain(gained)
    return fit(lines, start, fitted.noises, iterations=FREE_STEPS, tolerance=tolerance, rival=Rival(fitted, -least))


def _in_phase(fitted: Fit) -> bool:
    """Return whether the phases of the last joint are possible in a structure."""
    axis = fitted.hypothesis.causes[-1].axis
    return axis is None or not phases_too_large(axis)


def phases_too_large(axis: JointAxis) -> str:
    """Return why the phases of the participations are impossible in a structure; an empty text if they are possible."""
    if abs(axis.common_phase) > MAX_COMMON_PHASE:
        return f"its joint would have to lead in all modes by {np.degrees(abs(axis.common_phase)):.0f} degrees"
    if axis.out_of_phase > MAX_OUT_OF_PHASE:
        return f"{100 * axis.out_of_phase:.0f} % of its joint's motion would have to be out of phase"
    return ""


def _along(hypothesis: Hypothesis, axis: JointAxis) -> Hypothesis:
    """Return the hypothesis with the last joint along another axis."""
    return replace(hypothesis, causes=(*hypothesis.causes[:-1], replace(hypothesis.causes[-1], axis=axis)))


STEPS = 60  # most steps of the fit of a twin, which starts from the nominal modes


def twin_laws(
    lines: list[WindowedSpectrum], current: Fit, proposals: Sequence[Proposal[Fit]], causes: Mapping[str, Physics]
) -> list[Proposal[Fit]]:
    """Fit the twin of each proposed law, unless it was fitted, from the numbers of the law and the nominal modes."""
    known = {proposal.fitted.hypothesis.causes[-1].physics.name for proposal in proposals}
    tasks = []
    for proposal in proposals:
        physics = proposal.fitted.hypothesis.causes[-1].physics
        other = causes.get(physics.twin) if isinstance(physics, TwinPhysics) else None
        if isinstance(other, JointPhysics) and other.name not in known:
            tasks.append(partial(_twin_of, lines, current, proposal, other))
            known.add(other.name)
    return [result for result in in_processes(tasks) if np.isfinite(result.fitted.score)]


def _twin_of(
    lines: list[WindowedSpectrum], current: Fit, proposal: Proposal[Fit], physics: JointPhysics
) -> Proposal[Fit]:
    """Fit the twin with the same numbers, from the nominal modes."""
    hypothesis = at_nominal_modes(proposal.fitted.hypothesis)
    last = replace(hypothesis.causes[-1], physics=physics)
    fitted = fit(lines, replace(hypothesis, causes=(*hypothesis.causes[:-1], last)), iterations=STEPS)
    return Proposal(reported_name(physics), proposal.location, fitted, current.score - fitted.score)


def laws_beyond(
    lines: list[WindowedSpectrum], current: Fit, best: Proposal[Fit], laws: Sequence[JointPhysics], settings: Settings
) -> list[Proposal[Fit]]:
    """Fit the laws beyond the limit at which the numbers of the best law end, at the same place.

    For instance, hysteresis whose elements yield immediately is dry friction: the fit of hysteresis ends at the limit
    and cannot cross it.
    """
    last = best.fitted.hypothesis.causes[-1]
    if last.motion is None or not isinstance(last.physics, LimitedPhysics):
        return []
    if not last.physics.beyond_limits(last.values, last.motion):
        return []
    beyond = [law for law in laws if reported_name(law) == last.physics.beyond]
    return laws_in_place(lines, current, best, beyond, settings)


def laws_in_place(
    lines: list[WindowedSpectrum], current: Fit, best: Proposal[Fit], laws: Sequence[JointPhysics], settings: Settings
) -> list[Proposal[Fit]]:
    """Fit further laws at the place of an accepted law, each started from its screened shapes."""
    axis = best.fitted.hypothesis.causes[-1].axis
    if axis is None:
        return []
    fits = in_processes([partial(_started_there, lines, current, law, axis, settings) for law in laws])
    return [
        Proposal(reported_name(law), best.location, fitted, current.score - fitted.score)
        for law, fitted in zip(laws, fits, strict=True)
        if fitted is not None and np.isfinite(fitted.score)
    ]


def _started_there(
    lines: list[WindowedSpectrum], current: Fit, law: JointPhysics, axis: JointAxis, settings: Settings
) -> Fit | None:
    """Fit a law along a given axis, with phases of the participations if these gain."""
    fitted = started_at(lines, current, law, axis)
    return None if fitted is None else with_phases(lines, fitted, settings.evidence.least, current.score - fitted.score)
