"""Noise of force spectra: a smooth floor under the orders, and the error of a right model."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .spectra import ForceSpectra

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

WIDTH = 1.5
"""Width over which the floor is smooth, in spindle frequencies: orders fill less than half of it."""

ODD = 9.0
"""Power over the floor beyond which a spectral line says nothing of the correlation between the channels' noise."""


@dataclass(frozen=True)
class ForceNoise:
    """Noise of the force spectra of one recording.

    Parameters
    ----------
    floor : (n_lines, n_axes)
        Variance of each spectral line, N^2.
    together : (n_axes, n_axes)
        Correlation of the channels' noise.
    whitener : (n_blocks, n_lines, n_axes, n_axes)
        Matrix W with ``W V W^H = 1``, where V is the covariance of noise and of the model's usual error, 1/N.
    """

    floor: Real
    together: Real
    whitener: Real


def noise_of(spectra: ForceSpectra, residual: Complex, predicted: Complex, error: float) -> ForceNoise:
    """Noise from what a fit with all causes leaves.

    ``V = D R D + B e^2 diag |F|^2``. D^2 is the running median of the residual's power over blocks and neighbouring
    lines, over ln 2. R is one correlation of the channels. e is the share by which each line F of a right computed
    force is still off. This error repeats from block to block: B times its square in each of B blocks tells as much
    as once in their mean.

    Parameters
    ----------
    spectra
        Spectra of the recording.
    residual, predicted : (n_blocks, n_lines, n_axes)
        Spectra that the fit leaves and that it predicts, N.
    error
        Share e by which each line of a right computed force is still off.
    """
    power = np.abs(residual) ** 2
    floor = _running_median(power, spectra) / np.log(2)
    scaled = residual / np.sqrt(floor)
    plain = scaled[(np.abs(scaled) ** 2 < ODD).all(axis=-1)]
    together = np.real(plain.T @ plain.conj()) / max(len(plain), 1)
    size = np.sqrt(np.maximum(np.diag(together), 1e-12))
    together = together / np.outer(size, size)
    together = 0.98 * together + 0.02 * np.eye(len(size))
    spread = np.sqrt(floor)
    smooth = spread[:, :, None] * together * spread[:, None, :]
    own = spectra.blocks * error**2 * np.abs(predicted) ** 2
    covariance = smooth[None] + own[..., None] * np.eye(len(size))
    return ForceNoise(floor, together, np.linalg.inv(np.linalg.cholesky(covariance)))


def _running_median(power: Real, spectra: ForceSpectra) -> Real:
    """Median over blocks and lines about each line, (n_lines, n_axes)."""
    spacing = float(spectra.frequencies[1] - spectra.frequencies[0])
    rotation = spectra.recording.law.speed / (2 * np.pi)
    half = max(4, round(0.5 * WIDTH * rotation / spacing))
    count = power.shape[1]
    centres = np.unique(np.clip(np.arange(0, count + half, max(1, half // 2)), 0, count - 1))
    medians = []
    for centre in centres:
        low = int(np.clip(centre - half, 0, max(count - 2 * half - 1, 0)))
        medians.append(np.median(power[:, low : low + 2 * half + 1], axis=(0, 1)))
    logs = np.log(np.maximum(np.array(medians), 1e-30))
    columns = [np.interp(np.arange(count), centres, logs[:, c]) for c in range(power.shape[2])]
    return np.asarray(np.exp(np.stack(columns, axis=-1)))


def whitened(noise: ForceNoise, residual: Complex) -> Complex:
    """``W r``, (n_blocks, n_lines, n_axes): pure noise has the mean power 1 in each.

    Parameters
    ----------
    noise
        Noise of the recording.
    residual : (n_blocks, n_lines, n_axes)
        Measured less predicted spectra r, N.
    """
    return np.asarray(np.einsum("bkpq,bkq->bkp", noise.whitener, residual))
