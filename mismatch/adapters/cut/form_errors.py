"""Errors of a cause's numbers that include its form: between blocks, between bands, and with another cause free."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...inference import Proposal, jackknife_variance, shift_weight
from .fits import CutFit, MeasuredCut, fit_cut
from .held_out import Halves

Real = NDArray[np.float64]

BANDS = 4
"""Bands of the compared frequencies, one of which is left out of each fit: a law of another form changes with them."""


@dataclass(frozen=True)
class FormErrors:
    """Variances of the numbers of one cause beyond those of its fit, in SI squared.

    Parameters
    ----------
    spread : (n_numbers,)
        Variance between fits to either half of the blocks of time, and between fits that leave out one of four bands
        of frequency (jackknife).
    form : (n_numbers,)
        Largest squared shift when one further cause is free, weighed by what that cause gains.
    """

    spread: Real
    form: Real


def form_errors(
    cut: MeasuredCut, final: CutFit, halves: Halves, further: Sequence[Proposal[CutFit]]
) -> dict[str, FormErrors]:
    """Errors of every fitted cause by its name.

    Parameters
    ----------
    cut
        Recordings with their noise.
    final
        Fit with all accepted causes.
    halves
        The same hypothesis fitted to either half of the blocks.
    further
        Fits of the last round; those with one more cause beside the accepted ones are used.
    """
    edges = np.linspace(0, 1, BANDS + 1)
    parts = [
        fit_cut(cut.without_band(float(low), float(high)), final.hypothesis, final.freed)
        for low, high in pairwise(edges)
    ]
    beside = [one.fitted for one in further if one.fitted.freed[:-1] == final.freed]
    found = {}
    for name in final.freed:
        values = final.hypothesis.values(name)
        bands, blocks = (
            jackknife_variance(np.array([one.hypothesis.values(name) for one in fits])) for fits in (parts, halves)
        )
        shifts = [(shift_weight(final.cost - one.cost) * (one.hypothesis.values(name) - values)) ** 2 for one in beside]
        found[name] = FormErrors(bands + blocks, np.max([np.zeros(len(values)), *shifts], axis=0))
    return found
