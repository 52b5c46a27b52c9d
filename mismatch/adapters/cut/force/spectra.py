"""`ForceSpectra`: windowed spectra of the forces of one recording; measured and computed forces are treated alike."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import prev_fast_len, rfft
from scipy.signal.windows import tukey

from ..recordings import MOST_ORDERS, CutRecording

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

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
        window = tukey(self.size * fine, 0.1, sym=False)
        window = window / np.sqrt(np.sum(window[::fine] ** 2)) / fine
        kept = force[self.first * fine : (self.first + self.size * self.blocks) * fine]
        parts = kept.reshape(self.blocks, self.size * fine, -1) * window[None, :, None]
        return np.asarray(rfft(parts, axis=1)[:, self.band])


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
    size = prev_fast_len(kept // blocks, real=True)
    axis = np.arange(size // 2 + 1) * recording.rate / size
    top = min(0.4 * recording.rate, (MOST_ORDERS + 0.5) * teeth * rotation)
    band = np.flatnonzero((axis >= max(2.5 * recording.corner, 3 * recording.rate / size)) & (axis <= top))
    stub = ForceSpectra(recording, run_in, size, blocks, band, axis[band], np.zeros((0, 0, 0), dtype=complex))
    return ForceSpectra(recording, run_in, size, blocks, band, axis[band], stub.of(recording.force))
