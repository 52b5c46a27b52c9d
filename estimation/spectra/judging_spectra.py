"""Spectra of recordings that are used without segments, by which their inputs are judged as everywhere."""

from collections.abc import Sequence

from ..band_recordings import BandRecording
from .spectral_accumulator import SpectralAccumulator
from .spectral_matrix import CrossSpectra
from .windows import settings_for

LONGEST = 8.0
"""Longest segment, s: longer ones leave too few averages, and inputs that depend on each other would not show."""

LEAST = 8
"""Fewest samples in a segment."""


def spectra_for_judging(recordings: Sequence[BandRecording]) -> tuple[CrossSpectra, ...]:
    """Average Welch spectra of each recording, in segments so long that each input can have a segment of its own.

    Parameters
    ----------
    recordings
        Recordings of one set-up, at least one.
    """
    n_inputs = len(recordings[0].excitations)
    shortest = min(one.duration for one in recordings)
    seconds = min(LONGEST, shortest, shortest * len(recordings) / (2 * n_inputs))
    return tuple(_averaged(one, max(seconds, LEAST / one.rate)) for one in recordings)


def _averaged(recording: BandRecording, seconds: float) -> CrossSpectra:
    """Spectra in segments of some seconds."""
    settings = settings_for(recording.rate, seconds, window="hann")
    accumulator = SpectralAccumulator(recording.excitations, recording.responses, recording.rate, settings)
    accumulator.add(recording.force, recording.response)
    return accumulator.finish()
