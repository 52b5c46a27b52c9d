"""Resampling to the rate that a band needs, with one low-pass filter, block by block."""

from fractions import Fraction

import numpy as np

from acquisition import Stream
from millfrf.core import InputError, Real, allowed_bytes, require_memory

from ..settings import RECORDINGS


def widest_band(sample_rate: float) -> float:
    """Return the highest frequency (Hz) up to which a recording of ``sample_rate`` (Hz) can be kept flat.

    It is 80 % of the Nyquist frequency.

    Analysers sample at 2.56 times their highest frequency, which is therefore below this limit.
    """
    return RECORDINGS.flat_share * sample_rate / 2


def whole_ratio(sample_rate: float, highest_frequency: float) -> Fraction:
    """Choose the ratio of new to old sample rate, 1 over a whole number, so that a band stays flat.

    Parameters
    ----------
    sample_rate : Hz
        Sample rate of the recording.
    highest_frequency : Hz
        Upper end of the band.

    Raises
    ------
    InputError
        The band reaches beyond 80 % of the Nyquist frequency.

    Examples
    --------
    >>> whole_ratio(1000.0, 40.0)
    Fraction(1, 10)
    """
    if not 0 < highest_frequency <= widest_band(sample_rate):
        raise InputError(
            f"band up to {highest_frequency:g} Hz does not fit a sample rate of {sample_rate:g} Hz; "
            f"stay below {widest_band(sample_rate):g} Hz"
        )
    return Fraction(1, max(1, int(widest_band(sample_rate) / highest_frequency)))


def needed_ratio(sample_rate: float, needed: float) -> Fraction:
    """Choose the ratio of new to old sample rate so that little more than a needed rate remains; 1 if it saves little.

    A ratio of one over a whole number would keep up to twice the needed samples, and a simulation of each sample would
    take twice as long.

    Parameters
    ----------
    sample_rate : Hz
        Sample rate of the recording.
    needed : Hz
        Rate that is enough.

    Examples
    --------
    >>> needed_ratio(1000.0, 400.0), needed_ratio(500.0, 400.0)
    (Fraction(2, 5), Fraction(1, 1))
    """
    if sample_rate <= RECORDINGS.worthwhile_ratio * needed:
        return Fraction(1)
    finest = RECORDINGS.largest_denominator  # the filter grows with it, by 29 taps a unit
    return max(Fraction(needed / sample_rate).limit_denominator(finest), Fraction(1, finest))


class Resampler:
    """Low-pass filter and change of rate of samples that arrive block by block.

    Parameters
    ----------
    sample_rate : Hz
        Rate of the samples that arrive.
    ratio
        New over old rate, at most 1: from :func:`whole_ratio` or :func:`needed_ratio`.

    Raises
    ------
    InputError
        A ratio that is not between 0 and 1.

    Examples
    --------
    >>> resampler = Resampler(1000.0, whole_ratio(1000.0, 40.0))
    >>> time = np.arange(4000) / 1000.0
    >>> low = resampler.add(np.sin(2 * np.pi * 10 * time)[:, None])
    >>> bool(abs(np.sqrt(2) * low.std() - 1) < 0.01)
    True
    """

    def __init__(self, sample_rate: float, ratio: Fraction) -> None:
        if not 0 < ratio <= 1:
            raise InputError(f"samples can be brought down, not up: ratio {ratio} is not between 0 and 1")
        self._up, self._down = ratio.numerator, ratio.denominator
        self.rate = sample_rate * self._up / self._down
        self._taps = self._low_pass(sample_rate * self._up)
        self._waiting: Real | None = None
        self._phase = 0  # from the first waiting sample to the next output's first tap, in steps of 1 / up samples

    @property
    def start(self) -> float:
        """Return the time from the first input sample to the first output sample, s."""
        return (len(self._taps) - 1) / 2 / (self.rate * self._down)

    def _low_pass(self, fine_rate: float) -> Real:
        """Return the taps of the low-pass at ``up`` times the sample rate, ``fine_rate`` (Hz)."""
        if self._down == 1:
            return np.ones(1)
        from scipy.signal import firwin, kaiserord  # not at the top: scipy.signal takes 75 MB

        # aliases may fall between the flat band and the new Nyquist frequency, never below
        transition = 2 * (self.rate / 2 - widest_band(self.rate))
        length, beta = kaiserord(RECORDINGS.stopband, transition / (fine_rate / 2))
        taps = firwin(length | 1, self.rate / 2, window=("kaiser", beta), fs=fine_rate)
        return np.asarray(taps if self._up == 1 else self._up * taps)

    def add(self, samples: Real) -> Real:
        """Add the next samples (n, n_channels) and return all further resampled samples that are complete."""
        if self._down == 1:
            return samples
        from scipy.signal import upfirdn  # not at the top: scipy.signal takes 75 MB

        waiting = samples if self._waiting is None else np.concatenate([self._waiting, samples])
        # outputs whose taps all lie on samples that have arrived
        n_out = max(0, ((len(waiting) - 1) * self._up - self._phase - len(self._taps) + 1) // self._down + 1)
        if n_out == 0:
            self._waiting = waiting
            return np.empty((0, samples.shape[1]))
        last = self._phase + (n_out - 1) * self._down + len(self._taps) - 1
        # zeros in front shift the samples, so that complete sums are found at multiples of ``down``
        ahead = self._phase + len(self._taps) - 1
        shift = (-ahead * pow(self._up, -1, self._down)) % self._down
        padded = np.concatenate([np.zeros((shift, waiting.shape[1])), waiting[: last // self._up + 1]])
        filtered = upfirdn(self._taps, padded, self._up, self._down, axis=0)
        first = (shift * self._up + ahead) // self._down
        n_done, self._phase = divmod(self._phase + n_out * self._down, self._up)
        self._waiting = waiting[n_done:]
        return np.asarray(filtered[first : first + n_out])


def resampled(samples: Real, sample_rate: float, ratio: Fraction) -> tuple[Real, float]:
    """Resample samples (n, n_channels) in memory; return them and the new rate (Hz)."""
    resampler = Resampler(sample_rate, ratio)
    return resampler.add(samples), resampler.rate


def require_room(stream: Stream, n_channels: int, bytes_a_value: float, ratio: float = 1.0) -> None:
    """Refuse a recording that takes more memory than is allowed, before it is read; the message states a remedy.

    Parameters
    ----------
    stream
        Samples of an open recording.
    n_channels
        Number of channels that are read.
    bytes_a_value : bytes
        Largest memory that the job takes for each value after resampling.
    ratio
        Sample rate after resampling over sample rate of the recording.
    """
    needed = bytes_a_value * stream.n_samples * ratio * n_channels
    longest = 0.99 * stream.duration * allowed_bytes() / max(needed, 1.0)
    name = stream.path.name
    require_memory(
        needed,
        f"{name}, {stream.duration:.4g} s of {n_channels} channels",
        f"cut a part of at most {longest:.0f} s out with 'millfrf convert {name} part.h5 --span 0 {longest:.0f}'",
    )
