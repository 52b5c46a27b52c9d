"""Maps of residual power over noise power: frequency band x channel x recording."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation import WindowedSpectrum

from ..models import Fit, Hypothesis, fitted_noise, predict_lines, through_structure
from ..noise import whitening
from .band_means import band_means

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

BANDS_PER_OCTAVE = 6
LEAST_LINES = 12
"""Least number of lines of a band in every recording."""


@dataclass(frozen=True)
class ResidualMap:
    """Mean of ``|residual|^2`` over noise variance in cells; 1 where only noise is left.

    Parameters
    ----------
    edges : (n_bands + 1,), Hz
        Edges of the frequency bands.
    channels
        Names of the responses.
    recordings
        Names of the recordings, weakest force first.
    ratio : (n_recordings, n_bands, n_responses)
        Residual power of each channel over the variance of its own noise.
    joint : (n_recordings, n_bands)
        Mean residual power of all channels together, whitened.
    count : (n_recordings, n_bands)
        Independent complex lines of a cell of one channel.
    """

    edges: Real
    channels: tuple[str, ...]
    recordings: tuple[str, ...]
    ratio: Real
    joint: Real
    count: Real

    def pooled(self, axis: tuple[int, ...]) -> tuple[Real, Real]:
        """Return the means of ``ratio`` over ``axis``, weighted by the lines of the cells, and the number of lines."""
        weight = np.broadcast_to(self.count[:, :, None], self.ratio.shape)
        total = weight.sum(axis=axis)
        return np.asarray((self.ratio * weight).sum(axis=axis) / np.maximum(total, 1e-9)), np.asarray(total)

    def pooled_joint(self, axis: int) -> tuple[Real, Real]:
        """Return the weighted means of ``joint`` over ``axis``, and the number of lines of all channels."""
        total = self.count.sum(axis=axis)
        ratio = (self.joint * self.count).sum(axis=axis) / np.maximum(total, 1e-9)
        return np.asarray(ratio), np.asarray(total * len(self.channels))


def overlap(window: Real) -> float:
    """Return how many neighbouring lines of a windowed spectrum count as one, ``N sum w^4 / (sum w^2)^2``."""
    return float(len(window) * np.sum(window**4) / np.sum(window**2) ** 2)


def band_edges(lines: Sequence[WindowedSpectrum], per_octave: int = BANDS_PER_OCTAVE, least: int = LEAST_LINES) -> Real:
    """Return edges (Hz) of bands evenly wide on a logarithmic axis, each with ``least`` lines in every recording."""
    low = max(float(one.frequencies[0]) for one in lines)
    high = min(float(one.frequencies[-1]) for one in lines)
    fine = np.geomspace(low, high, max(2, round(per_octave * np.log2(high / low)) + 1))
    step = max(one.recording.rate / len(one.window) for one in lines)
    edges = [fine[0]]
    for edge in fine[1:]:
        if edge - edges[-1] >= least * step:
            edges.append(edge)
    if len(edges) < 2:
        return np.array([low, high])
    edges[-1] = fine[-1]
    return np.array(edges)


def normalised(
    hypothesis: Hypothesis, reference: Fit, number: int, lines: WindowedSpectrum
) -> tuple[Complex, Complex, Real]:
    """Return the residual lines of one recording in units of the noise.

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

    Returns
    -------
    single, white : (n_lines, n_responses)
        Residual with each channel divided by its own noise, and with all channels whitened together.
    variance : (n_lines, n_responses)
        Variance of the noise of each line and channel.
    """
    rest = lines.measured - predict_lines(hypothesis, lines).response
    through = through_structure(reference.hypothesis, lines)
    covariance = fitted_noise(lines, through, reference.noises[number])
    variance = np.real(np.einsum("kii->ki", covariance))
    return rest / np.sqrt(variance), np.einsum("kij,kj->ki", whitening(covariance), rest), variance


def residual_map(hypothesis: Hypothesis, reference: Fit, lines: Sequence[WindowedSpectrum], edges: Real) -> ResidualMap:
    """Return the map of one hypothesis's residual over all recordings, with the noise of ``reference``."""
    ratio, joint, count = [], [], []
    for number, one in enumerate(lines):
        single, white, _ = normalised(hypothesis, reference, number, one)
        alone, held = band_means(one.frequencies, np.abs(single) ** 2, edges)
        together, _ = band_means(one.frequencies, np.abs(white) ** 2, edges)
        ratio.append(np.where(held[:, None] > 0, alone, 1.0))
        joint.append(np.where(held[:, None] > 0, together, 1.0).mean(axis=1))
        count.append(held / overlap(one.window))
    first = lines[0]
    names = first.recording.channels[-first.measured.shape[1] :]
    return ResidualMap(
        edges, names, tuple(one.recording.name for one in lines), np.array(ratio), np.array(joint), np.array(count)
    )
