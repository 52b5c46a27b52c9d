"""Spectra of one recording on the lines that count, and predictions that are cut in exactly the same way."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Complex, Real

from .band_recording import BandRecording

if TYPE_CHECKING:
    from ..repeats.noise import MeasuredNoise


@dataclass(frozen=True)
class WindowedSpectrum:
    """A recording's window, its padded force spectrum and its measured lines.

    The whole recording is predicted. Its force is padded with zeros, so that the structure rings out, and ramped in
    over a second unless the recording begins at rest: then all its motion is of its own forces, and neither ramp nor
    run-in takes a blow at its beginning away. Then prediction and measurement are cut and windowed alike: nothing leaks
    that does not leak in both.

    Parameters
    ----------
    recording
        Forces and responses.
    padded
        Samples of the padded recording.
    start
        First sample compared, after the run-in.
    window : (n_kept,)
        Window of the samples compared; the sum of its squares is 1.
    band : (n_lines,)
        Which lines of the windowed spectrum are compared.
    frequencies : (n_lines,), Hz
        Frequencies of the lines that are compared.
    force_lines : (padded // 2 + 1, n_excitations)
        Spectrum of the ramped and padded force.
    force_here : (n_lines, n_excitations)
        Spectrum of the windowed force.
    trust : (n_lines, n_excitations, n_excitations)
        What the noise of the forces used is multiplied by: less than one where they were replaced by what they say of
        the true ones.
    measured : (n_lines, n_responses)
        Spectrum of the windowed response, scaled so that white noise of variance v has variance v a line.
    noise
        Noise that the recording shows without a model, in the band; None where it shows none.
    """

    recording: BandRecording
    padded: int
    start: int
    window: Real
    band: NDArray[np.int64]
    frequencies: Real
    force_lines: Complex
    force_here: Complex
    measured: Complex
    trust: Complex
    noise: "MeasuredNoise | None" = None

    @cached_property
    def padded_frequencies(self) -> Real:
        """Frequencies of ``force_lines``, Hz."""
        return np.asarray(np.arange(self.padded // 2 + 1) * self.recording.rate / self.padded)

    def thinned(self, enough: int) -> "WindowedSpectrum":
        """Every few lines, so that about ``enough`` are left; itself where it has no more."""
        every = len(self.frequencies) // enough
        if every < 2:
            return self
        return replace(
            self,
            band=self.band[::every],
            frequencies=self.frequencies[::every],
            force_here=self.force_here[::every],
            measured=self.measured[::every],
            trust=self.trust[::every],
        )

    def with_measured_forces(self) -> "WindowedSpectrum":
        """Forces as they were measured, where they were replaced."""
        n = len(self.window) + self.start
        return replace(
            self,
            force_lines=padded_force(self),
            force_here=self.cut(self.recording.force[:n]),
            trust=_full_trust(self.recording, len(self.band)),
        )

    def with_whole_forces(self) -> "WindowedSpectrum":
        """Forces that act from the first sample to the last; behind the recording they fade out, mirrored in time.

        A prediction of the whole recording needs them. A comparison does not see the ends, and fades the forces there.
        """
        force, fading = self.recording.force, _rising(self.recording)
        after = force[-2 : -2 - fading : -1] * _rise(fading)[::-1, None]
        padded = scipy.fft.next_fast_len(self.padded + fading, real=True)
        padded += padded % 2
        return replace(
            self, padded=padded, force_lines=np.asarray(scipy.fft.rfft(np.vstack([force, after]), n=padded, axis=0))
        )

    def between(self, first: float, last: float) -> "WindowedSpectrum":
        """The same recording compared in a part of its samples alone; it is still predicted from its beginning.

        Parameters
        ----------
        first, last
            Where the part begins and ends, as shares of the samples that are compared.
        """
        n, rate = len(self.window), self.recording.rate
        begin = int(first * n)
        window = _window(
            scipy.fft.prev_fast_len(int(last * n) - begin, real=True), self.recording.at_rest and begin == 0
        )
        axis = np.arange(len(window) // 2 + 1) * rate / len(window)
        slack = rate / n
        band = np.flatnonzero((axis >= self.frequencies[0] - slack) & (axis <= self.frequencies[-1] + slack))
        nearest = np.searchsorted(self.frequencies, axis[band]).clip(0, len(self.frequencies) - 1)
        part = replace(
            self, start=self.start + begin, window=window, band=band, frequencies=axis[band], trust=self.trust[nearest]
        )
        force = part.signal(self.force_lines)
        return replace(part, force_here=part.cut(force), measured=part.cut(self.recording.response))

    def cut(self, signal: NDArray[np.floating]) -> Complex:
        """Windowed lines (n_lines, n) of signals (n_samples or more, n) that begin with the recording."""
        kept = signal[self.start : self.start + len(self.window)]
        return np.asarray(scipy.fft.rfft(kept * self.window[:, None].astype(kept.dtype), axis=0)[self.band])

    def signal(self, spectrum: Complex) -> Real:
        """Time signals (n_samples, n) of padded spectra (padded // 2 + 1, n)."""
        return np.asarray(scipy.fft.irfft(spectrum, n=self.padded, axis=0)[: len(self.recording.force)])

    @cached_property
    def padded_kinematic(self) -> Complex:
        """Factor (padded // 2 + 1, n_responses) from displacement to each response's quantity."""
        return self.recording.kinematic(self.padded_frequencies)

    @cached_property
    def kinematic(self) -> Complex:
        """The same at the lines that are compared, (n_lines, n_responses)."""
        return self.recording.kinematic(self.frequencies)

    def from_force(self, receptance: Complex, force_lines: Complex) -> Complex:
        """Windowed response lines (n_lines, n_responses) of padded force lines through padded receptance lines."""
        response = np.einsum("kpq,kq->kp", receptance, force_lines) * self.padded_kinematic
        return self.cut(self.signal(response))


def windowed_spectrum(recording: BandRecording, band: tuple[float, float], decay: float) -> WindowedSpectrum:
    """Window a recording and transform it.

    Parameters
    ----------
    recording
        Forces and responses.
    band
        Lowest and highest frequency compared, Hz.
    decay
        Decay rate of the slowest mode, 1/s: run-in and padding last seven of its time constants, at most a fifth of it;
        a recording that begins at rest has no run-in.
    """
    n = len(recording.force)
    run_in = 0 if recording.at_rest else int(min(7.0 / decay * recording.rate, 0.2 * n))
    padded = scipy.fft.next_fast_len(n + int(min(7.0 / decay * recording.rate, 0.2 * n)), real=True)
    padded += padded % 2
    rising = _rising(recording)
    kept = scipy.fft.prev_fast_len(n - run_in - rising // 2, real=True)
    window = _window(kept, recording.at_rest)
    axis = np.arange(kept // 2 + 1) * recording.rate / kept
    lines = np.flatnonzero((axis >= max(band[0], 3 * recording.rate / kept)) & (axis <= band[1]))
    none, trust = np.zeros(0, dtype=complex), _full_trust(recording, len(lines))
    stub = WindowedSpectrum(recording, padded, run_in, window, lines, axis[lines], none, none, none, trust)
    return replace(stub.with_measured_forces(), measured=stub.cut(recording.response))


def _window(kept: int, at_rest: bool) -> Real:
    """Tapered window (kept,) whose squares sum to 1."""
    from scipy.signal.windows import tukey  # here, because scipy.signal alone takes 75 MB

    window = tukey(kept, 0.08)
    if at_rest:
        # nothing leaks from before, and a blow may stand here
        window[: kept // 2] = 1.0
    return np.asarray(window / np.sqrt(np.sum(window**2)))


def _full_trust(recording: BandRecording, count: int) -> Complex:
    """Give full weight to every line: the forces are taken as measured."""
    return np.tile(np.eye(recording.force.shape[1], dtype=complex), (count, 1, 1))


def _rising(recording: BandRecording) -> int:
    """Samples over which the force is ramped in and out."""
    return min(int(recording.rate), len(recording.force) // 20)


def _rise(count: int) -> Real:
    """Half a cosine from 0 to 1, (count,)."""
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.arange(count) / count))


def padded_force(spectrum: WindowedSpectrum) -> Complex:
    """Spectrum of the ramped and padded force."""
    ramp, rising = np.ones(len(spectrum.recording.force)), _rising(spectrum.recording)
    rise = _rise(rising)
    if not spectrum.recording.at_rest:
        ramp[:rising] = rise
    ramp[len(ramp) - rising :] = rise[::-1]
    return np.asarray(scipy.fft.rfft(spectrum.recording.force * ramp[:, None], n=spectrum.padded, axis=0))
