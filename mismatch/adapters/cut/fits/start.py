"""Where fits of a cut begin: the spindle's angle, and which tooth is which in each recording."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..physics import CutPhysics
from .fitting import ALL, CutFit, fit_cut
from .hypothesis import CutHypothesis
from .measured_cut import MeasuredCut

Real = NDArray[np.float64]

ANGLES = 40
"""Number of spindle angles that are tried in a pitch."""


def started(cut: MeasuredCut, acting: Sequence[tuple[CutPhysics, Real]]) -> CutHypothesis:
    """The spindle's angle at which the force, computed as the file says, leaves least of each recording.

    One factor on the force is free: an error of the coefficients does not move the angle.

    Parameters
    ----------
    cut
        Recordings of the cut.
    acting
        Every cause with its numbers (n_numbers,) in SI, as the cutting file states them.
    """
    process = cut.belief.process
    turns = process.teeth if process.runout > 0 else 1
    angles = np.arange(ANGLES * turns) * 2 * np.pi / (process.teeth * ANGLES)
    begun = CutHypothesis(np.zeros(6), tuple(acting), tuple(one.recording.law for one in cut.spectra))
    for k in range(len(cut.spectra)):
        turned = [begun.with_angle(k, float(angle)) for angle in angles]
        begun = turned[int(np.argmin([_left(cut, k, one) for one in turned]))]
    return begun


def fit_turned(cut: MeasuredCut, start: CutHypothesis, freed: Sequence[str], *, part: slice = ALL) -> CutFit:
    """:func:`fit_cut`, with the teeth of every further recording numbered as in the first.

    A recording does not say which tooth is tooth 0. Causes that tell teeth apart are fitted to the first recording.
    The other recordings are turned by whole pitches until they agree with it. Then all are fitted together.

    Parameters
    ----------
    cut
        Recordings with their noise.
    start
        Hypothesis to begin with.
    freed
        Names of the causes whose numbers are fitted.
    part
        Blocks that are fitted.
    """
    teeth = cut.belief.process.teeth
    if teeth == 1 or len(cut.spectra) == 1 or not freed:
        return fit_cut(cut, start, freed, part=part)
    first = CutHypothesis(start.deviations, start.acting, start.laws[:1])
    alone = fit_cut(cut.only(0), first, freed, part=part).hypothesis
    found = CutHypothesis(alone.deviations, alone.acting, alone.laws + start.laws[1:])
    for k in range(1, len(cut.spectra)):
        angle = found.laws[k].angle
        turned = [found.with_angle(k, angle + turn * 2 * np.pi / teeth) for turn in range(teeth)]
        left = [float(cut.block_misfits(k, one)[part].sum()) for one in turned]
        found = turned[int(np.argmin(left))]
    return fit_cut(cut, found, freed, part=part)


def _left(cut: MeasuredCut, number: int, hypothesis: CutHypothesis) -> float:
    """Power that is left of one recording, with the best factor on the force, N^2."""
    predicted, measured = cut.predicted(number, hypothesis), cut.spectra[number].measured
    power = float(np.sum(np.abs(predicted) ** 2))
    gain = max(float(np.real(np.vdot(predicted, measured))) / max(power, 1e-300), 0.0)
    return float(np.sum(np.abs(measured - gain * predicted) ** 2))
