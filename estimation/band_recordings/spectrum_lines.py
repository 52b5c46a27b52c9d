"""Windowed spectra of one recording, and predictions that are cut in exactly the same way."""

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Complex, Index, Real

from .band_recording import BandRecording

if TYPE_CHECKING:
    from ..repeats.noise import MeasuredNoise


TIME_CONSTANTS = 7.0  # length of run-in and padding in time constants: 0.1 % of a free decay remain

# longest padding, in lengths of the recording or in samples: more would only serve a mode without damping
MOST_PADDING, SHORT_PADDING = 4.0, 2**13

# root mean square of a free decay in the compared part, over that of the response there, from which the first motion
# must be estimated: no larger than the least error of sensors
REMAINING = 0.002


@dataclass(frozen=True)
class WindowedSpectrum:
    """A recording's window, its padded force spectrum and its measured lines.

    The whole recording is predicted. The force is padded with zeros, so that the structure rings out. Unless the
    recording begins at rest, the force is ramped up over a second and a run-in is left out; at rest this is not needed
    and would remove a blow at the beginning. Neither is done where modes ring on after the run-in and the caller
    estimates their motion at the first sample (`rings`). Prediction and measurement are cut and windowed in the same
    way, so that their leakage is the same.
    """

    recording: BandRecording
    padded: int  # samples of the padded recording
    start: int  # first sample compared, after the run-in
    window: Real  # (n_compared,); the sum of its squares is 1
    band: Index  # (n_lines,); indices of the lines of the windowed spectrum that are compared
    frequencies: Real  # (n_lines,), Hz
    force_lines: Complex  # (padded // 2 + 1, n_excitations); spectrum of the ramped and padded force
    force_here: Complex  # (n_lines, n_excitations); spectrum of the windowed force
    # (n_lines, n_responses); spectrum of the windowed response, scaled so that white noise of variance v has variance v
    # on a line
    measured: Complex
    # (n_lines, n_excitations, n_excitations); factor by which the noise of the forces counts: below one where the
    # measured forces were replaced by estimates of the true forces
    trust: Complex
    # noise measured from the recording without a model, in the band; None where it cannot be measured
    noise: "MeasuredNoise | None" = None
    # whether the force is ramped up: not at rest, and not where the motion at the first sample is estimated
    ramped: bool = True

    @cached_property
    def padded_frequencies(self) -> Real:
        """Return the frequencies of ``force_lines``, Hz."""
        return np.asarray(np.arange(self.padded // 2 + 1) * self.recording.rate / self.padded)

    def rings(self, poles: Complex) -> NDArray[np.bool_]:
        """Return for each pole, rad/s, whether the motion before the recording still rings in the compared part.

        Of a free decay with the rate ``d``, the root mean square ``exp(-d t0) sqrt((1 - exp(-2 d T)) / (2 d T))``
        remains in the compared part, which begins at ``t0`` and lasts ``T``. The decay may be as large as the response
        at the beginning of the recording, which may be far larger than in the compared part.
        """
        rate = self.recording.rate
        # from rest, only what has not decayed in the padding comes round to the beginning
        begins = (self.padded - len(self.recording.force) if self.recording.at_rest else self.start) / rate
        remaining = _remaining(poles.real, begins, len(self.window) / rate)
        return np.asarray(self._first_level * remaining > REMAINING)

    @cached_property
    def _first_level(self) -> float:
        return _first_level(self.recording, self.start, len(self.window))

    def whole(self) -> "WholeSpectrum":
        """Return all lines of the padded recording without a window, at which no response leaks."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        frequencies = self.padded_frequencies
        trust = _full_trust(self.recording, len(frequencies))
        return WholeSpectrum(**(values | {"frequencies": frequencies, "force_here": self.force_lines, "trust": trust}))

    def thinned(self, enough: int) -> "WindowedSpectrum":
        """Keep evenly spaced lines, about ``enough`` of them; return the spectrum itself where it has few lines."""
        step = len(self.frequencies) // enough
        if step < 2:
            return self
        names = ("band", "frequencies", "force_here", "measured", "trust")
        return replace(self, **{name: getattr(self, name)[::step] for name in names})

    def with_measured_forces(self) -> "WindowedSpectrum":
        """Replace the forces by the measured forces."""
        n = len(self.window) + self.start
        return replace(
            self,
            force_lines=padded_force(self),
            force_here=self.cut(self.recording.force[:n]),
            trust=_full_trust(self.recording, len(self.band)),
        )

    def with_whole_forces(self) -> "WindowedSpectrum":
        """Use the forces from the first sample to the last, continued by a mirrored part that fades out.

        A prediction of the whole recording needs these forces. For a comparison of spectra the forces may fade at the
        ends of the recording, because the ends are not compared.
        """
        force, fading = self.recording.force, _ramp_length(self.recording)
        after = force[-2 : -2 - fading : -1] * _cosine_rise(fading)[::-1, None]
        padded = _even_fast_length(self.padded + fading)
        lines = np.asarray(scipy.fft.rfft(np.vstack([force, after]), n=padded, axis=0))
        return replace(self, padded=padded, force_lines=lines)

    def between(self, first: float, last: float) -> "WindowedSpectrum":
        """Restrict the comparison to a part of the recording; the prediction still starts at the beginning.

        Parameters
        ----------
        first, last
            Beginning and end of the part, as shares of the samples that are compared.
        """
        n, rate = len(self.window), self.recording.rate
        begin = int(first * n)
        length = scipy.fft.prev_fast_len(int(last * n) - begin, real=True)
        window = _window(length, self.recording.at_rest and begin == 0)
        axis = np.arange(length // 2 + 1) * rate / length
        slack = rate / n
        # the mean is subtracted, so that 0 Hz is no line
        low, high = max(self.frequencies[0] - slack, 0.5 * axis[1]), self.frequencies[-1] + slack
        band = np.flatnonzero((axis >= low) & (axis <= high))
        nearest = np.searchsorted(self.frequencies, axis[band]).clip(0, len(self.frequencies) - 1)
        part = replace(
            self, start=self.start + begin, window=window, band=band, frequencies=axis[band], trust=self.trust[nearest]
        )
        force = part.signal(self.force_lines)
        return replace(part, force_here=part.cut(force), measured=part.cut(self.recording.response))

    def windowed(self, signal: NDArray[np.floating]) -> NDArray[np.floating]:
        """Return the windowed part (n_window, n) of signals (n_samples or more, n) that begin with the recording.

        The mean over the window is subtracted, so that an unknown zero of a sensor does not leak into the lowest lines.
        """
        compared = signal[self.start : self.start + len(self.window)]
        if not self.recording.at_rest:
            compared = compared - (self.window @ compared / self.window.sum()).astype(compared.dtype)
        return compared * self.window[:, None].astype(compared.dtype)

    def cut(self, signal: NDArray[np.floating]) -> Complex:
        """Compute windowed lines (n_lines, n) of signals (n_samples or more, n) that begin with the recording."""
        return np.asarray(scipy.fft.rfft(self.windowed(signal), axis=0)[self.band])

    def signal(self, spectrum: NDArray[np.complexfloating]) -> Real:
        """Compute time signals (n_samples, n) from padded spectra (padded // 2 + 1, n)."""
        return np.asarray(scipy.fft.irfft(spectrum, n=self.padded, axis=0)[: len(self.recording.force)])

    @cached_property
    def padded_kinematic(self) -> Complex:
        """Return the factors (padded // 2 + 1, n_responses) from displacement to each response's quantity."""
        return self.recording.kinematic(self.padded_frequencies)

    @cached_property
    def kinematic(self) -> Complex:
        """Return the factors (n_lines, n_responses) from displacement to each response's quantity on compared lines."""
        return self.recording.kinematic(self.frequencies)

    def from_force(self, receptance: Complex, force_lines: Complex) -> Complex:
        """Compute windowed response lines (n_lines, n_responses) from padded receptance and force lines."""
        response = np.einsum("kpq,kq->kp", receptance, force_lines) * self.padded_kinematic
        return self.cut(self.signal(response))


@dataclass(frozen=True)
class WholeSpectrum(WindowedSpectrum):
    """All lines of a padded recording without a window."""

    def cut(self, signal: NDArray[np.floating]) -> Complex:
        """Compute the padded spectra (padded // 2 + 1, n) of signals (n_samples, n)."""
        return np.asarray(scipy.fft.rfft(signal, n=self.padded, axis=0))


def windowed_spectrum(
    recording: BandRecording, band: tuple[float, float], decay: float, *, first_motion: bool = False
) -> WindowedSpectrum:
    """Window a recording and transform it.

    Parameters
    ----------
    recording
        Forces and responses.
    band : Hz
        Lowest and highest frequency compared.
    decay : 1/s
        Decay rate of the slowest mode. Run-in and padding last seven of its time constants, the run-in at most a fifth
        of the recording; a recording that begins at rest has no run-in.
    first_motion
        Whether the caller estimates the motion at the first sample of modes that ring on after the run-in
        (`WindowedSpectrum.rings`). Then nothing is left out of such a recording.
    """
    n = len(recording.force)
    ringing = TIME_CONSTANTS / decay * recording.rate
    run_in = 0 if recording.at_rest else int(min(ringing, 0.2 * n))
    # a motion that still rings after the run-in is estimated at the first sample: nothing needs to be left out
    left = (n - run_in) / recording.rate
    if first_motion and (
        _first_level(recording, run_in, n - run_in) * _remaining(-decay, run_in / recording.rate, left) > REMAINING
    ):
        run_in = 0
    length = scipy.fft.prev_fast_len(n - run_in - _ramp_length(recording) // 2, real=True)
    axis = np.arange(length // 2 + 1) * recording.rate / length
    # the level before a blow leaks into the lowest lines, as it cannot be distinguished from the mean
    lowest = (3 if recording.at_rest else 1) * recording.rate / length
    lines = np.flatnonzero((axis >= max(band[0], lowest)) & (axis <= band[1]))
    none, trust = np.zeros(0, dtype=complex), _full_trust(recording, len(lines))
    window = _window(length, recording.at_rest)
    empty = WindowedSpectrum(
        recording,
        _even_fast_length(n + int(min(ringing, max(MOST_PADDING * n, SHORT_PADDING - n)))),
        run_in,
        window,
        lines,
        axis[lines],
        none,
        none,
        none,
        trust,
        ramped=run_in > 0,
    )
    return replace(empty.with_measured_forces(), measured=empty.cut(recording.response))


def _first_level(recording: BandRecording, start: int, count: int) -> float:
    """Return how much larger a response may be at the recording's beginning than in the compared part, at least 1.

    The ratio of root mean squares of the first second and of the ``count`` samples from ``start``. Before a recording
    that begins at rest there is no motion.
    """
    if recording.at_rest:
        return 1.0
    first, compared = recording.response[: _ramp_length(recording)], recording.response[start : start + count]
    before, after = (np.sqrt(np.mean((part - compared.mean(axis=0)) ** 2, axis=0)) for part in (first, compared))
    moves = after > 0
    return float(np.max(before[moves] / after[moves], initial=1.0))


def _remaining(growth: Real | float, begins: float, lasts: float) -> Real:
    """Return the root mean square of a free decay with the rate ``-growth``, 1/s, over its first amplitude.

    It is taken from ``begins`` to ``begins + lasts``, s.
    """
    exponent = np.maximum(-2 * np.asarray(growth) * lasts, 1e-9)
    return np.asarray(np.exp(np.asarray(growth) * begins) * np.sqrt(-np.expm1(-exponent) / exponent))


def _even_fast_length(n: int) -> int:
    length = int(scipy.fft.next_fast_len(n, real=True))
    return length + length % 2


def _window(length: int, at_rest: bool) -> Real:
    """Return a tapered window (length,) whose squares sum to 1."""
    from scipy.signal.windows import tukey  # not at the top: scipy.signal takes 75 MB

    window = tukey(length, 0.08)
    if at_rest:  # nothing leaks from before the recording, and a blow may be at its beginning
        window[: length // 2] = 1.0
    return np.asarray(window / np.sqrt(np.sum(window**2)))


def _full_trust(recording: BandRecording, n_lines: int) -> Complex:
    return np.tile(np.eye(recording.force.shape[1], dtype=complex), (n_lines, 1, 1))


def _ramp_length(recording: BandRecording) -> int:
    """Return the number of samples of the force's ramps: a second, at most a twentieth of the recording."""
    return min(int(recording.rate), len(recording.force) // 20)


def _cosine_rise(count: int) -> Real:
    """Return half a cosine that rises from 0 to 1, (count,)."""
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.arange(count) / count))


def padded_force(spectrum: WindowedSpectrum) -> Complex:
    """Compute the spectrum (padded // 2 + 1, n_excitations) of the ramped and padded force."""
    force, n_ramp = spectrum.recording.force, _ramp_length(spectrum.recording)
    ramp, rise = np.ones(len(force)), _cosine_rise(n_ramp)
    if spectrum.ramped:
        ramp[:n_ramp] = rise
    ramp[len(ramp) - n_ramp :] = rise[::-1]
    return np.asarray(scipy.fft.rfft(force * ramp[:, None], n=spectrum.padded, axis=0))
