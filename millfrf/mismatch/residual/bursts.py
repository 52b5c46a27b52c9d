"""Residuals that come in bursts, and responses outside the modes of a model without a stated band."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real

from ..models.hypothesis import Hypothesis, predict_lines
from .structured_residual import shown_and_left

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
    axis, density = scipy.signal.welch(
        rest, rate, nperseg=min(int(SEGMENT * rate), len(rest)), detrend=False, average="median", axis=0
    )
    lines = scipy.fft.rfftfreq(len(rest), 1 / rate)
    inside = (lines >= band[0]) & (lines <= band[1])
    level = np.stack([np.interp(lines, axis, column) for column in density.T], axis=1)
    faded = rest * scipy.signal.windows.tukey(len(rest), 2 * ENDS * BLOCK * rate / len(rest))[:, None]
    white = scipy.fft.rfft(faded, axis=0) / np.sqrt(np.maximum(level, 1e-12 * density.max(axis=0)))
    return np.asarray(scipy.fft.irfft(white * inside[:, None], n=len(rest), axis=0))


def _block_powers(signal: Real, length: int) -> Real:
    """Power of each block (n_blocks, n_responses) over that of the median block, without those at the ends."""
    count = len(signal) // length
    powers = np.mean(signal[: count * length].reshape(count, length, -1) ** 2, axis=1)[ENDS : count - ENDS]
    return np.asarray(powers / np.maximum(np.median(powers, axis=0), 1e-300))


def _limit(band: tuple[float, float], blocks: int) -> float:
    """Power over the median block's above which noise of a bandwidth makes none of so many blocks."""
    shape = max((band[1] - band[0]) * BLOCK, 0.5)
    return max(float(scipy.stats.gamma.isf(CHANCE / blocks, shape) / scipy.stats.gamma.ppf(0.5, shape)), CLEARLY)


ASIDE = 1.3
"""Frequency over the highest mode (lowest mode over frequency) from which a line lies outside the modes."""

WINDOW = 32
"""Neighbouring lines over which a receptance is taken for constant."""

CLEAR = 0.25
"""Share of the response's power outside the modes that the model must lack for a doubt."""

NOT_SMALL = 1e-3
"""Least share of a channel's whole power that the power moved by forces outside the modes must be."""


def beyond_model(hypothesis: Hypothesis, lines: list[WindowedSpectrum]) -> tuple[str, ...]:
    """One doubt for each side of the modes where recordings show response that the model does not give.

    In windows of neighbouring lines the residual is regressed on the forces; what the forces explain beyond chance is
    response of the structure, not noise, and a model without modes there cannot know it.

    Parameters
    ----------
    hypothesis
        The model, refitted or not.
    lines
        Windowed lines of every recording that is compared.
    """
    model = hypothesis.model
    if model.band is not None:
        return ()
    natural = model.natural_frequencies
    sides = (
        (0.0, float(natural.min()) / ASIDE, "below the lowest mode"),
        (float(natural.max()) * ASIDE, np.inf, "above the highest mode"),
    )
    return tuple(said for low, high, place in sides if (said := _doubt(hypothesis, lines, (low, high), place)))


def _doubt(hypothesis: Hypothesis, lines: list[WindowedSpectrum], edges: tuple[float, float], place: str) -> str:
    """The sentence for one side; empty where nothing is missed there in half of the recordings."""
    lacking = []
    for one in lines:
        inside = (one.frequencies >= edges[0]) & (one.frequencies <= edges[1])
        if inside.sum() < 2 * WINDOW:
            return ""
        rest = (one.measured - predict_lines(hypothesis, one).response)[inside]
        moved = _moved_by_forces(rest, one.force_here[inside])
        here = np.sum(np.abs(one.measured[inside]) ** 2, axis=0)
        whole = np.sum(np.abs(one.measured) ** 2, axis=0)
        lacking.append(float(np.max(np.where(moved > NOT_SMALL * whole, moved / here, 0.0))))
    if np.median(lacking) < CLEAR:
        return ""
    low, high = max(edges[0], float(lines[0].frequencies[0])), min(edges[1], float(lines[0].frequencies[-1]))
    return (
        f"{place}, from {low:.3g} to {high:.3g} Hz, {100 * float(np.median(lacking)):.0f} % of the response's power "
        "moves with the forces and is not in the model, which states no band: it may have been fitted to a narrower "
        "one. Fit it again, or write band_hz into its file, and diagnose inside that band"
    )


def _moved_by_forces(rest: Complex, force: Complex) -> NDArray[np.float64]:
    """Power of a residual (n_lines, n_responses) that forces explain beyond chance, (n_responses,)."""
    total = np.zeros(rest.shape[1])
    count = force.shape[1]
    for rows in np.array_split(np.arange(len(rest)), max(1, len(rest) // WINDOW)):
        left = rest[rows] - force[rows] @ np.linalg.lstsq(force[rows], rest[rows], rcond=1e-6)[0]
        own, unmoved = (np.sum(np.abs(part) ** 2, axis=0) for part in (rest[rows], left))
        total += np.maximum(own - unmoved * len(rows) / max(len(rows) - count, 1), 0.0)
    return total
