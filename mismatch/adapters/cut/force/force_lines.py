"""Spectral lines of forces in blocks of time: measured and computed are cut alike."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import prev_fast_len, rfft
from scipy.signal.windows import tukey

from ..recordings.cut_recording import MOST_ORDERS, CutRecording

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

TURNS = 16
"""Revolutions of a block, at least: so many lines between neighbouring orders."""

MOST_BLOCKS = 16


@dataclass(frozen=True)
class ForceLines:
    """One recording in blocks.

    Parameters
    ----------
    recording
        What was cut.
    first
        Sample at which the first block begins: earlier ones are the run-in.
    size, blocks
        Samples of a block, and how many there are.
    band : (n_lines,)
        Which lines of a block are compared.
    frequencies : (n_lines,), Hz
    measured : (n_blocks, n_lines, n_axes)
        Scaled so that white noise of variance v has variance v a line.
    """

    recording: CutRecording
    first: int
    size: int
    blocks: int
    band: NDArray[np.int64]
    frequencies: Real
    measured: Complex

    def cut(self, force: Real, fine: int = 1) -> Complex:
        """Lines (n_blocks, n_lines, n) of forces (n_samples * fine, n) along the recording."""
        window = tukey(self.size * fine, 0.1, sym=False)
        window = window / np.sqrt(np.sum(window[::fine] ** 2)) / fine
        kept = force[self.first * fine : (self.first + self.size * self.blocks) * fine]
        parts = kept.reshape(self.blocks, self.size * fine, -1) * window[None, :, None]
        return np.asarray(rfft(parts, axis=1)[:, self.band])


def force_lines(recording: CutRecording, teeth: int) -> ForceLines:
    """Cut a recording: the run-in and the end, where an integral has no future, are left out.

    Parameters
    ----------
    recording
        Of a cutter with ``teeth``.
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
    stub = ForceLines(recording, run_in, size, blocks, band, axis[band], np.zeros((0, 0, 0), dtype=complex))
    return ForceLines(recording, run_in, size, blocks, band, axis[band], stub.cut(recording.force))
