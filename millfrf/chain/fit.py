"""From an FRF file, or straight from recordings, to a modal model file."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from acquisition import Recording
from estimation import BandRecord, Frf, band_record, choose_channels, widest_band
from foundation import InputError, writing_whole_file
from modal_fit import (
    ModalFit,
    StabilisationChart,
    SubspaceFit,
    fit_polyreference,
    fit_subspace,
    write_modal_model,
)

from ..gate import check_frf_for_fit, check_recordings, check_records, fit_doubts
from ..progress import Watch, silent
from ..provenance import add_to_json, sources, versions

POLYREFERENCE, SUBSPACE = "polyreference", "subspace"
METHODS = (POLYREFERENCE, SUBSPACE)
SUBSPACE_ORDER = 30
"""Highest order of the state space where none is asked for."""

KEPT_ABOVE = 1.6
"""Records are kept up to this multiple of the band's upper end, where their sample rate reaches so far."""


@dataclass(frozen=True)
class FitOptions:
    """How a model is fitted.

    Parameters
    ----------
    band
        Hz.
    method
        ``polyreference`` of an FRF, ``subspace`` of recordings.
    max_order
        Highest order of the denominator or of the state space; None: by the data, or the method's own.
    n_modes
        Modes to keep; None: as many as are found.
    excitations, responses
        Channel names, for recordings; empty: chosen by quantity.
    stream
        Sample clock, for recordings; None: the only one.
    """

    band: tuple[float, float]
    method: str = POLYREFERENCE
    max_order: int | None = None
    n_modes: int | None = None
    excitations: tuple[str, ...] = ()
    responses: tuple[str, ...] = ()
    stream: str | None = None


def fit_model(frf: Frf, options: FitOptions, watch: Watch = silent, name: str = "the FRF") -> ModalFit:
    """Fit a modal model to an FRF; ``name`` is that of its file, for messages.

    Raises
    ------
    InputError
        A method that needs recordings, a band without enough lines, or an FRF that :mod:`millfrf.gate` refuses.
    MillfrfError
        No stable pole was found.
    """
    if options.method != POLYREFERENCE:
        raise InputError(f"method {options.method!r} does not fit an FRF; use {POLYREFERENCE}, or give recordings")
    doubts = check_frf_for_fit(frf, options.band, name)
    with watch(f"fitting {options.band[0]:g} to {options.band[1]:g} Hz"):
        fit = fit_polyreference(frf, options.band, max_order=options.max_order, n_modes=options.n_modes)
    poor = fit_doubts(fit.reduced_chi_square, fit.relative_error, fit.warnings)
    return replace(fit, warnings=(*doubts, *fit.warnings, *poor))


def fit_recordings(paths: Sequence[str | os.PathLike[str]], options: FitOptions, watch: Watch = silent) -> SubspaceFit:
    """Fit a modal model to recordings of one set-up, without spectra in between.

    Raises
    ------
    InputError
        A method that needs an FRF, recordings that cannot be stacked, or dependent inputs.
    MillfrfError
        No stable pole was found.
    """
    if options.method != SUBSPACE:
        raise InputError(f"method {options.method!r} does not fit recordings; use {SUBSPACE}, or estimate an FRF first")
    doubts = check_recordings(
        paths, stream=options.stream, excitations=options.excitations, responses=options.responses, watch=watch
    )
    records = [_band_record(path, options, watch) for path in paths]
    doubts += check_records(
        [record for record, _ in records],
        options.band,
        [Path(path).name for path in paths],
        [rate for _, rate in records],
    )
    with watch(f"fitting {options.band[0]:g} to {options.band[1]:g} Hz"):
        fit = fit_subspace(
            [record for record, _ in records],
            options.band,
            max_order=options.max_order or SUBSPACE_ORDER,
            n_modes=options.n_modes,
        )
    return replace(fit, warnings=(*doubts, *fit.warnings, *fit_doubts(fit.reduced_chi_square, None)))


def _band_record(path: str | os.PathLike[str], options: FitOptions, watch: Watch) -> tuple[BandRecord, float]:
    with Recording(path) as recording:
        stream = recording.stream(options.stream)
        channels = choose_channels(stream, options.excitations or None, options.responses or None)
        with watch(f"reading {Path(path).name}", stream.n_samples) as update:
            highest = max(options.band[1], min(KEPT_ABOVE * options.band[1], widest_band(stream.sample_rate)))
            made = band_record(recording, highest, *channels, stream=options.stream, progress=update)
    return made, stream.sample_rate


def write_fit(
    path: str | os.PathLike[str],
    fit: ModalFit | SubspaceFit,
    inputs: Sequence[str | os.PathLike[str]],
    options: FitOptions,
) -> None:
    """Write the model with its provenance: files, band, quality, stabilisation chart, warnings, versions."""
    provenance = {
        "step": "fit",
        "sources": sources(inputs),
        "method": options.method,
        "max_order": options.max_order or (int(fit.chart.orders.max()) if len(fit.chart.orders) else None),
        "band_hz": list(fit.band),
        "reduced_chi_square": None if np.isnan(fit.reduced_chi_square) else fit.reduced_chi_square,
        "relative_error": fit.relative_error.tolist() if isinstance(fit, ModalFit) else None,
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
