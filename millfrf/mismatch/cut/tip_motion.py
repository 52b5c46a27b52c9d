"""The tip's displacement and velocity during a cut: integrated from a sensor there, or computed from the forces."""

from dataclasses import dataclass

import numpy as np
import scipy

from estimation import kinematic_factor
from millfrf.core import Complex, Real
from modal_fit import ModalModel

from ..models.modal_lines import receptance_at

CORNER = 2.0
"""Highest frequency below which motion is never taken from a recording, Hz."""

QUIET_BELOW = 0.7
"""Share of half the sampling rate above which a filter may have taken the noise away."""

STANDS_OUT = 12.0
"""Ratio of a line's power to that around it from which it is no noise: noise reaches it once in 160,000."""


@dataclass(frozen=True)
class TipMotion:
    """Motion at the tool tip without its slow part.

    Parameters
    ----------
    displacement, velocity : (n_samples, 3)
        Displacement (m) and velocity (m/s) along X, Y and Z; zero in a direction that was not measured.
    origin
        Origin of the motion: ``measured`` or ``model``.
    noise : (2, n_samples, 3)
        A draw of the noise that is in displacement and velocity; None where it is not known.
    """

    displacement: Real
    velocity: Real
    origin: str
    noise: Real | None = None

    def noisier(self) -> "TipMotion":
        """The motion with its noise added a second time: the change of a fit shows what the noise does to it.

        Cook & Stefanski, Journal of the American Statistical Association 89, 1994.
        """
        if self.noise is None:
            return self
        return TipMotion(self.displacement + self.noise[0], self.velocity + self.noise[1], self.origin)


def corner_of(rotation: float) -> float:
    """Frequency below which motion is left out, Hz: a tenth of the spindle's, 2 Hz at most.

    Slower motion hardly changes from tooth to tooth, and integration would drown it in the sensor's noise.

    Parameters
    ----------
    rotation
        Spindle frequency, Hz.
    """
    return min(0.1 * rotation, CORNER)


def integrated(samples: Real, order: int, rate: float, corner: float, high_pass: float = 0.0) -> tuple[Real, Real]:
    """Displacement and velocity from displacement (order 0), velocity (1) or acceleration (2), in frequency.

    ``X = S / (i w)^order``, with a known high-pass undone, faded in from ``corner`` to 2.5 times it. A regression on
    noisy motion comes out too small. Lines are therefore weighed by what they say of the true motion, ``1 - S / P``:
    P is the power around a line and S that of the quietest lines (Carroll, Ruppert, Stefanski & Crainiceanu,
    Measurement Error in Nonlinear Models, 2nd ed., chapter 4). A regression on lines so weighed is not too small.

    Parameters
    ----------
    samples : (n, n_channels)
        Samples of one quantity, SI.
    order
        Number of times that displacement is differentiated to give the samples.
    rate, corner
        Sampling rate and corner frequency, Hz.
    """
    spectrum, frequencies = _padded(samples - samples.mean(axis=0), rate, corner)
    trusted = spectrum * _true_part(spectrum, _quiet(spectrum, frequencies))
    return _motion(trusted / _kinematic(frequencies, order, high_pass), frequencies, corner, len(samples))


def integrated_noise(
    samples: Real, order: int, rate: float, corner: float, seed: int, high_pass: float = 0.0
) -> tuple[Real, Real]:
    """A draw of the noise that :func:`integrated` leaves in displacement and velocity.

    Parameters
    ----------
    samples : (n, n_channels)
        Samples of one quantity, SI.
    order
        Number of times that displacement is differentiated to give the samples.
    rate, corner
        Sampling rate and corner frequency, Hz.
    seed
        Seed of the draw.
    """
    spectrum, frequencies = _padded(samples - samples.mean(axis=0), rate, corner)
    drawn = _drawn(spectrum, frequencies, seed)
    return _motion(drawn / _kinematic(frequencies, order, high_pass), frequencies, corner, len(samples))


def computed(model: ModalModel, force: Real, rate: float, corner: float) -> tuple[Real, Real]:
    """Displacement and velocity from a model of the tip's receptance, driven by the measured forces.

    Noise of the forces would come back as motion that moves with them: lines are weighed as in :func:`integrated`.

    Parameters
    ----------
    model
        Receptance of the tip.
    force : (n, n_excitations)
        Forces at the model's excitations, N.
    rate, corner
        Sampling rate and corner frequency, Hz.
    """
    spectrum, frequencies = _padded(force - force.mean(axis=0), rate, corner)
    spectrum = spectrum * _true_part(spectrum, _quiet(spectrum, frequencies))
    needed = frequencies < min(4.0 * float(model.natural_frequencies.max()), 0.5 * rate)
    moved = np.zeros((len(frequencies), len(model.responses)), dtype=complex)
    moved[needed] = np.einsum("kpq,kq->kp", receptance_at(model, frequencies[needed]), spectrum[needed])
    return _motion(moved, frequencies, corner, len(force))


def _quiet(spectrum: Complex, frequencies: Real) -> Real:
    """Power of the quietest lines, (n_channels,), taken for that of a sensor's white noise."""
    heard = frequencies < QUIET_BELOW * frequencies[-1]
    power = np.abs(spectrum[heard]) ** 2
    return np.asarray(np.quantile(scipy.ndimage.uniform_filter1d(power, 64, axis=0), 0.05, axis=0))


def _true_part(spectrum: Complex, quiet: Real) -> Real:
    """``1 - S / P`` of each line: P the power around it, or its own if it stands out."""
    power = np.abs(spectrum) ** 2
    around = scipy.ndimage.median_filter(power, size=(17, 1)) / np.log(2)
    own = np.where(power > STANDS_OUT * around, power, around)
    return np.asarray(np.maximum(1 - quiet / np.maximum(own, 1e-300), 0.0))


def _drawn(spectrum: Complex, frequencies: Real, seed: int) -> Complex:
    """Spectrum of noise as strong as the quietest lines, weighed as the signal is."""
    rng, quiet = np.random.default_rng(seed), _quiet(spectrum, frequencies)
    both = rng.standard_normal((2, *spectrum.shape))
    return np.asarray(np.sqrt(quiet / 2) * (both[0] + 1j * both[1]) * _true_part(spectrum, quiet))


def _padded(samples: Real, rate: float, corner: float) -> tuple[Complex, Real]:
    room = 2 * scipy.fft.next_fast_len((len(samples) + int(2 * rate / corner) + 1) // 2, real=True)
    rise = min(int(0.25 * rate / corner), len(samples) // 4)
    ramp = np.ones(len(samples))
    ramp[:rise] = 0.5 - 0.5 * np.cos(np.pi * (np.arange(rise) + 0.5) / rise)
    ramp[-rise:] = ramp[:rise][::-1]
    return np.asarray(scipy.fft.rfft(samples * ramp[:, None], n=room, axis=0)), np.asarray(
        np.fft.rfftfreq(room, 1 / rate)
    )


def _motion(displacement: Complex, frequencies: Real, corner: float, n: int) -> tuple[Real, Real]:
    fade = 0.5 - 0.5 * np.cos(np.pi * np.clip((frequencies - corner) / (1.5 * corner), 0.0, 1.0))
    room = 2 * (len(frequencies) - 1)
    shown = displacement * fade[:, None]
    velocity = shown * _kinematic(frequencies, 1)
    return np.asarray(scipy.fft.irfft(shown, n=room, axis=0)[:n]), np.asarray(
        scipy.fft.irfft(velocity, n=room, axis=0)[:n]
    )


def _kinematic(frequencies: Real, order: int, high_pass: float = 0.0) -> Complex:
    """Factor (n, 1) from displacement to what is measured, one at 0 Hz, which is faded out."""
    factor = np.ones((len(frequencies), 1), dtype=complex)
    factor[1:] = kinematic_factor(frequencies[1:], np.array([order]), (high_pass,))
    return factor
