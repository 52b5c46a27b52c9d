"""Step ``fit``: modal model from an FRF or from recordings."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from acquisition import Recording, Stream
from estimation import BandRecording, Frf, band_of_channels, choose_channels, require_room_for_band, widest_band
from millfrf.core import InputError, writing_whole_file
from millfrf.core.file_kinds import FRF, kind_of
from millfrf.core.progress import Progress, silent
from millfrf.core.provenance import add_to_json, sources, versions
from millfrf.gate import check_band_recordings, check_frf_for_fit, check_recordings, fit_doubts, smearing_doubts
from modal_fit import (
    ModalFit,
    SubspaceFit,
    candidate_groups,
    chart_to_json,
    fit_picked_poles,
    fit_polyreference,
    fit_subspace,
    read_picked_poles,
    write_modal_model,
    write_pole_candidates,
)

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


def check_picking(options: FitOptions) -> None:
    """Refuse options that contradict a picked fit, before anything is computed.

    Raises
    ------
    InputError
        A count of modes beside picked poles, or a refinement of an automatic fit, which is refined anyway.
    """
    if options.poles is not None and options.n_modes is not None:
        raise InputError(f"--poles names the modes, --modes {options.n_modes} a number of them; give one of the two")
    if options.refine and options.poles is None:
        raise InputError("--refine is of picked poles; an automatic fit is refined anyway: leave it out")


def check_candidates(path: Path, out: Path, poles: Path | None, files: Sequence[Path]) -> None:
    """Refuse a file of candidates that cannot be made or written, before anything is computed.

    Raises
    ------
    InputError
        Candidates of a fit that was picked or that is of recordings, the name of another file, or a name that cannot be
        written.
    """
    if poles is not None:
        raise InputError("--candidates offers what an automatic fit finds; leave --poles out")
    if kind_of(files[0]) != FRF:
        raise InputError("--candidates are poles of an FRF; estimate one from these recordings first")
    if path.resolve() == out.resolve():
        raise InputError(f"{path} is the model of --out; choose another file for --candidates")
    if path.suffix.lower() != ".json" or not path.parent.is_dir():
        raise InputError(f"cannot write {path}: give --candidates a name that ends in .json, in a folder that exists")


def fit_picked(frf: Frf, options: FitOptions) -> ModalFit:
    """Fit exactly the poles that ``options.poles`` names.

    Raises
    ------
    InputError
        A file that names no usable poles, or poles that the band does not hold.
    """
    assert options.poles is not None
    poles = read_picked_poles(options.poles)
    return fit_picked_poles(frf, options.band, poles, refine=options.refine, max_order=options.max_order)


def write_candidates(path: str | os.PathLike[str], fit: ModalFit, frf: str | os.PathLike[str]) -> int:
    """Write the groups of an automatic fit for a picker; returns how many there are."""
    groups = candidate_groups(fit)
    made = {"step": "candidates", "sources": sources([frf]), "versions": versions()}
    write_pole_candidates(path, groups, fit.band, chart_to_json(fit.chart), made)
    return len(groups)


def picked_in_words(fit: ModalFit, options: FitOptions) -> str:
    """One line on what became of picked poles."""
    assert options.poles is not None
    how = "refined from there" if options.refine else "kept as they are, vectors and residuals fitted"
    return f"{len(fit.model.poles)} poles picked in {Path(options.poles).name}, {how}"


def fit_model(frf: Frf, options: FitOptions, progress: Progress = silent, name: str = "the FRF") -> ModalFit:
    """Fit a modal model to an FRF; ``name`` is that of its file, for messages.

    Raises
    ------
    InputError
        A method that needs recordings, a band without enough lines, an FRF that :mod:`millfrf.gate` refuses, or picked
        poles that cannot be.
    MillfrfError
        No stable pole was found.
    """
    if options.method != POLYREFERENCE:
        raise InputError(f"method {options.method!r} does not fit an FRF; use {POLYREFERENCE}, or give recordings")
    check_picking(options)
    doubts = check_frf_for_fit(frf, options.band, name)
    with progress(f"fitting {options.band[0]:g} to {options.band[1]:g} Hz"):
        if options.poles is None:
            fit = fit_polyreference(frf, options.band, max_order=options.max_order, n_modes=options.n_modes)
        else:
            fit = fit_picked(frf, options)
    poor = fit_doubts(fit.reduced_chi_square, fit.relative_error, fit.warnings)
    smeared = smearing_doubts(fit.model, frf)
    return replace(fit, warnings=(*doubts, *fit.warnings, *poor, *smeared))


def fit_recordings(
    paths: Sequence[str | os.PathLike[str]], options: FitOptions, progress: Progress = silent
) -> SubspaceFit:
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
    if options.poles is not None or options.refine:
        raise InputError("--poles picks poles of an FRF; estimate one from these recordings first")
    for path in paths:
        _require_room(path, options)
    doubts = check_recordings(
        paths, stream=options.stream, excitations=options.excitations, responses=options.responses, progress=progress
    )
    records = [_band_recording(path, options, progress) for path in paths]
    doubts += check_band_recordings(
        [record for record, _ in records],
        options.band,
        [Path(path).name for path in paths],
        [rate for _, rate in records],
    )
    with progress(f"fitting {options.band[0]:g} to {options.band[1]:g} Hz"):
        fit = fit_subspace(
            [record for record, _ in records],
            options.band,
            max_order=options.max_order or SUBSPACE_ORDER,
            n_modes=options.n_modes,
        )
    return replace(fit, warnings=(*doubts, *fit.warnings, *fit_doubts(fit.reduced_chi_square, None)))


def _band_recording(
    path: str | os.PathLike[str], options: FitOptions, progress: Progress
) -> tuple[BandRecording, float]:
    with Recording(path) as recording:
        stream = recording.stream(options.stream)
        channels = choose_channels(stream, options.excitations or None, options.responses or None)
        with progress(f"reading {Path(path).name}", stream.n_samples) as update:
            made = band_of_channels(stream, *channels, _kept_up_to(stream, options), update)
    return made, stream.sample_rate


def _kept_up_to(stream: Stream, options: FitOptions) -> float:
    """Upper end of the band that stays flat, Hz: above that of the fit, where the sample rate allows it."""
    return max(options.band[1], min(KEPT_ABOVE * options.band[1], widest_band(stream.sample_rate)))


def _require_room(path: str | os.PathLike[str], options: FitOptions) -> None:
    """Refuse a recording that memory has no room for, before it is looked through."""
    with Recording(path) as recording:
        stream = recording.stream(options.stream)
        forces, motions = choose_channels(stream, options.excitations or None, options.responses or None)
        require_room_for_band(stream, len(forces) + len(motions), _kept_up_to(stream, options))


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
        "status": fit.status if isinstance(fit, ModalFit) else None,
        "picked_poles": None if options.poles is None else sources([options.poles])[0],
        "max_order": options.max_order or (int(fit.chart.orders.max()) if len(fit.chart.orders) else None),
        "band_hz": list(fit.band),
        "reduced_chi_square": None if np.isnan(fit.reduced_chi_square) else fit.reduced_chi_square,
        "relative_error": fit.relative_error.tolist() if isinstance(fit, ModalFit) else None,
        "warnings": list(fit.warnings),
        "dropped": [
            {"frequency_hz": g.frequency, "damping_ratio": g.damping_ratio, "reason": g.reason} for g in fit.dropped
        ],
        "stabilisation": chart_to_json(fit.chart),
        "versions": versions(),
    }
    with writing_whole_file(path) as temporary:
        write_modal_model(temporary, fit.model)
        add_to_json(temporary, provenance)
