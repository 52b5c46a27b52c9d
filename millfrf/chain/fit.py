"""From an FRF file to a modal model file."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from estimation import Frf
from foundation import InputError, writing_whole_file
from modal_fit import ModalFit, StabilisationChart, fit_polyreference, write_modal_model

from ..progress import Watch, silent
from ..provenance import add_to_json, sources, versions

FIT_METHODS = ("polyreference",)


@dataclass(frozen=True)
class FitOptions:
    """How an FRF is fitted.

    Parameters
    ----------
    band
        Hz.
    method
        ``polyreference``.
    max_order
        Highest order of the denominator.
    n_modes
        Modes to keep; None: as many as are found.
    """

    band: tuple[float, float]
    method: str = "polyreference"
    max_order: int = 40
    n_modes: int | None = None


def fit_model(frf: Frf, options: FitOptions, watch: Watch = silent) -> ModalFit:
    """Fit a modal model.

    Raises
    ------
    InputError
        An unknown method, or a band without enough lines.
    MillfrfError
        No stable pole was found.
    """
    if options.method not in FIT_METHODS:
        raise InputError(f"unknown method {options.method!r}; use one of {', '.join(FIT_METHODS)}")
    with watch(f"fitting {options.band[0]:g} to {options.band[1]:g} Hz"):
        return fit_polyreference(frf, options.band, max_order=options.max_order, n_modes=options.n_modes)


def write_fit(
    path: str | os.PathLike[str], fit: ModalFit, inputs: Sequence[str | os.PathLike[str]], options: FitOptions
) -> None:
    """Write the model with its provenance: FRF file, band, quality, stabilisation chart, warnings, versions."""
    provenance = {
        "step": "fit",
        "sources": sources(inputs),
        "method": options.method,
        "max_order": options.max_order,
        "band_hz": list(fit.band),
        "reduced_chi_square": None if np.isnan(fit.reduced_chi_square) else fit.reduced_chi_square,
        "relative_error": fit.relative_error.tolist(),
        "warnings": list(fit.warnings),
        "dropped": [
            {"frequency_hz": g.frequency, "damping_ratio": g.damping_ratio, "reason": g.reason} for g in fit.dropped
        ],
        "stabilisation": _chart_to_json(fit.chart),
        "versions": versions(),
    }
    with writing_whole_file(path) as temporary:
        write_modal_model(temporary, fit.model)
        add_to_json(temporary, provenance)


def _chart_to_json(chart: StabilisationChart) -> dict[str, Any]:
    return {
        "orders": chart.orders.tolist(),
        "poles_rad_per_s": np.stack([chart.poles.real, chart.poles.imag], axis=1).round(6).tolist(),
        "stability": chart.stability.tolist(),
        "band_hz": list(chart.band),
    }


def chart_from_json(stored: dict[str, Any]) -> StabilisationChart:
    """The chart that :func:`write_fit` stored, without vectors (no figure needs them)."""
    poles = np.asarray(stored["poles_rad_per_s"], dtype=float).reshape(-1, 2)
    low, high = stored["band_hz"]
    return StabilisationChart(
        np.asarray(stored["orders"], dtype=np.int64),
        poles[:, 0] + 1j * poles[:, 1],
        np.asarray(stored["stability"], dtype=np.int64),
        np.zeros((len(poles), 0), dtype=complex),
        (float(low), float(high)),
    )
