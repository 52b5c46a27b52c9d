"""Step ``fit``: modal model from an FRF or from recordings."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, cast

import numpy as np
from annotated_types import Ge, Gt

from acquisition import Channel, Recording, RecordingFile, Stream, all_opened
from estimation import (
    BandRecording,
    Frf,
    band_of_channels,
    choose_channels,
    measured_blocks,
    require_room_for_band,
    widest_band,
)
from millfrf.core import InputError, MillfrfError, writing_whole_file
from millfrf.core.progress import progress
from millfrf.core.provenance import add_to_json, sources, versions
from millfrf.core.steps import Band, File, Names, Reads, Writes, names_of, step
from millfrf.core.terminal import say, say_written, show, tell, warn
from millfrf.gate import (
    FileKind,
    check_band_recordings,
    check_consistency,
    check_constant_modes,
    check_fit_of_recordings,
    check_frf_for_fit,
    check_recordings,
    fit_warnings,
    kind_of,
    recorded_cuts,
    smearing_warnings,
)
from millfrf.reports.tables import error_table, explained_table, mode_table
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

from .answers import model_answer
from .given import HasFrf, files_among, frf_of
from .settings import STEPS

Method = Literal["polyreference", "subspace"]
POLYREFERENCE, SUBSPACE = "polyreference", "subspace"

Fit = TypeVar("Fit", ModalFit, SubspaceFit)


@step
def fit(
    *sources: Annotated[File | Frf | HasFrf | Recording, Reads("FRF.h5|REC...")],
    out: Annotated[File | None, Writes(suffixes=(".json",), needed=True)] = None,
    band: Band | None = None,
    method: Method | None = None,
    max_order: Annotated[int, Ge(1)] | None = None,
    modes: Annotated[int, Ge(1)] | None = None,
    lowest_mode: Annotated[float, Gt(0)] | None = None,
    excitations: Names = (),
    responses: Names = (),
    stream: str | None = None,
    poles: Annotated[File | None, Reads("POLES.toml")] = None,
    refine: bool = False,
    candidates: Annotated[File | None, Writes(suffixes=(".json",))] = None,
    pick: Annotated[File | None, Writes(suffixes=(".toml",))] = None,
) -> ModalFit | SubspaceFit:
    """Modal model of one FRF or of recordings, with error bars: ``H(w) = sum_r right left / (i w - pole) + ...``.

    Recordings are fitted in the time domain with tests stacked, without windows or leakage, which is more accurate for
    heavily damped modes. The model holds poles, vectors, residuals and a stabilisation chart that reports show.

    Parameters
    ----------
    sources
        One FRF, or recordings of one set-up.
    out
        Model file to write.
    band : Hz
        Lowest and highest frequency of the fit; without it the valid band of the FRF. Needed with recordings.
    method
        polyreference for an FRF or subspace for recordings; without it by the kind of the sources.
    max_order
        Highest order of the denominator or of the state space; without it from the data, or the default of the method.
    modes
        Number of modes to keep; without it as many as the data need. Of each direction of an FRF without cross terms.
    lowest_mode : Hz
        Frequency below which you know that neither machine nor workpiece has a mode. Lobes then allow for none there;
        without it, for all that the measurement does not exclude.
    excitations
        Excitation channels of recordings; without it forces.
    responses
        Response channels of recordings; without it accelerations, velocities and displacements.
    stream
        Sample clock of recordings; needed where a recording has several.
    poles
        File of poles picked by hand, for an FRF: the model has only these poles.
    refine
        Refine picked poles; otherwise they are not changed.
    candidates
        File of candidate poles to write, for picking by hand.
    pick
        File to write the poles to that you pick in the browser; --poles reads it.

    Returns
    -------
    ModalFit or SubspaceFit
        The model with the evidence for it and the warnings.

    Raises
    ------
    InputError
        Sources of mixed kinds, several FRFs, a method that does not fit them, or a band without enough lines.
    MillfrfError
        No stable pole was found.

    Examples
    --------
    ::

        $ millfrf fit rec1.h5 rec2.h5 rec3.h5 --band 13 60 --out housing.json
    """
    kinds = {_kind(source) for source in sources}
    of_recordings = kinds == {FileKind.RECORDING}
    if not of_recordings and not (kinds == {FileKind.FRF} and len(sources) == 1):
        count = f"{len(sources)} file{'s' if len(sources) != 1 else ''}"
        raise InputError(f"cannot fit {count} of {' and '.join(sorted(kinds))}; give one FRF, or recordings")
    frf, name, stored = (None, "", []) if of_recordings else frf_of(sources[0])
    if band is None:
        band = _band_of(frf)
    used = cast(Method, method or (SUBSPACE if of_recordings else POLYREFERENCE))
    _check_picking(kinds, poles, modes, refine, candidates, pick)
    options = FitOptions(
        band, used, max_order, modes, names_of(excitations), names_of(responses), stream, poles, refine
    )
    fitted: ModalFit | SubspaceFit
    if frf is None:
        with all_opened(cast(Sequence[RecordingFile], sources)) as recordings:
            fitted = _with_count_checked(fit_recordings(recordings, options), modes)
    else:
        if pick is not None:
            from millfrf.live.picking_server import pick_in_browser  # not at the top: it takes 0.4 s and matplotlib

            automatic = fit_frf(frf, options, name)
            options = replace(
                options,
                poles=pick_in_browser(pick, Path(cast(File, sources[0])), frf, automatic, max_order),
                n_modes=None,
            )
        fitted = _with_count_checked(fit_frf(frf, options, name), options.n_modes)
        fitted = replace(fitted, warnings=(*stored, *fitted.warnings))
    if lowest_mode is not None:
        fitted = _with_lowest_mode(fitted, lowest_mode)
    if out is not None:
        write_fit(out, fitted, files_among(*sources), options)
    _say_fit(fitted, options, out)
    if candidates is not None and isinstance(fitted, ModalFit):
        groups = write_candidates(candidates, fitted, files_among(*sources))
        say_written([candidates], f"{groups} groups of poles to pick from")
    return fitted


@dataclass(frozen=True)
class FitOptions:
    """Options of :func:`fit`; ``n_modes`` is its option ``modes``."""

    band: Band
    method: Method
    max_order: int | None
    n_modes: int | None
    excitations: tuple[str, ...]
    responses: tuple[str, ...]
    stream: str | None
    poles: File | None
    refine: bool


def _say_fit(fitted: ModalFit | SubspaceFit, options: FitOptions, out: File | None) -> None:
    """Print warnings, modes and what was written."""
    warn(fitted.warnings, 5)
    tell(lambda: {"method": options.method, **model_answer(fitted.model), **_explained(fitted)})
    show(mode_table(fitted.model))
    if isinstance(fitted, ModalFit):
        show(explained_table(fitted))
    by_source = error_table(fitted.model)
    if by_source is not None:
        show(by_source)
    if options.poles is not None:
        how = "refined" if options.refine else "not changed; vectors and residuals fitted"
        say(f"{len(fitted.model.poles)} poles picked in {Path(options.poles).name}, {how}")
    apart = (
        f"each direction fitted on its own; not measured and 0: {unmeasured}"
        if (unmeasured := fitted.model.unmeasured)
        else ""
    )
    say_written([out], apart)


def _explained(fitted: ModalFit | SubspaceFit) -> dict[str, Any]:
    """Return the share of the FRFs of each channel that the model explains, for JSON; nothing of recordings."""
    if not isinstance(fitted, ModalFit):
        return {}
    return dict(zip(("explained_by_response", "explained_by_excitation"), map(list, fitted.explained), strict=True))


def _kind(source: object) -> str:
    """Return the kind of a source: of a file by its content, of an object by its type."""
    if isinstance(source, Recording):
        return FileKind.RECORDING
    return kind_of(source) if isinstance(source, str | os.PathLike) else FileKind.FRF


def _band_of(frf: Frf | None) -> Band:
    """Return the band that the FRF states, else the band of its valid lines above 0 Hz."""
    if frf is None:
        raise InputError("a fit of recordings needs its band in Hz, for example --band 13 60")
    if frf.band is not None:
        return frf.band
    lines = frf.frequencies[frf.valid & (frf.frequencies > 0)]
    if not len(lines):
        raise InputError("the FRF has no valid line above 0 Hz; estimate it anew")
    return float(lines[0]), float(lines[-1])


def _with_count_checked(fitted: Fit, demanded: int | None) -> Fit:
    """Add a warning to a fit that has fewer modes than demanded."""
    count, measured = len(fitted.model.poles), fitted.model.measured
    if demanded is not None and measured is not None:
        demanded *= len(measured_blocks(measured))
    if demanded is None or count >= demanded:
        return fitted
    warning = f"{demanded} modes were asked for, {count} were found in {fitted.band[0]:g} to {fitted.band[1]:g} Hz"
    return replace(fitted, warnings=(*fitted.warnings, warning))


def _with_lowest_mode(fitted: ModalFit | SubspaceFit, stated: float) -> ModalFit | SubspaceFit:
    """State in the model of a fit that no mode lies below a frequency, Hz."""
    lowest = float(fitted.model.natural_frequencies.min(initial=np.inf))
    if lowest < stated:
        raise InputError(
            f"--lowest-mode {stated:g} Hz contradicts the fit, whose lowest mode is at {lowest:.4g} Hz: begin --band "
            "above a mode that is hum or noise, or state a lower frequency"
        )
    return replace(fitted, model=replace(fitted.model, lowest_mode=stated))


def _check_picking(
    kinds: set[str],
    poles: File | None,
    modes: int | None,
    refine: bool,
    candidates: File | None,
    pick: File | None,
) -> None:
    """Refuse contradictory options about picked poles before the computation starts."""
    if poles is not None and modes is not None:
        raise InputError(f"--poles names the modes, --modes {modes} a number of them; give one of the two")
    if refine and poles is None and pick is None:
        raise InputError("--refine is of picked poles; an automatic fit is always refined: leave it out")
    if pick is not None and poles is not None:
        raise InputError("--pick and --poles both choose the poles; give one of the two")
    if pick is not None and candidates is not None:
        raise InputError("--candidates is for another picker; leave it out with --pick")
    if candidates is not None and poles is not None:
        raise InputError("--candidates are poles of an automatic fit; leave --poles out")
    for option, file in (("--candidates are", candidates), ("--pick shows the", pick)):
        if file is not None and kinds != {FileKind.FRF}:
            raise InputError(f"{option} poles of an FRF; estimate one from these recordings first")
    if poles is not None and kinds != {FileKind.FRF}:
        raise InputError("--poles picks poles of an FRF; estimate one from these recordings first")


def fit_frf(frf: Frf, options: FitOptions, name: str = "the FRF") -> ModalFit:
    """Fit a modal model to an FRF; ``name`` of its file for messages."""
    if options.method != POLYREFERENCE:
        raise InputError(f"method {options.method!r} does not fit an FRF; use {POLYREFERENCE}, or give recordings")
    band = options.band
    doubts = check_frf_for_fit(frf, band, name)
    with progress(f"fitting {band[0]:g} to {band[1]:g} Hz"):
        if options.poles is None:
            fitted = fit_polyreference(frf, band, max_order=options.max_order, n_modes=options.n_modes)
        else:
            poles = read_picked_poles(options.poles)
            fitted = fit_picked_poles(frf, band, poles, refine=options.refine, max_order=options.max_order)
    poor = fit_warnings(fitted.reduced_chi_square, fitted.relative_error, fitted.warnings)
    return replace(fitted, warnings=(*doubts, *fitted.warnings, *poor, *smearing_warnings(fitted.model, frf)))


def fit_recordings(recordings: Sequence[Recording], options: FitOptions) -> SubspaceFit:
    """Fit a modal model to recordings of one set-up in the time domain."""
    if options.method != SUBSPACE:
        raise InputError(f"method {options.method!r} does not fit recordings; use {SUBSPACE}, or estimate an FRF first")
    for recording in recordings:  # memory is checked before anything is read
        stream = recording.stream(options.stream)
        forces, motions = _channels(stream, options)
        require_room_for_band(stream, len(forces) + len(motions), _kept_up_to(stream, options.band))
    doubts = check_recordings(
        recordings, stream=options.stream, excitations=options.excitations, responses=options.responses
    )
    records = [_band_recording(recording, options) for recording in recordings]
    rates = [recording.stream(options.stream).sample_rate for recording in recordings]
    doubts += check_band_recordings(records, options.band, [recording.path.name for recording in recordings], rates)
    # recordings that contradict each other first: they are the most likely cause of whatever follows
    doubts = [*check_consistency(recordings, options.stream, options.excitations, options.responses), *doubts]
    try:
        with progress(f"fitting {options.band[0]:g} to {options.band[1]:g} Hz"):
            fitted = fit_subspace(
                records, options.band, max_order=options.max_order or STEPS.subspace_order, n_modes=options.n_modes
            )
    except MillfrfError:
        warn(doubts)  # what is wrong with the recordings is most likely why they cannot be fitted
        raise
    doubts += [*check_constant_modes(records, options.band), *check_fit_of_recordings(fitted.model, records)]
    return replace(fitted, warnings=(*doubts, *fitted.warnings, *fit_warnings(fitted.reduced_chi_square, None)))


def _channels(stream: Stream, options: FitOptions) -> tuple[tuple[Channel, ...], tuple[Channel, ...]]:
    return choose_channels(stream, options.excitations or None, options.responses or None)


def _band_recording(recording: Recording, options: FitOptions) -> BandRecording:
    stream = recording.stream(options.stream)
    with progress(f"reading {recording.path.name}", stream.n_samples) as update:
        forces, motions = _channels(stream, options)
        return band_of_channels(stream, forces, motions, _kept_up_to(stream, options.band), update)


def _kept_up_to(stream: Stream, band: Band) -> float:
    """Return the upper frequency (Hz) to which records are kept.

    The edge of the filter then lies above the band of the fit if the sample rate allows it.
    """
    return max(band[1], min(STEPS.margin_above_band * band[1], widest_band(stream.sample_rate)))


def write_candidates(path: File, fitted: ModalFit, frf: Sequence[Path]) -> int:
    """Write the groups of poles of an automatic fit for picking by hand; their number."""
    groups = candidate_groups(fitted)
    provenance = {"step": "candidates", "sources": sources(frf), "versions": versions()}
    write_pole_candidates(path, groups, fitted.band, chart_to_json(fitted.chart), provenance)
    return len(groups)


def write_fit(
    path: File,
    fitted: ModalFit | SubspaceFit,
    inputs: Sequence[Path],
    options: FitOptions,
) -> None:
    """Write the model with its provenance: files, band, quality, stabilisation chart, warnings, versions."""
    provenance = {
        "step": "fit",
        "sources": sources(inputs),
        "method": options.method,
        "status": fitted.status if isinstance(fitted, ModalFit) else None,
        "picked_poles": None if options.poles is None else sources([options.poles])[0],
        "max_order": options.max_order or (int(fitted.chart.orders.max()) if len(fitted.chart.orders) else None),
        "band_hz": list(fitted.band),
        "reduced_chi_square": None if np.isnan(fitted.reduced_chi_square) else fitted.reduced_chi_square,
        "relative_error": fitted.relative_error.tolist() if isinstance(fitted, ModalFit) else None,
        **_explained(fitted),
        "cuts": recorded_cuts(inputs),
        "warnings": list(fitted.warnings),
        "dropped": [
            {"frequency_hz": group.frequency, "damping_ratio": group.damping_ratio, "reason": group.reason}
            for group in fitted.dropped
        ],
        "stabilisation": chart_to_json(fitted.chart),
        "versions": versions(),
    }
    with writing_whole_file(path) as temporary:
        write_modal_model(temporary, fitted.model)
        add_to_json(temporary, provenance)
