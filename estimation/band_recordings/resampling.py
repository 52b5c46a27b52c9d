"""Resampling to the rate that a band needs, with one low-pass filter, block by block."""

from fractions import Fraction

import numpy as np

from acquisition import Stream
from millfrf.core import InputError, Real, allowed_bytes, require_memory

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


def require_room(stream: Stream, n_channels: int, bytes_a_value: float, ratio: float = 1.0) -> None:
    """Refuse a recording that takes more memory than is allowed, before it is read.

    Parameters
    ----------
    stream
        Samples of an open recording.
    n_channels
        Number of channels that are read.
    bytes_a_value : bytes
        Largest memory that the job takes for each value that is kept.
    ratio
        Rate that is kept over that of the recording.

    Raises
    ------
    InputError
        It is too long; the line says how long it may be.
    """
    needed = bytes_a_value * stream.n_samples * ratio * n_channels
    longest = 0.99 * stream.duration * allowed_bytes() / max(needed, 1.0)
    name = stream.path.name
    require_memory(
        needed,
        f"{name}, {stream.duration:.4g} s of {n_channels} channels",
        f"cut a part of at most {longest:.0f} s out with 'millfrf convert {name} part.h5 --span 0 {longest:.0f}'",
    )


QUIET_FORCE = 0.02
"""Share of its largest value up to which a force has not begun."""

QUIET_RESPONSE = 0.02
"""Power of a response before the first force, over its mean power, up to which the structure was at rest."""

QUIET_SAMPLES, QUIET_SECONDS = 16, 0.02
"""Least length of a quiet beginning: a motion that happens to pass zero is not quiet for so long."""

BLOW = 0.1
"""Share of the samples in which there is any force, up to which they are blows of a hammer."""

FIRST = 0.05
"""Largest response before a blow, over the largest of all, with which it hit a structure at rest; while the blow rises
its share of its largest value is added."""


def starts_at_rest(force: Real, response: Real, rate: float) -> bool:
    """Tell from the data whether a structure was at rest when a recording began.

    Either the recording begins quietly (pre-trigger): forces have not begun for a while, and what responds there has
    little of the power that it has later. Or it holds blows of a hammer, and before the first one, which may be at the
    very beginning, nothing had moved.

    Parameters
    ----------
    force : (n_samples, n_excitations)
        Samples of the forces, any offset included.
    response : (n_samples, n_responses)
        Samples of the responses, any offset included.
    rate
        Sample rate, Hz.

    Examples
    --------
    >>> blow = np.zeros((1000, 1)); blow[1] = 1.0
    >>> ring = np.exp(-np.arange(1000) / 100) * np.sin(0.3 * np.arange(1000))
    >>> starts_at_rest(blow, ring[:, None], 1000.0), starts_at_rest(blow, ring[5:, None], 1000.0)
    (True, False)
    """
    driven, moved = (np.abs(one - np.median(one, axis=0)) for one in (force, response))
    if not (driven.max(axis=0).any() and moved.any()):
        return False
    pushing = (driven > QUIET_FORCE * driven.max()).any(axis=1)
    first = int(np.argmax(pushing))
    if first >= max(QUIET_SAMPLES, QUIET_SECONDS * rate):
        before, whole = (np.mean(part**2, axis=0) for part in (moved[:first], moved))
        return bool((before <= QUIET_RESPONSE * whole).all())
    # an acceleration follows the blow at once, and only as far as the blow has risen
    risen = FIRST + driven[: first + 1].max(axis=1, keepdims=True) / driven.max()
    return bool(np.mean(pushing) < BLOW and (moved[: first + 1] <= risen * moved.max(axis=0)).all())
