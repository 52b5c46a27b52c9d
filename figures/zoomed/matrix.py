"""A measured FRF matrix with its models as figures that zoom."""

import numpy as np
from numpy.typing import NDArray

from estimation import Frf

from ..measurement import SYMBOLS, FrfCurves, lines_in_band, model_axis, model_entry
from .frf import EntryCurves, zoomed_frfs
from .plot import ZoomedPlot

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]


def zoomed_matrix(curves: FrfCurves) -> ZoomedPlot:
    """Every entry of the matrix to choose from, as :func:`figures.frf_figures` draws them side by side.

    Parameters
    ----------
    curves
        FRF, models and bands.
    """
    frf = curves.measured
    f, values, deviation = lines_in_band(curves)
    axis = _model_lines(curves)
    entries = []
    for p, response in enumerate(frf.responses):
        for q, excitation in enumerate(frf.excitations):
            entries.append(
                EntryCurves(
                    f"{response} / {excitation}",
                    values[:, p, q],
                    _made(curves, axis, p, q),
                    None if deviation is None else deviation[:, p, q],
                    _coherence(frf, p, q, curves.band),
                )
            )
    return zoomed_frfs(entries, f, axis, f"|{SYMBOLS.get(frf.quantity, 'H')}| ({frf.unit})")


def _model_lines(curves: FrfCurves) -> Real:
    if curves.fitted is None:
        return np.zeros(0)
    low, high = curves.fit_band or curves.band
    return model_axis(curves.fitted, (max(low, curves.band[0]), min(high, curves.band[1])))


def _made(curves: FrfCurves, axis: Real, p: int, q: int) -> Complex | None:
    """The model's values; not a number where it lacks the entry, so that all entries have the same curves."""
    if curves.fitted is None:
        return None
    entry = model_entry(curves.fitted, axis, curves.measured, p, q)
    return np.full(len(axis), np.nan + 0j) if entry is None else entry


def _coherence(frf: Frf, p: int, q: int, band: tuple[float, float]) -> Real | None:
    inside = (frf.frequencies >= band[0]) & (frf.frequencies <= band[1])
    if frf.multiple_coherence is not None:
        return np.asarray(frf.multiple_coherence[inside, p])
    return None if frf.coherence is None else np.asarray(frf.coherence[inside, p, q])
