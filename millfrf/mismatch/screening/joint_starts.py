"""Where the fit of a joint's law begins: driven by the motion seen, then free, at one place or another, on either sign.

A mode's own resonance shifts with the square of its part in the joint's deflection. The sign of a part shows only in
what two modes do together, so that each choice of signs is a valley of its own, and no fit leads from one to another.
"""

from dataclasses import replace

import numpy as np

from estimation import WindowedSpectrum

from ..joints.joint_axis import JointAxis
from ..joints.joint_reach import inside_of
from ..models.fitting import Fit, Rival, fit
from ..models.hypothesis import Hypothesis
from ..physics.protocol import JointPhysics
from .score_tests import Screened, screen_joints
from .whitened_residual import linear_floor

FEW = 1000
"""Lines of a recording on which shapes of a law are compared."""

FREE_STEPS, FREE_TOLERANCE, OF_ALL = 10, 10.0, 1e-4
"""Steps at most of a law that is simulated freely, and gain of a step that counts: at least, and as a share of what
the law gains. The law that is accepted is fitted to the end."""

MOST_OUT_OF_PHASE = 0.5
"""Share of the parts of modes in a joint that may be out of phase (:attr:`JointAxis.out_of_phase`). A damper between
ground and one of three masses, which damps their modes by 7 to 11 %, makes 0.17 to 0.4 of it
(`tests/mismatch/test_phased_parts.py`); a spring that stands for friction 1."""

MOST_COMMON_LEAD = 0.2
"""Largest phase that all modes share in a joint, rad. That damper makes 0.05 to 0.15, a spring for friction 0.77."""

SMALLEST_PART = 0.05
"""Part of a mode, over all parts, below which its sign matters little."""

TURN_STEPS, TURNED_STEPS = 4, 20
"""Steps at most of the fit of each turned sign, and of the one that is taken."""


def driven_by_what_was_seen(lines: list[WindowedSpectrum], current: Fit, screened: Screened) -> Fit:
    """A law fitted to the motion seen, from the better of its two best shapes.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    current
        The fit without the law.
    screened
        The law in its shapes, as they were screened.
    """
    rough = [one.thinned(FEW) for one in lines]
    starts = [
        fit(rough, current.hypothesis.with_cause(cause), current.noises, iterations=2) for cause in screened.causes[:2]
    ]
    best = min(starts, key=lambda start: start.score)
    if not np.isfinite(best.score):
        return best
    return fit(lines, best.hypothesis, best.noises, iterations=4)


def gain_that_counts(gained: float) -> float:
    """Gain of a step, in score, from which a law that is tried is fitted on.

    Examples
    --------
    >>> gain_that_counts(1000.0), gain_that_counts(500_000.0)
    (10.0, 50.0)
    """
    return max(FREE_TOLERANCE, OF_ALL * gained)


def freed(lines: list[WindowedSpectrum], driven: Fit, gained: float) -> Fit:
    """The last law of a fit, some steps on, free to move as it makes the structure move.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    driven
        A fit whose last law is driven by the motion that was seen.
    gained
        What the law gains there in score.
    """
    causes = driven.hypothesis.causes
    free = replace(driven.hypothesis, causes=(*causes[:-1], replace(causes[-1], seen=None)))
    return fit(lines, free, driven.noises, iterations=FREE_STEPS, tolerance=gain_that_counts(gained))


def begun_at(lines: list[WindowedSpectrum], current: Fit, law: JointPhysics, axis: JointAxis) -> Fit | None:
    """A law begun along another axis, and some steps on; None where nothing there speaks for it.

    A fit turns the axis, but not from one valley into another: where a joint sits is tried by beginning there.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    current
        The fit without the law.
    law
        The law, from the library.
    axis
        Where the joint is begun.
    """
    screened = screen_joints(linear_floor(current, lines), current.hypothesis, axis, [law])
    if not screened:
        return None
    driven = driven_by_what_was_seen(lines, current, screened[0])
    return freed(lines, driven, current.score - driven.score) if np.isfinite(driven.score) else None


def with_turned_signs(lines: list[WindowedSpectrum], fitted: Fit, least: float) -> Fit:
    """The fit, or a better one in which the signs of some modes' parts in the last law's joint are turned.

    One sign after the other is turned while that gains: the best of all single turns goes on.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    fitted
        A fit whose last cause is a joint's law; one at the tip, along a direction, is given back as it is.
    least
        Gain in score that counts.
    """
    axis = fitted.hypothesis.causes[-1].axis
    while axis is not None and axis.scales is not None and len(axis.entries) > 1:
        modes = len(fitted.hypothesis.model.poles)
        large = np.flatnonzero(abs(axis.parts(modes)) > SMALLEST_PART)
        turned = [_along(fitted.hypothesis, axis.turned_over(int(mode), modes)) for mode in large]
        begun = min((fit(lines, one, iterations=TURN_STEPS) for one in turned), key=lambda one: one.score)
        if not np.isfinite(begun.score):
            break
        rival = Rival(fitted, -least)
        better = fit(lines, begun.hypothesis, begun.noises, iterations=TURNED_STEPS, tolerance=10.0, rival=rival)
        if not better.score < fitted.score - least:
            break
        fitted, axis = better, better.hypothesis.causes[-1].axis
    return fitted


def with_phases(lines: list[WindowedSpectrum], fitted: Fit, least: float, gained: float = 0.0) -> Fit:
    """The fit, or a better one in which the modes' parts in the last law's joint have phases of their own.

    In a structure with real mode shapes all points of a mode move in phase, and its part in a joint is a real number.
    Where damping is not proportional to stiffness and mass, a joint between them leads or lags.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    fitted
        A fit whose last cause is a joint's law; one at the tip, or with phases, is given back as it is.
    least
        Gain in score that counts, which pays for a number more for each mode already.
    gained
        What the law has gained in score.
    """
    axis = fitted.hypothesis.causes[-1].axis
    if axis is None or axis.scales is None or not np.isfinite(fitted.score):
        return fitted
    if len(axis.entries) > len(fitted.hypothesis.model.poles):
        return fitted
    start = _along(fitted.hypothesis, axis.with_phases())
    phased = _followed(lines, start, fitted, least, gained)
    return phased if phased.score < fitted.score - least and _in_phase(phased) else fitted


def moved_inside(lines: list[WindowedSpectrum], fitted: Fit, least: float, gained: float = 0.0) -> Fit:
    """The fit, or a better one in which the last law's joint at the tip sits inside, where it moves nearly alike.

    A direction at the tip stands for a joint between links as well as two or three numbers can: what each mode does in
    the joint is then that of the tip. Inside, each mode has a part and a phase of its own.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    fitted
        A fit whose last cause is a joint's law; one that sits inside is given back as it is.
    least
        Gain in score that counts.
    gained
        What the law has gained in score.
    """
    axis = fitted.hypothesis.causes[-1].axis
    if axis is None or axis.scales is not None or not np.isfinite(fitted.score):
        return fitted
    start = _along(fitted.hypothesis, inside_of(fitted.hypothesis.model, axis))
    inside = _followed(lines, start, fitted, least, gained)
    return inside if inside.score < fitted.score - least and _in_phase(inside) else fitted


def _followed(lines: list[WindowedSpectrum], start: Hypothesis, fitted: Fit, least: float, gained: float) -> Fit:
    """A fit from another start, as long as it may gain what counts."""
    tolerance = gain_that_counts(gained)
    return fit(lines, start, fitted.noises, iterations=FREE_STEPS, tolerance=tolerance, rival=Rival(fitted, -least))


def _in_phase(fitted: Fit) -> bool:
    """Whether the last law's joint has phases that a structure can have."""
    axis = fitted.hypothesis.causes[-1].axis
    return axis is None or not phases_too_large(axis)


def phases_too_large(axis: JointAxis) -> str:
    """Why no structure has such phases of its modes in a joint; empty where one may.

    Parameters
    ----------
    axis
        Where a joint gives way.
    """
    if abs(axis.common_lead) > MOST_COMMON_LEAD:
        return f"its joint would have to lead in all modes by {np.degrees(abs(axis.common_lead)):.0f} degrees"
    if axis.out_of_phase > MOST_OUT_OF_PHASE:
        return f"{100 * axis.out_of_phase:.0f} % of its joint's motion would have to be out of phase"
    return ""


def _along(hypothesis: Hypothesis, axis: JointAxis) -> Hypothesis:
    """The hypothesis with the last law's joint along another axis."""
    return replace(hypothesis, causes=(*hypothesis.causes[:-1], replace(hypothesis.causes[-1], axis=axis)))
