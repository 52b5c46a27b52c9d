"""Maps of residual power over noise power in blocks of time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, rfft
from scipy.signal.windows import hann

from estimation import WindowedSpectrum

from ..models import Fit, Hypothesis, fitted_noise, predict_lines, through_structure
from ..noise import whitening
from .band_means import band_means
from .residual_maps import overlap

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

BLOCKS = 24
"""Most blocks of a recording."""

LEAST_PERIODS = 6.0
"""Least length of a block, in periods of the lowest frequency."""


@dataclass(frozen=True)
class BlockResidual:
    """Short spectra of one recording's residual, whitened by the noise.

    Parameters
    ----------
    recording
        Name of the recording.
    times : (n_blocks + 1,), s
        Edges of the blocks, from the beginning of the recording.
    frequencies : (n_lines,), Hz
        Frequencies of the lines of a block.
    power : (n_blocks, n_lines)
        Mean residual power over the responses, 1 where only noise is left.
    channels
        Number of responses.
    overlap
        Number of neighbouring lines that count as one.
    """

    recording: str
    times: Real
    frequencies: Real
    power: Real
    channels: int
    overlap: float

    def banded(self, edges: Real) -> tuple[Real, Real]:
        """Return mean power (n_blocks, n_bands) and independent lines (n_bands,) in bands; nan in empty bands."""
        means, held = band_means(self.frequencies, self.power.T, edges)
        return means.T, np.asarray(held * self.channels / self.overlap)


def block_residual(hypothesis: Hypothesis, reference: Fit, number: int, lines: WindowedSpectrum) -> BlockResidual:
    """Return the residual of a hypothesis block by block, without the lines that a mended tone has removed.

    Parameters
    ----------
    hypothesis
        Hypothesis about the structure whose residual is taken.
    reference
        Fit whose noise is the unit.
    number
        Place of the recording in that fit, from 0.
    lines
        Windowed spectrum of the recording.
    """
    rate, n = lines.recording.rate, len(lines.recording.force)
    rest = _kept(lines, lines.recording.response - lines.signal(predict_lines(hypothesis, lines).spectrum))
    rest = rest[lines.start : n - max(int(rate) // 2, 1)]
    length = int(rate * max(len(rest) / rate / BLOCKS, LEAST_PERIODS / lines.frequencies[0]))
    length = max(16, min(length, len(rest)))
    count = len(rest) // length
    window = hann(length, sym=False)
    window /= np.sqrt(np.sum(window**2))
    axis = np.arange(length // 2 + 1) * rate / length
    inside = (axis >= lines.frequencies[0]) & (axis <= lines.frequencies[-1])
    blocks = rest[: count * length].reshape(count, length, -1)
    spectra = rfft(blocks * window[:, None], axis=1)[:, inside]
    white = _whitening_at(reference, number, lines, axis[inside])
    small = np.einsum("kij,bkj->bki", white, spectra)
    times = (lines.start + length * np.arange(count + 1)) / rate
    power = np.mean(np.abs(small) ** 2, axis=2)
    return BlockResidual(lines.recording.name, times, axis[inside], power, rest.shape[1], overlap(window))


def _kept(lines: WindowedSpectrum, rest: Real) -> Real:
    """Return the residual without the frequencies in the gaps between the lines that are compared."""
    step = lines.recording.rate / len(lines.window)
    if not (np.diff(lines.frequencies) > 1.5 * step).any():
        return rest
    axis = np.arange(len(rest) // 2 + 1) * lines.recording.rate / len(rest)
    right = np.clip(np.searchsorted(lines.frequencies, axis), 1, len(lines.frequencies) - 1)
    gap = lines.frequencies[right] - lines.frequencies[right - 1]
    between = (gap > 1.5 * step) & (axis > lines.frequencies[right - 1]) & (axis < lines.frequencies[right])
    return np.asarray(irfft(rfft(rest, axis=0) * ~between[:, None], n=len(rest), axis=0))


def _whitening_at(reference: Fit, number: int, lines: WindowedSpectrum, axis: Real) -> Complex:
    """Return the whitening at other frequencies, from the mean of the noise's covariance over the nearest lines."""
    through = through_structure(reference.hypothesis, lines)
    covariance = fitted_noise(lines, through, reference.noises[number])
    nearest = np.clip(np.searchsorted(0.5 * (axis[1:] + axis[:-1]), lines.frequencies), 0, len(axis) - 1)
    held = np.maximum(np.bincount(nearest, minlength=len(axis)), 1)
    mean = np.zeros((len(axis), *covariance.shape[1:]), dtype=complex)
    np.add.at(mean, nearest, covariance)
    mean /= held[:, None, None]
    empty = np.bincount(nearest, minlength=len(axis)) == 0
    if empty.any():
        fullest = np.flatnonzero(~empty)
        mean[empty] = mean[fullest[np.argmin(np.abs(fullest[None] - np.flatnonzero(empty)[:, None]), axis=1)]]
    return whitening(mean)
