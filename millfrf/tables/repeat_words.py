"""What `inspect` says of forces that repeat: the period, the noise between periods, the distortion."""

import numpy as np

from acquisition import Stream, aligned_samples
from estimation import (
    EXCITING,
    RESPONDING,
    BandRecording,
    SteadyPeriods,
    distortion,
    excited_lines,
    find_repeats,
    noise_of_periods,
    steady_periods,
)
from millfrf.core import InputError

MOST_VALUES = 1e7
"""Samples times channels up to which a recording is looked at for periods: the whole of it is held in memory."""

FEWEST_LINES = 10
"""Excited lines from which distortion is told: a few harmonics of a cut are no multisine."""


def repeats_in_words(stream: Stream) -> tuple[str, ...]:
    """Sentences about the periods of a stream's forces; none where these do not repeat.

    Parameters
    ----------
    stream
        Samples of an open recording.
    """
    forces = [one for one in stream.channels if one.quantity in EXCITING]
    motions = [one for one in stream.channels if one.quantity in RESPONDING]
    if not forces or not motions or stream.n_samples * (len(forces) + len(motions)) > MOST_VALUES:
        return ()
    samples = aligned_samples(stream, [one.name for one in (*forces, *motions)])
    m = len(forces)
    repeated = find_repeats(samples[:, :m]) if np.isfinite(samples).all() else None
    if repeated is None:
        return ()
    recording = BandRecording(
        stream.name, stream.sample_rate, samples[:, :m], samples[:, m:], tuple(forces), tuple(motions)
    )
    try:
        periods = steady_periods([recording], repeated)
    except InputError:  # no two whole periods between the edges of the interpolation
        return ()
    if not excited_lines(periods).any():
        return ()
    return (_noise_in_words(periods), *_distortion_in_words(periods))


def _noise_in_words(periods: SteadyPeriods) -> str:
    driven = periods.frequencies[excited_lines(periods)]
    band = (float(driven.min()), float(driven.max()))
    noise = noise_of_periods(periods.within(band))
    channels = (*periods.responses, *periods.excitations)
    shares = (*noise.response_share, *noise.force_share)
    said = ", ".join(f"{100 * share:.2g} % of {one.name}" for share, one in zip(shares, channels, strict=True))
    what = " and ".join(sorted({one.quantity for one in periods.excitations}))
    return (
        f"the {what} repeats every {periods.period:.6g} s; noise of one period, {band[0]:.4g} to {band[1]:.4g} Hz: "
        f"{said}. {noise.statement}"
    )


def _distortion_in_words(periods: SteadyPeriods) -> tuple[str, ...]:
    if excited_lines(periods).sum() < FEWEST_LINES:
        return ()
    try:
        found = distortion(periods)
    except InputError:  # too few realisations to tell several forces apart
        return ()
    if found.classes or found.stochastic is not None:
        return found.sentences() or ("no distortion beyond noise at lines that were not excited",)
    return ()
