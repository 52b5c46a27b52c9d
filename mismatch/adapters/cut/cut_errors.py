"""Errors of a cause's numbers that hold its form: between blocks, between bands, and with another cause free."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .cut_fit import CutFit, fit_cut
from .cut_held_out import Halves
from .cut_search import Round
from .cut_setting import CutSetting

Real = NDArray[np.float64]

BANDS = 4
"""Bands of the compared frequencies, one of which is left out of each fit: a law of another form changes with them."""


@dataclass(frozen=True)
class FormErrors:
    """Variances of the numbers of one cause beyond those of its fit, (n,), SI.

    Parameters
    ----------
    blocks
        Between fits to either half of the blocks of time.
    bands
        Between fits that leave out one of four bands of frequency: ``(g - 1) / g sum (theta_i - mean)^2``, the grouped
        jackknife (Efron & Tibshirani, An Introduction to the Bootstrap, chapter 11).
    other
        Largest squared shift when one further cause is free, weighed by ``1 - exp(-gain / 2)`` of what it gains.
    """

    blocks: Real
    bands: Real
    other: Real

    @property
    def together(self) -> Real:
        """Sum of the three."""
        return np.asarray(self.blocks + self.bands + self.other)


def form_errors(setting: CutSetting, final: CutFit, halves: Halves, further: Sequence[Round]) -> dict[str, FormErrors]:
    """Errors of every fitted cause by its name.

    Parameters
    ----------
    setting, final
        The fit.
    halves
        The same fitted to either half of the blocks.
    further
        Fits with one more cause beside those of ``final``.
    """
    parts = [fit_cut(_without(setting, band), final.attempt, final.freed) for band in range(BANDS)]
    beside = [one for one in further if one.fitted.freed[:-1] == final.freed]
    found = {}
    for name in final.freed:
        values = final.attempt.values(name)
        other = np.zeros(len(values))
        for one in beside:
            weight = 1 - np.exp(-max(_cost(final) - _cost(one.fitted), 0.0) / 2)
            other = np.maximum(other, (weight * (one.fitted.attempt.values(name) - values)) ** 2)
        pair = [half.attempt.values(name) for half in halves]
        bands = _jackknife(np.array([part.attempt.values(name) for part in parts]))
        found[name] = FormErrors(_jackknife(np.array(pair)), bands, other)
    return found


def _cost(fitted: CutFit) -> float:
    return fitted.misfit + fitted.deviation


def _jackknife(values: Real) -> Real:
    count = len(values)
    return np.asarray((count - 1) / count * np.sum((values - values.mean(axis=0)) ** 2, axis=0))


def _without(setting: CutSetting, band: int) -> CutSetting:
    """The setting with the lines of one band weighing nothing."""
    noises = []
    for lines, noise in zip(setting.lines, setting.noise, strict=True):
        edges = np.linspace(0, lines.frequencies[-1], BANDS + 1)
        left_out = (lines.frequencies > edges[band]) & (lines.frequencies <= edges[band + 1])
        noises.append(replace(noise, whitener=noise.whitener * ~left_out[:, None, None]))
    return replace(setting, noise=tuple(noises), _views=setting._views)
