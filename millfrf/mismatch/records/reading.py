"""Recordings at the degrees of freedom of a model, resampled to the rate of the comparison."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from acquisition import RecordingFile, opened
from estimation import (
    DERIVATIVE_ORDERS,
    BandRecording,
    channel_at,
    family_of,
    quantities_of_unit,
    read_band_recording,
    require_room_at_rate,
    swept_line,
)
from millfrf.core import SI_UNITS, Band, InputError
from modal_fit import ModalModel, Residuals

from .bands import ABOVE, compared_band, reach_of

# sample rate over the highest frequency of interest: tones above the band are searched for there
OVERSAMPLING = 6.0


def band_of(model: ModalModel, rate: float) -> tuple[float, float]:
    """Return the band (Hz) in which a model and a recording are compared: both edges of ``compared_band``.

    ``rate``: sample rate of the recording, Hz.
    """
    return compared_band(model, rate).edges


def read_recording(
    path: RecordingFile, model: ModalModel, *, stream: str | None = None, band: Band | None = None
) -> BandRecording:
    """Read one recording at the degrees of freedom of a model.

    Parameters
    ----------
    path
        Recording with a channel of what drives the model at each of its excitations (by its unit: force, moment,
        voltage, acceleration of a base), and one of the model's motion or its derivatives at each of its responses.
    model
        Model with which the recordings are compared.
    stream
        Name of the sample clock; None for the only one.
    band
        Lowest and highest frequency that are compared, Hz; None: the model's own band.

    Raises
    ------
    InputError
        A channel is missing, values are not finite, or the recording is sampled too slowly.
    """
    return read_at(path, model.excitations, model.responses, model, stream=stream, band=band)


def read_at(
    path: RecordingFile,
    excitations: Sequence[str],
    responses: Sequence[str],
    model: ModalModel,
    *,
    stream: str | None = None,
    band: Band | None = None,
) -> BandRecording:
    """Read one recording at given degrees of freedom; the model's modes determine the necessary rate and length.

    ``stream``: name of the sample clock; None for the only one. ``band``: lowest and highest frequency that are
    compared, Hz; None: the model's own band.
    """
    response, excitation = quantities_of_unit(model.unit)
    recording = read_band_recording(
        path,
        excitations,
        responses,
        _needed_rate(model, band),
        stream=stream,
        exciting=(excitation,),
        responding=family_of(response),
    )
    reach_of(model, recording.rate)
    compared_band(model, recording.rate, band)
    return replace(recording, swept_line=swept_line(recording.force, recording.rate))


def _needed_rate(model: ModalModel, band: Band | None) -> float:
    """Return the sample rate that a comparison needs, Hz."""
    bands = [known_band for known_band in (model.band, band) if known_band is not None]
    return OVERSAMPLING * max(ABOVE * float(model.natural_frequencies.max()), *(high for _, high in bands), 0.0)


def require_room_for_comparison(
    paths: Sequence[RecordingFile],
    model: ModalModel,
    *,
    stream: str | None = None,
    band: Band | None = None,
) -> None:
    """Raise InputError if memory does not suffice for :func:`read_recordings`, before a sample is read.

    Parameters
    ----------
    paths
        Recordings that will be compared with the model.
    model
        Model whose degrees of freedom and band determine what is read.
    stream
        Name of the sample clock; None for the only one of each recording.
    band
        Lowest and highest frequency that are compared, Hz; None: the model's own band.

    Raises
    ------
    InputError
        A recording is too long; the line says how long it may be.
    """
    for path in paths:
        count = len(model.excitations) + len(model.responses)
        require_room_at_rate(path, count, _needed_rate(model, band), stream=stream)


def read_recordings(
    paths: Sequence[RecordingFile],
    model: ModalModel,
    *,
    stream: str | None = None,
    band: Band | None = None,
) -> list[BandRecording]:
    """Read recordings for a diagnosis, weakest force first.

    Parameters
    ----------
    paths
        Recordings that are compared, in any order.
    model
        Model with which the recordings are compared.
    stream
        Name of the sample clock; None for the only one of each recording.
    band
        Lowest and highest frequency that are compared, Hz; None: the model's own band.

    Raises
    ------
    InputError
        No recording is given, the model's unit does not say what drives the rig, or :func:`read_recording` refuses a
        recording.
    """
    if not paths:
        raise InputError("no recording given; name one or more")
    quantities_of_unit(model.unit)
    recordings = (read_recording(path, model, stream=stream, band=band) for path in paths)
    return sorted(recordings, key=lambda recording: recording.level)


def measured_part(model: ModalModel, paths: Sequence[RecordingFile], *, stream: str | None = None) -> ModalModel:
    """Return the model reduced to the responses that every recording contains, as some sensors may not be mounted.

    Parameters
    ----------
    model
        Model with which the recordings are compared.
    paths
        Recordings that are compared, in any order.
    stream
        Name of the sample clock; None for the only one of each recording.

    Raises
    ------
    InputError
        No response of the model is in all recordings.
    """
    rows, motions = list(range(len(model.responses))), family_of(quantities_of_unit(model.unit)[0])
    for path in paths:
        with opened(path) as recording:
            channels = recording.stream(stream).channels
            rows = [k for k in rows if channel_at(channels, model.responses[k], motions) is not None]
    if not rows:
        motion_list = " or ".join([", ".join(motions[:-1]), motions[-1]] if motions[1:] else motions)
        raise InputError(
            f"no {motion_list} at {', '.join(model.responses)} is in every recording; "
            "give recordings of the model's degrees of freedom"
        )
    if len(rows) == len(model.responses):
        return model
    residuals = model.residuals
    if residuals is not None:
        residues = None if residuals.residues is None else residuals.residues[:, rows]
        residuals = replace(residuals, upper=residuals.upper[rows], lower=residuals.lower[rows], residues=residues)
    labels = tuple(model.responses[k] for k in rows)
    return replace(model, right=model.right[:, rows], responses=labels, residuals=residuals, covariance=None)


LINES = 200  # frequencies at which modes outside the band are approximated


def in_deflections(model: ModalModel) -> ModalModel:
    """Return a model of velocities or accelerations as a model of deflections, ``H(s) / s^n``.

    Residues are divided by ``pole^n``. The remaining terms in the band of the model (its own residual terms, and what
    the division leaves at 0 Hz) are approximated by ``upper + lower / s^2``. A model of deflections is returned
    unchanged.
    """
    response, excitation = quantities_of_unit(model.unit)
    order = DERIVATIVE_ORDERS.get(response, 0)
    if order == 0:
        return model
    natural = model.natural_frequencies
    low, high = model.band or (0.5 * float(natural.min()), 1.5 * float(natural.max()))
    s = np.asarray(2j * np.pi * np.linspace(max(low, 0.02 * high), high, LINES), dtype=complex)
    plain = replace(model, delay=0.0, physics=(), covariance=None)
    unit = f"{SI_UNITS[family_of(response)[0]]}/{SI_UNITS[excitation]}"
    bare = replace(plain, right=model.right / model.poles[:, None] ** order, residuals=None, unit=unit, errors=None)
    remainder = (plain.at(s) / s[:, None, None] ** order - bare.at(s)).reshape(LINES, -1)
    basis = np.column_stack([np.ones(LINES), (1 / s**2).real])
    upper, lower = np.linalg.lstsq(basis, remainder.real, rcond=None)[0].reshape(2, *plain.at(s[:1]).shape[1:])
    return replace(bare, residuals=Residuals(upper, lower), delay=model.delay, physics=model.physics)


def without_delay(
    model: ModalModel, recordings: Sequence[BandRecording]
) -> tuple[ModalModel, tuple[BandRecording, ...]]:
    """Return a model without its delay, and recordings whose excitations are delayed instead."""
    if not model.delay:
        return model, tuple(recordings)
    return replace(model, delay=0.0), tuple(_later(recording, model.delay) for recording in recordings)


def _later(recording: BandRecording, delay: float) -> BandRecording:
    """Return a recording with delayed excitations (s); they are zero before the beginning."""
    n = len(recording.force)
    padded = scipy.fft.next_fast_len(n + int(2 * delay * recording.rate) + 64, real=True)
    turn = np.exp(-2j * np.pi * scipy.fft.rfftfreq(padded, 1 / recording.rate) * delay)[:, None]
    mean = recording.force.mean(axis=0)
    late = scipy.fft.irfft(scipy.fft.rfft(recording.force - mean, n=padded, axis=0) * turn, n=padded, axis=0)[:n]
    return replace(recording, force=np.asarray(late + mean))
