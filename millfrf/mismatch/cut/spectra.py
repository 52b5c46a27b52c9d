"""Windowed spectra of measured and computed forces, and their noise."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Complex, Real

from .recordings import MOST_ORDERS, CutRecording

TURNS = 16
"""Least revolutions of a block: so many spectral lines lie between neighbouring orders."""

MOST_BLOCKS = 16
"""Most blocks of a recording: half of them must still fit a cause."""


@dataclass(frozen=True)
class ForceSpectra:
    """Spectra of one recording in blocks of time.

    Parameters
    ----------
    recording
        Recording whose forces are transformed.
    first
        Sample at which the first block begins: earlier ones are the run-in.
    size, blocks
        Samples of a block, and number of blocks.
    band : (n_lines,)
        Numbers of the spectral lines that are compared.
    frequencies : (n_lines,), Hz
        Frequencies of these lines.
    measured : (n_blocks, n_lines, n_axes)
        Spectra of the measured forces, scaled so that white noise of variance v has variance v in each line.
    """

    recording: CutRecording
    first: int
    size: int
    blocks: int
    band: NDArray[np.int64]
    frequencies: Real
    measured: Complex

    def of(self, force: Real, fine: int = 1) -> Complex:
        """Spectra of other forces along the recording, (n_blocks, n_lines, n).

        Parameters
        ----------
        force : (n_samples * fine, n)
            Forces along the recording, N.
        fine
            Number of instants of the forces in each sample of the recording.
        """
        window = scipy.signal.windows.tukey(self.size * fine, 0.1, sym=False)
        window = window / np.sqrt(np.sum(window[::fine] ** 2)) / fine
        kept = force[self.first * fine : (self.first + self.size * self.blocks) * fine]
        parts = kept.reshape(self.blocks, self.size * fine, -1) * window[None, :, None]
        return np.asarray(scipy.fft.rfft(parts, axis=1)[:, self.band])


def force_spectra(recording: CutRecording, teeth: int) -> ForceSpectra:
    """Spectra of a recording without its run-in, and without its end, where integrated motion is not right.

    Parameters
    ----------
    recording
        Recording whose forces are transformed.
    teeth
        Number of teeth of its cutter.
    """
    rotation = recording.law.speed / (2 * np.pi)
    n = len(recording.force)
    run_in = min(int(recording.run_in * recording.rate), n // 4)
    margin = min(int(recording.rate / recording.corner), n // 16)
    kept = n - run_in - margin
    blocks = int(np.clip(kept * rotation / recording.rate // TURNS, 4, MOST_BLOCKS))
    size = scipy.fft.prev_fast_len(kept // blocks, real=True)
    axis = np.arange(size // 2 + 1) * recording.rate / size
    top = min(0.4 * recording.rate, (MOST_ORDERS + 0.5) * teeth * rotation)
    band = np.flatnonzero((axis >= max(2.5 * recording.corner, 3 * recording.rate / size)) & (axis <= top))
    stub = ForceSpectra(recording, run_in, size, blocks, band, axis[band], np.zeros((0, 0, 0), dtype=complex))
    return ForceSpectra(recording, run_in, size, blocks, band, axis[band], stub.of(recording.force))


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
