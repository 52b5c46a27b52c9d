"""`fit` and `calibrate`: modal models of FRFs or recordings, carried to the tool tip."""

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

from estimation import Frf
from millfrf.core import Band, InputError
from millfrf.core.file_kinds import FRF, RECORDING, kind_of
from millfrf.core.progress import Progress, silent
from modal_fit import ModalFit, SubspaceFit, TipCalibration

from .calibrate import calibrate_model
from .fit import METHODS, POLYREFERENCE, SUBSPACE, FitOptions, fit_model, fit_recordings
from .given import File, GivenFrf, GivenModel, GivenRecording, files_of, frf_of, model_of, names_of, warn_of
from .tap import TapResult
from .test_spectra import Estimate

Fit = TypeVar("Fit", ModalFit, SubspaceFit)


def fit(
    *sources: GivenFrf | GivenRecording,
    band: Band | None = None,
    method: str | None = None,
    max_order: int | None = None,
    modes: int | None = None,
    excitations: str | Sequence[str] = (),
    responses: str | Sequence[str] = (),
    stream: str | None = None,
    poles: File | None = None,
    refine: bool = False,
    progress: Progress = silent,
) -> ModalFit | SubspaceFit:
    """Modal model of one FRF or of recordings, with error bars: ``H(w) = sum_r right left / (i w - pole) + ...``.

    Parameters
    ----------
    sources
        One FRF, or recordings of one set-up; objects or the names of their files.
    band
        Lowest and highest frequency of the fit, Hz; None: the band in which the FRF holds. Recordings need one.
    method
        ``polyreference`` of an FRF or ``subspace`` of recordings; None: by what is given.
    max_order
        Highest order of the denominator or of the state space; None: by the data, or the method's own.
    modes
        Number of modes to keep; None: as many as are found.
    excitations, responses
        Names of channels of recordings; empty: chosen by quantity.
    stream
        Name of the sample clock of recordings; None: the only one.
    poles
        File of poles picked by hand, for an FRF; None: the fit chooses the modes.
    refine
        Refine picked poles; False: they are kept as they are.
    progress
        Shows progress, such as ``millfrf.progress.bar``.

    Returns
    -------
    ModalFit or SubspaceFit
        The model with the evidence for it and the doubts, which are warned of as well.

    Raises
    ------
    InputError
        Sources of mixed kinds, several FRFs, a method that does not fit them, or a band without enough lines.
    MillfrfError
        No stable pole was found.
    """
    if method is not None and method not in METHODS:
        raise InputError(f"unknown method {method!r}; use one of {', '.join(METHODS)}")
    kinds = {_kind(source) for source in sources}
    channels = (names_of(excitations), names_of(responses))
    given = (max_order, modes, *channels, stream, poles, refine)
    found: ModalFit | SubspaceFit
    if kinds == {RECORDING}:
        options = FitOptions(_stated(band), method or SUBSPACE, *given)
        found = _counted(fit_recordings(files_of(sources), options, progress), modes)
    elif kinds == {FRF} and len(sources) == 1:
        frf, name, stored = frf_of(sources[0])
        options = FitOptions(band or _band_of(frf), method or POLYREFERENCE, *given)
        fitted = _counted(fit_model(frf, options, progress, name), modes)
        found = replace(fitted, warnings=(*stored, *fitted.warnings))
    else:
        count = f"{len(sources)} file{'s' if len(sources) != 1 else ''}"
        raise InputError(f"cannot fit {count} of {' and '.join(sorted(kinds))}; give one FRF, or recordings")
    warn_of(found.warnings)
    return found


def calibrate(model: GivenModel, tip: GivenFrf, sensor: GivenFrf, *, progress: Progress = silent) -> TipCalibration:
    """Carry an in-process model from the sensor to the tool tip by two hammer FRFs: ``phi_tip / phi_sensor`` a mode.

    Parameters
    ----------
    model
        Modal model at the sensor, what ``fit`` returned, or the name of a file.
    tip
        FRF of hammer taps at the tip with the motion there.
    sensor
        FRF of the same taps with the motion at the sensor.
    progress
        Shows progress, such as ``millfrf.progress.bar``.

    Returns
    -------
    TipCalibration
        The model at the tip, the ratios and the doubts, which are warned of as well.

    Raises
    ------
    InputError
        Directions, points or modes that do not match.
    """
    known, _, _ = model_of(model)
    (at_tip, tip_name, _), (at_sensor, sensor_name, _) = frf_of(tip), frf_of(sensor)
    names = (tip_name, sensor_name) if tip_name != sensor_name else ("the tip's FRF", "the sensor's FRF")
    found = calibrate_model(known, at_tip, at_sensor, progress, names)
    warn_of(found.warnings)
    return found


def _kind(source: GivenFrf | GivenRecording) -> str:
    if isinstance(source, Frf | Estimate | TapResult):
        return FRF
    return kind_of(source) if isinstance(source, str | os.PathLike) else RECORDING


def _stated(band: Band | None) -> Band:
    if band is None:
        raise InputError("a fit of recordings needs its band in Hz, for example band=(13, 60)")
    return band


def _band_of(frf: Frf) -> Band:
    """The band in which an FRF holds, else that of its valid lines above 0 Hz."""
    if frf.band is not None:
        return frf.band
    lines = frf.frequencies[frf.valid & (frf.frequencies > 0)]
    if not len(lines):
        raise InputError("the FRF has no valid line above 0 Hz; estimate it anew")
    return float(lines[0]), float(lines[-1])


def _counted(fitted: Fit, asked: int | None) -> Fit:
    """The fit, with a warning where it has fewer modes than were asked for."""
    found = len(fitted.model.poles)
    if asked is None or found >= asked:
        return fitted
    doubt = f"{asked} modes were asked for, {found} were found in {fitted.band[0]:g} to {fitted.band[1]:g} Hz"
    return replace(fitted, warnings=(*fitted.warnings, doubt))
