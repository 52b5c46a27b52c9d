"""Spectra of one trial on the lines that count, and a linear model's prediction cut in exactly the same way."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, prev_fast_len, rfft
from scipy.signal.windows import tukey

from modal_fit import ModalModel

from ..noise.line_loops import modal_displacement
from .trial import Trial

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@dataclass(frozen=True)
class WindowedLines:
    """A trial's window, its padded force spectrum and its measured lines.

    The whole record is predicted: force ramped in over a second and padded with zeros, so that the structure rings out;
    then prediction and measurement are cut and windowed alike, and nothing leaks that does not leak in both.

    Parameters
    ----------
    trial
        Forces and responses.
    padded
        Samples of the padded record.
    start
        First sample compared, after the run-in.
    window : (n_kept,)
    band : (n_lines,)
        Which lines of the windowed spectrum are compared.
    frequencies : (n_lines,), Hz
    force_lines : (padded // 2 + 1, n_excitations)
        Spectrum of the ramped and padded force.
    force_here : (n_lines, n_excitations)
        Spectrum of the windowed force.
    trust : (n_lines, n_excitations, n_excitations)
        What the noise of the forces used is multiplied by: less than one where they were replaced by what they say of
        the true ones.
    measured : (n_lines, n_responses)
        Spectrum of the windowed response, scaled so that white noise of variance v has variance v a line.
    """

    trial: Trial
    padded: int
    start: int
    window: Real
    band: NDArray[np.int64]
    frequencies: Real
    force_lines: Complex
    force_here: Complex
    measured: Complex
    trust: Complex

    @cached_property
    def padded_frequencies(self) -> Real:
        """Frequencies of ``force_lines``, Hz."""
        return np.asarray(np.arange(self.padded // 2 + 1) * self.trial.rate / self.padded)

    def thinned(self, enough: int) -> "WindowedLines":
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

    def with_measured_forces(self) -> "WindowedLines":
        """Forces as they were measured, where they were replaced."""
        n = len(self.window) + self.start
        return replace(
            self,
            force_lines=padded_force(self),
            force_here=self.cut(self.trial.force[:n]),
            trust=_full_trust(self.trial, len(self.band)),
        )

    def cut(self, signal: NDArray[np.floating]) -> Complex:
        """Windowed lines (n_lines, n) of signals (n_samples or more, n) that begin with the record."""
        kept = signal[self.start : self.start + len(self.window)]
        return np.asarray(rfft(kept * self.window[:, None].astype(kept.dtype), axis=0)[self.band])

    def signal(self, spectrum: Complex) -> Real:
        """Time signals (n_samples, n) of padded spectra (padded // 2 + 1, n)."""
        return np.asarray(irfft(spectrum, n=self.padded, axis=0)[: len(self.trial.force)])

    @cached_property
    def padded_kinematic(self) -> Complex:
        """Factor (padded // 2 + 1, n_responses) from displacement to each response's quantity."""
        return self.trial.kinematic(self.padded_frequencies)

    @cached_property
    def kinematic(self) -> Complex:
        """The same at the lines that are compared, (n_lines, n_responses)."""
        return self.trial.kinematic(self.frequencies)

    def from_force(self, receptance: Complex, force_lines: Complex) -> Complex:
        """Windowed response lines (n_lines, n_responses) of padded force lines through padded receptance lines."""
        response = np.einsum("kpq,kq->kp", receptance, force_lines) * self.padded_kinematic
        return self.cut(self.signal(response))


def windowed_lines(trial: Trial, band: tuple[float, float], decay: float) -> WindowedLines:
    """Prepare a trial.

    Parameters
    ----------
    trial
        Forces and responses.
    band
        Lowest and highest frequency compared, Hz.
    decay
        Of the slowest mode, 1/s: run-in and padding last seven of its time constants, at most a fifth of the record.
    """
    n = len(trial.force)
    run_in = int(min(7.0 / decay * trial.rate, 0.2 * n))
    padded = next_fast_len(n + run_in, real=True)
    padded += padded % 2
    rising = _rising(trial)
    kept = prev_fast_len(n - run_in - rising // 2, real=True)
    window = tukey(kept, 0.08)
    window /= np.sqrt(np.sum(window**2))
    axis = np.arange(kept // 2 + 1) * trial.rate / kept
    lines = np.flatnonzero((axis >= max(band[0], 3 * trial.rate / kept)) & (axis <= band[1]))
    none, trust = np.zeros(0, dtype=complex), _full_trust(trial, len(lines))
    stub = WindowedLines(trial, padded, run_in, window, lines, axis[lines], none, none, none, trust)
    return replace(stub.with_measured_forces(), measured=stub.cut(trial.response))


def _full_trust(trial: Trial, count: int) -> Complex:
    """That of forces as measured."""
    return np.tile(np.eye(trial.force.shape[1], dtype=complex), (count, 1, 1))


def _rising(trial: Trial) -> int:
    """Samples over which the force is ramped in and out."""
    return min(int(trial.rate), len(trial.force) // 20)


def padded_force(lines: WindowedLines) -> Complex:
    """Spectrum of the ramped and padded force."""
    ramp, rising = np.ones(len(lines.trial.force)), _rising(lines.trial)
    ramp[:rising] = 0.5 - 0.5 * np.cos(np.pi * np.arange(rising) / rising)
    ramp[-rising:] = ramp[:rising][::-1]
    return np.asarray(rfft(lines.trial.force * ramp[:, None], n=lines.padded, axis=0))


def receptance_at(model: ModalModel, frequencies: Real) -> Complex:
    """Receptance (n, n_responses, n_excitations) at lines from 0 Hz on.

    A residual inertia stands for modes below the band and says nothing below it: under a third of the lowest mode it
    is left out, or the mean cutting force would carry the tool away.
    """
    if model.residuals is None or not model.residuals.lower.any():
        return model.receptance(frequencies)
    plain = replace(model, residuals=replace(model.residuals, lower=np.zeros_like(model.residuals.lower)))
    values = plain.receptance(frequencies)
    inside = frequencies >= model.natural_frequencies.min() / 3
    values[inside] -= model.residuals.lower / (2 * np.pi * frequencies[inside, None, None]) ** 2
    return values


def displacement_at(model: ModalModel, frequencies: Real, force: Complex) -> Complex:
    """``H F`` (n, n_responses) at lines from 0 Hz on, with H as in :func:`receptance_at` but never written out.

    Parameters
    ----------
    frequencies : (n,), Hz
    force : (n, n_excitations), N
    """
    s = np.asarray(2j * np.pi * frequencies, dtype=complex)
    out = np.empty((len(s), model.right.shape[1]), dtype=complex)
    modal_displacement(s, model.poles, model.right, model.left, np.ascontiguousarray(force), out)
    if model.residuals is not None:
        plain = replace(model.residuals, lower=np.zeros_like(model.residuals.lower))
        out += np.einsum("kpq,kq->kp", plain.receptance(s), force)
        inside = (frequencies >= model.natural_frequencies.min() / 3) & (frequencies > 0)
        out[inside] += (force[inside] @ model.residuals.lower.T) / s[inside, None] ** 2
    return out * np.exp(-s * model.delay)[:, None] if model.delay else out
