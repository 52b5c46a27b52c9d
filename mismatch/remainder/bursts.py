"""Does what is left come in bursts? Noise is even in time; blows, dropouts and sparks are not."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, rfft, rfftfreq
from scipy.signal import welch
from scipy.signal.windows import tukey
from scipy.stats import gamma

from estimation import WindowedSpectrum

from ..models import Hypothesis
from .rest_in_time import shown_and_left

Real = NDArray[np.float64]

BLOCK, ENDS, FEWEST = 0.25, 2, 24
"""Length of a block, s; blocks at either end that are faded out and do not count; least number that tells."""

SEGMENT = 2.0
"""Length of the segments whose median gives the spectrum of what is left, s: bursts do not move a median."""

CHANCE, CLEARLY = 1e-4, 4.0
"""Probability that noise makes any burst in a response, and least power of a burst over the median block's."""

WITH_SIGNAL = 2.0
"""Power of the prediction in a block, over the median block's, above which a burst may come from the signal."""

SHARE = 0.1
"""Share of the power that is left, beyond the even noise, from which bursts are told."""


@dataclass(frozen=True)
class Bursts:
    """Bursts in what is left of one recording.

    Parameters
    ----------
    name
        Name of the recording.
    share
        Share of the power of the whitened residual that is in bursts, of the response that shows most.
    count, blocks
        Number of blocks of a quarter of a second that burst, and of all.
    at
        Middle of the strongest, s from the recording's beginning.
    """

    name: str
    share: float
    count: int
    blocks: int
    at: float

    @property
    def sentence(self) -> str:
        """What a reader is told."""
        return (
            f"what is left of {self.name} comes in bursts: {self.count} of {self.blocks} quarters of a second hold "
            f"{100 * self.share:.0f} % of its power, the strongest at {self.at:.1f} s. Noise is even: look there for "
            "blows, dropouts, or a plug that is loose"
        )


def bursts_left(hypothesis: Hypothesis, recordings: list[WindowedSpectrum]) -> tuple[Bursts, ...]:
    """Recordings of which a hypothesis leaves bursts that the signal does not make.

    The residual is whitened by the median of its spectra over segments, and its power is taken in blocks of time.
    Powers of Gaussian noise of the bandwidth B are gamma variables with ``B T`` as their shape, T being the length of
    a block. A block bursts that is stronger than noise makes any, and in which the prediction is no stronger than
    usual.

    Parameters
    ----------
    hypothesis
        The hypothesis that would be told.
    recordings
        Windowed lines of the recordings.
    """
    return tuple(found for one in recordings if (found := _bursts(hypothesis, one)) is not None)


def _bursts(hypothesis: Hypothesis, one: WindowedSpectrum) -> Bursts | None:
    """Bursts of the response that shows most of them; None where they hold little."""
    rate = one.recording.rate
    shown, rest = shown_and_left(hypothesis, one)
    length = max(int(BLOCK * rate), 1)
    if len(rest) // length < FEWEST + 2 * ENDS:
        return None
    band = float(one.frequencies[0]), float(one.frequencies[-1])
    powers = _block_powers(_whitened(rest, rate, band), length)
    signal = _block_powers(shown, length)
    bursts = (powers > _limit(band, len(powers))) & (signal <= WITH_SIGNAL * np.median(signal, axis=0))
    shares = np.sum(np.where(bursts, powers - 1.0, 0.0), axis=0) / powers.sum(axis=0)
    worst = int(np.argmax(shares))
    if shares[worst] < SHARE:
        return None
    strongest = int(np.argmax(np.where(bursts[:, worst], powers[:, worst], 0.0)))
    at = (one.start + (strongest + ENDS + 0.5) * length) / rate
    return Bursts(one.recording.name, float(shares[worst]), int(bursts[:, worst].sum()), len(powers), at)


def _whitened(rest: Real, rate: float, band: tuple[float, float]) -> Real:
    """What is left (n, n_responses) in the band, divided by the square root of its median spectrum.

    It fades in and out: what lies beyond the band, where nothing is modelled, would leak into it from sharp ends.
    """
    axis, density = welch(
        rest, rate, nperseg=min(int(SEGMENT * rate), len(rest)), detrend=False, average="median", axis=0
    )
    lines = rfftfreq(len(rest), 1 / rate)
    inside = (lines >= band[0]) & (lines <= band[1])
    level = np.stack([np.interp(lines, axis, column) for column in density.T], axis=1)
    faded = rest * tukey(len(rest), 2 * ENDS * BLOCK * rate / len(rest))[:, None]
    white = rfft(faded, axis=0) / np.sqrt(np.maximum(level, 1e-12 * density.max(axis=0)))
    return np.asarray(irfft(white * inside[:, None], n=len(rest), axis=0))


def _block_powers(signal: Real, length: int) -> Real:
    """Power of each block (n_blocks, n_responses) over that of the median block, without those at the ends."""
    count = len(signal) // length
    powers = np.mean(signal[: count * length].reshape(count, length, -1) ** 2, axis=1)[ENDS : count - ENDS]
    return np.asarray(powers / np.maximum(np.median(powers, axis=0), 1e-300))


def _limit(band: tuple[float, float], blocks: int) -> float:
    """Power over the median block's above which noise of a bandwidth makes none of so many blocks."""
    shape = max((band[1] - band[0]) * BLOCK, 0.5)
    return max(float(gamma.isf(CHANCE / blocks, shape) / gamma.ppf(0.5, shape)), CLEARLY)
