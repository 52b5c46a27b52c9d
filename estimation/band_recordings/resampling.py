"""Samples brought down to what a band needs: one low-pass filter, block by block, for every reader of recordings.

The filter is a linear-phase FIR filter with a Kaiser window. It is flat to 1e-4 up to 80 % of the new Nyquist frequency
and holds back by 90 dB what would fold into that band (Oppenheim & Schafer, Discrete-Time Signal Processing, 3rd ed.,
sections 4.6 and 7.5.3). Forces and responses pass the same filter and no sample leans on data outside the record, so a
linear relation between them holds afterwards as it did before.
"""

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

Real = NDArray[np.float64]

_STOPBAND_DB = 90.0
_PASS_SHARE = 0.8  # of the new Nyquist frequency; the transition band lies above

WORTH_IT = 1.5
"""Times the needed rate from which :func:`needed_ratio` resamples; below, a filter costs more than it saves."""

FINEST = 200
"""Largest denominator of a ratio: the new rate is within half a per cent of the needed one, at 29 taps a unit."""


def widest_band(sample_rate: float) -> float:
    """Highest frequency (Hz) that a recording of ``sample_rate`` (Hz) can keep flat: 80 % of its Nyquist frequency.

    Analysers sample at 2.56 times their span, 0.39 of the rate, which lies inside.

    Examples
    --------
    >>> widest_band(2.56 * 1000.0) > 1000.0
    True
    """
    return _PASS_SHARE * sample_rate / 2


def whole_ratio(sample_rate: float, highest_frequency: float) -> Fraction:
    """New over old sample rate: one over a whole number, so that a band stays flat and every test has the same rate.

    Parameters
    ----------
    sample_rate
        Sample rate of the recording, Hz.
    highest_frequency
        Upper end of the band, Hz.

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


def needed_ratio(sample_rate: float, needed: float, finest: int = FINEST) -> Fraction:
    """New over old sample rate so that little more than a needed rate is kept; 1 where that saves little.

    A whole number would keep up to twice the needed samples. What simulates a recording sample by sample takes as much
    longer.

    Parameters
    ----------
    sample_rate
        Sample rate of the recording, Hz.
    needed
        Rate that is enough, Hz.
    finest
        Largest denominator: the filter grows with it.

    Examples
    --------
    >>> needed_ratio(1000.0, 400.0), needed_ratio(500.0, 400.0)
    (Fraction(2, 5), Fraction(1, 1))
    """
    if sample_rate <= WORTH_IT * needed:
        return Fraction(1)
    return max(Fraction(needed / sample_rate).limit_denominator(finest), Fraction(1, finest))


class Resampler:
    """Low-pass filter and change of rate of samples that arrive block by block.

    Parameters
    ----------
    sample_rate
        Rate of the samples that come, Hz.
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
        self._held: Real | None = None
        self._phase = 0  # of the next output's first tap behind the first held sample, in steps of 1 / up samples

    @property
    def start(self) -> float:
        """Time of the first sample that comes out after the first that went in: half the filter's length, s."""
        return (len(self._taps) - 1) / 2 / (self.rate * self._down)

    def _low_pass(self, fine_rate: float) -> Real:
        """Taps at ``up`` times the sample rate (Hz)."""
        if self._down == 1:
            return np.ones(1)
        from scipy.signal import firwin, kaiserord  # here, because scipy.signal alone takes 75 MB

        # aliases may fall between the flat band and the new Nyquist frequency, never below
        transition = 2 * (self.rate / 2 - widest_band(self.rate))
        length, beta = kaiserord(_STOPBAND_DB, transition / (fine_rate / 2))
        taps = firwin(length | 1, self.rate / 2, window=("kaiser", beta), fs=fine_rate)
        return np.asarray(taps if self._up == 1 else self._up * taps)

    def add(self, samples: Real) -> Real:
        """Take the next samples (n, n_channels); return the resampled ones that are complete by now."""
        if self._down == 1:
            return samples
        from scipy.signal import upfirdn

        held = samples if self._held is None else np.concatenate([self._held, samples])
        n_out = max(0, ((len(held) - 1) * self._up - self._phase - len(self._taps) + 1) // self._down + 1)
        if n_out == 0:
            self._held = held
            return np.empty((0, samples.shape[1]))
        last = self._phase + (n_out - 1) * self._down + len(self._taps) - 1
        # rolled so that complete sums stand at multiples of ``down``
        ahead = self._phase + len(self._taps) - 1
        shift = (-ahead * pow(self._up, -1, self._down)) % self._down
        padded = np.concatenate([np.zeros((shift, held.shape[1])), held[: last // self._up + 1]])
        filtered = upfirdn(self._taps, padded, self._up, self._down, axis=0)
        first = (shift * self._up + ahead) // self._down
        whole, self._phase = divmod(self._phase + n_out * self._down, self._up)
        self._held = held[whole:]
        return np.asarray(filtered[first : first + n_out])


def resampled(samples: Real, sample_rate: float, ratio: Fraction) -> tuple[Real, float]:
    """Samples (n, n_channels) in memory at another rate, and that rate (Hz)."""
    resampler = Resampler(sample_rate, ratio)
    return resampler.add(samples), resampler.rate
