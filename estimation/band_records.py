"""Records reduced to a low band: filtered and decimated block by block, forces and responses alike."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acquisition import Channel, Recording, aligned_blocks
from foundation import InputError

_STOPBAND_DB = 90.0
_PASS_SHARE = 0.8  # of the new Nyquist frequency; the transition band lies above


@dataclass(frozen=True)
class BandRecord:
    """Excitations and responses of one test at a low sample rate, filtered by the same linear-phase filter.

    A linear relation between excitation and response holds for the filtered samples as it did for the
    recorded ones, because both sides pass the same filter and no sample leans on data outside the record.

    Parameters
    ----------
    sample_rate : Hz
        Sample rate after decimation.
    usable_band : Hz
        Upper end of the flat, alias-free band.
    excitation_samples : (n_samples, n_excitations), SI
        Samples of the excitations, filtered and decimated.
    response_samples : (n_samples, n_responses), SI
        Samples of the responses, filtered and decimated.
    excitations, responses
        Channels along the columns.
    """

    sample_rate: float
    usable_band: float
    excitation_samples: NDArray[np.float64]
    response_samples: NDArray[np.float64]
    excitations: tuple[Channel, ...]
    responses: tuple[Channel, ...]


def widest_band(sample_rate: float) -> float:
    """Highest frequency (Hz) that a record of ``sample_rate`` (Hz) can keep flat: 80 % of its Nyquist frequency.

    Analysers sample at 2.56 times their span, 0.39 of the rate, which lies inside.

    Examples
    --------
    >>> widest_band(2.56 * 1000.0) > 1000.0
    True
    """
    return _PASS_SHARE * sample_rate / 2


class BandDecimator:
    """Low-pass filter and decimation of samples that arrive block by block.

    Parameters
    ----------
    sample_rate : Hz
        Sample rate of the samples that arrive.
    highest_frequency : Hz
        Upper end of the band that must stay flat (ripple below 1e-4).

    Raises
    ------
    InputError
        The band reaches beyond 80 % of the Nyquist frequency.

    Examples
    --------
    >>> decimator = BandDecimator(1000.0, 40.0)
    >>> time = np.arange(4000) / 1000.0
    >>> low = decimator.add(np.sin(2 * np.pi * 10 * time)[:, None])
    >>> bool(abs(np.sqrt(2) * low.std() - 1) < 0.01)
    True
    """

    def __init__(self, sample_rate: float, highest_frequency: float) -> None:
        if not 0 < highest_frequency <= widest_band(sample_rate):
            raise InputError(
                f"band up to {highest_frequency:g} Hz does not fit a sample rate of {sample_rate:g} Hz; "
                f"stay below {widest_band(sample_rate):g} Hz"
            )
        self.factor = max(1, int(widest_band(sample_rate) / highest_frequency))
        self.sample_rate = sample_rate / self.factor
        self.usable_band = widest_band(self.sample_rate)
        self._taps = self._low_pass(sample_rate)
        self._held: NDArray[np.float64] | None = None

    def _low_pass(self, sample_rate: float) -> NDArray[np.float64]:
        from scipy.signal import firwin, kaiserord  # here, because scipy.signal alone takes 75 MB

        if self.factor == 1:
            return np.ones(1)
        # aliases may fall between usable_band and the new Nyquist frequency, never below usable_band
        transition = 2 * (self.sample_rate / 2 - self.usable_band)
        length, beta = kaiserord(_STOPBAND_DB, transition / (sample_rate / 2))
        return np.asarray(firwin(length | 1, self.sample_rate / 2, window=("kaiser", beta), fs=sample_rate))

    def add(self, samples: NDArray[np.float64]) -> NDArray[np.float64]:
        """Take the next samples (n, n_channels); return the decimated ones that are complete by now."""
        from scipy.signal import upfirdn

        held = samples if self._held is None else np.concatenate([self._held, samples])
        n_out = max(0, (len(held) - len(self._taps)) // self.factor + 1) if len(held) >= len(self._taps) else 0
        if n_out == 0:
            self._held = held
            return np.empty((0, samples.shape[1]))
        span = held[: (n_out - 1) * self.factor + len(self._taps)]
        # rolled so that complete sums stand at multiples of the factor
        shift = (-(len(self._taps) - 1)) % self.factor
        padded = np.concatenate([np.zeros((shift, held.shape[1])), span])
        filtered = upfirdn(self._taps, padded, 1, self.factor, axis=0)
        first = (shift + len(self._taps) - 1) // self.factor
        self._held = held[n_out * self.factor :]
        return np.asarray(filtered[first : first + n_out])


def band_record(
    recording: Recording,
    highest_frequency: float,
    excitations: Sequence[Channel],
    responses: Sequence[Channel],
    *,
    stream: str | None = None,
    progress: Callable[[int], None] | None = None,
) -> BandRecord:
    """Read a recording once, block by block, and keep the band up to ``highest_frequency`` (Hz).

    Known input delays are taken out, and the channels of the result have none.

    Parameters
    ----------
    recording
        Open recording to read.
    highest_frequency : Hz
        Upper end of the band that must stay flat.
    excitations, responses
        Channels to keep.
    stream
        Name of the sample clock; None: the only one.
    progress
        Called with the number of samples read so far.

    Raises
    ------
    InputError
        The band does not fit the sample rate, or the record is shorter than the filter.
    """
    source = recording.stream(stream)
    decimator = BandDecimator(source.sample_rate, highest_frequency)
    names = [channel.name for channel in (*excitations, *responses)]
    pieces = []
    done = 0
    for block in aligned_blocks(source, names):
        pieces.append(decimator.add(block))
        done += len(block)
        if progress is not None:
            progress(done)
    samples = np.concatenate(pieces) if pieces else np.empty((0, len(names)))
    if len(samples) < 2:
        raise InputError(
            f"{recording.path}: {source.n_samples / source.sample_rate:.3g} s are too short for a band up to "
            f"{highest_frequency:g} Hz; record longer"
        )
    if not np.isfinite(samples).all():
        raise InputError(f"{recording.path}: samples hold NaN or infinity; mend or convert the recording")
    n = len(excitations)
    return BandRecord(
        decimator.sample_rate,
        decimator.usable_band,
        samples[:, :n],
        samples[:, n:],
        tuple(replace(channel, input_delay_s=None) for channel in excitations),
        tuple(replace(channel, input_delay_s=None) for channel in responses),
    )
