"""`FitOptions`: how a model is fitted; and stabilisation charts as lists, for files."""

import os
from dataclasses import dataclass
from typing import Any

import numpy as np

from modal_fit import StabilisationChart

POLYREFERENCE, SUBSPACE = "polyreference", "subspace"
METHODS = (POLYREFERENCE, SUBSPACE)
SUBSPACE_ORDER = 30
"""Highest order of the state space where none is asked for."""

KEPT_ABOVE = 1.6
"""Records are kept up to this multiple of the band's upper end, where their sample rate reaches so far."""


@dataclass(frozen=True)
class FitOptions:
    """Options with which a model is fitted.

    Parameters
    ----------
    band : Hz
        Lowest and highest frequency of the fit.
    method
        Name of the method: ``polyreference`` of an FRF, ``subspace`` of recordings.
    max_order
        Highest order of the denominator or of the state space; None: by the data, or the method's own.
    n_modes
        Number of modes to keep; None: as many as are found.
    excitations, responses
        Names of the channels, for recordings; empty: chosen by quantity.
    stream
        Name of the sample clock, for recordings; None: the only one.
    poles
        File of picked poles, for an FRF; None: the modes are chosen by the fit.
    refine
        Whether picked poles are refined; False: they are kept.
    """

    band: tuple[float, float]
    method: str = POLYREFERENCE
    max_order: int | None = None
    n_modes: int | None = None
    excitations: tuple[str, ...] = ()
    responses: tuple[str, ...] = ()
    stream: str | None = None
    poles: str | os.PathLike[str] | None = None
    refine: bool = False


def chart_to_json(chart: StabilisationChart) -> dict[str, Any]:
    """A chart as lists, without vectors."""
    return {
        "orders": chart.orders.tolist(),
        "poles_rad_per_s": np.stack([chart.poles.real, chart.poles.imag], axis=1).round(6).tolist(),
        "stability": chart.stability.tolist(),
        "band_hz": list(chart.band),
    }


def chart_from_json(stored: dict[str, Any]) -> StabilisationChart:
    """The chart that :func:`chart_to_json` stored, without vectors (no figure needs them)."""
    poles = np.asarray(stored["poles_rad_per_s"], dtype=float).reshape(-1, 2)
    low, high = stored["band_hz"]
    return StabilisationChart(
        np.asarray(stored["orders"], dtype=np.int64),
        poles[:, 0] + 1j * poles[:, 1],
        np.asarray(stored["stability"], dtype=np.int64),
        np.zeros((len(poles), 0), dtype=complex),
        (float(low), float(high)),
    )
