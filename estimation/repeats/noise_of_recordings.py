"""The noise of recordings from the best that they offer: periods, repeats, silence, else an upper bound."""

from collections.abc import Sequence

from foundation import InputError

from ..band_recordings import BandRecording
from .cut_periods import steady_periods
from .noise_between_periods import noise_of_periods, noise_of_repeats, same_at_once
from .noise_type import MeasuredNoise
from .noise_without_repeats import noise_bound, noise_in_silence
from .period_search import find_repeats


def measured_noise(recordings: Sequence[BandRecording], band: tuple[float, float]) -> MeasuredNoise:
    """Measure the noise of recordings of one level by the first of these that they allow.

    Periods of the forces; recordings that repeat one force; stretches without force; else the upper bound of
    :func:`noise_bound`.

    Parameters
    ----------
    recordings
        Recordings of the same channels and sample rate.
    band : Hz
        Lowest and highest frequency of the lines.

    Raises
    ------
    InputError
        No recording, or a band in which none of these can be had.
    """
    if not recordings:
        raise InputError("no recording; give at least one")
    if all(find_repeats(one.force) is not None for one in recordings):
        return noise_of_periods(steady_periods(recordings).within(band))
    if same_at_once(recordings):
        return noise_of_repeats(recordings, band)
    return noise_in_silence(recordings, band) or noise_bound(recordings, band)
