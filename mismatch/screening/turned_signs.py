"""A joint between places that nobody knows: the sign with which each mode takes part is tried both ways.

A mode's own resonance shifts with the square of its part in the joint's deflection. The sign of a part shows only in
what two modes do together, so that each choice of signs is a valley of its own, and no fit leads from one to another.
"""

from dataclasses import replace

import numpy as np

from estimation import WindowedSpectrum

from ..joints import JointAxis
from ..models import Fit, Hypothesis, fit

SMALLEST_PART = 0.05
"""Part of a mode, over all parts, below which its sign matters little."""

FEW_STEPS, MORE_STEPS = 4, 20
"""Steps at most of the fit of each turned sign, and of the one that is taken."""


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
        turned = [
            _turned(fitted.hypothesis, axis, int(mode)) for mode in np.flatnonzero(abs(axis.entries) > SMALLEST_PART)
        ]
        begun = min((fit(lines, one, iterations=FEW_STEPS) for one in turned), key=lambda one: one.score)
        if not np.isfinite(begun.score):
            break
        better = fit(lines, begun.hypothesis, begun.noises, iterations=MORE_STEPS, tolerance=10.0)
        if not better.score < fitted.score - least:
            break
        fitted, axis = better, better.hypothesis.causes[-1].axis
    return fitted


def _turned(hypothesis: Hypothesis, axis: JointAxis, mode: int) -> Hypothesis:
    """The hypothesis in which one mode takes part in the last law's joint with the other sign."""
    entries = axis.entries.copy()
    entries[mode] *= -1
    last = replace(hypothesis.causes[-1], axis=replace(axis, entries=entries))
    return replace(hypothesis, causes=(*hypothesis.causes[:-1], last))
