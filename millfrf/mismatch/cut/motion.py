"""Motion of a cut: the spindle angle, and the displacement and velocity of the tip."""

import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy
from numpy.typing import NDArray

from acquisition import opened
from estimation import kinematic_factor
from millfrf.core import Complex, InputError, Real, tables_of_setup
from modal_fit import ModalModel

from ..location.maps import SPEED, spindle_speed
from ..models.modal_lines import receptance_at

SPEED_TOLERANCE = 0.02  # largest relative error of the stated speed

HARMONICS = 3  # harmonics of the tooth passing from which the speed is identified

MIN_CONTRAST = 5.0  # least ratio of the power at the harmonics for the identified speed to its median at other speeds

MIN_SHARE = 0.1  # least share of the power at the harmonics in the power of the forces; leakage of a line has less


@dataclass(frozen=True)
class SpindleLaw:
    """``angle(t) = angle + speed (t - middle) + change (t - middle)^2 / 2``.

    Examples
    --------
    >>> law = SpindleLaw(1.0, 0.0, 10.0, 2.0)
    >>> float(law.angles(np.array([2.0]))[0])
    11.0
    """

    middle: float  # reference instant of the law, s after the first sample
    angle: float  # angle of tooth 0 at this instant, rad
    speed: float  # speed at this instant, rad/s
    change: float = 0.0  # change of the speed, rad/s^2

    def angles(self, times: Real) -> Real:
        """Return the angle of tooth 0, (n,), rad."""
        t = times - self.middle
        return np.asarray(self.angle + self.speed * t + 0.5 * self.change * t**2)

    def speeds(self, times: Real) -> Real:
        """Return the spindle speed, (n,), rad/s."""
        return np.asarray(self.speed + self.change * (times - self.middle))

    def lag(self, times: Real, turned: float) -> Real:
        """Return the time s (n,) that a rotation by ``turned``, rad, took: ``turned = speed s - change s^2 / 2``."""
        speed = self.speeds(times)
        return np.asarray(2 * turned / (speed + np.sqrt(np.maximum(speed**2 - 2 * self.change * turned, 0.0))))

    def about(self, middle: float) -> "SpindleLaw":
        """Return the same law with a new reference instant."""
        at = np.array([middle])
        return SpindleLaw(middle, float(self.angles(at)[0]), float(self.speeds(at)[0]), self.change)


def stated_law(path: str | os.PathLike[str], speed: float | None = None) -> SpindleLaw:
    """Return the spindle law that the user, the events or the set-up of the recording state; the unknown angle is 0."""
    if speed is not None:
        if not (np.isfinite(speed) and speed > 0):
            raise InputError(
                f"spindle speed {speed * 30 / np.pi:g} rpm must be positive; "
                "correct the speed (speed in rad/s, --speed in rpm)"
            )
        return SpindleLaw(0.0, 0.0, float(speed))
    name = Path(path).name
    swept = _stated_sweep(path)
    if swept is not None:
        return swept
    known = spindle_speed(path)
    if known is None:
        raise InputError(
            f"{name} states no spindle speed that is constant or swept linearly; "
            "give a constant speed (speed in rad/s, --speed in rpm)"
        )
    rates = known.rpm * np.pi / 30
    if len(rates) < 3:
        return SpindleLaw(0.0, 0.0, float(rates.mean()))
    slope, start = np.polyfit(known.time, rates, 1)
    deviation = float(np.std(rates - start - slope * known.time) / rates.mean())
    if deviation > SPEED_TOLERANCE / 4:
        raise InputError(
            f"{name}: the spindle speed departs by {100 * deviation:.2g} % from a line; cut out a steady part"
        )
    return SpindleLaw(0.0, 0.0, float(start), float(slope))


def _stated_sweep(path: str | os.PathLike[str]) -> SpindleLaw | None:
    with opened(path) as recording:
        setup = recording.setup
    for table in tables_of_setup(setup).values():
        if table.get("speed_profile") == "linear sweep":
            first, last = (float(table[f"{which}_{SPEED}"]) * np.pi / 30 for which in ("first", "last"))
            return SpindleLaw(0.0, 0.0, first, (last - first) / float(table["sweep_duration_s"]))
    return None


def found_law(force: Real, rate: float, stated: SpindleLaw, teeth: int) -> SpindleLaw:
    """Identify speed and change of speed from the power at the harmonics of the tooth passing; the angle stays 0.

    The likelihood of harmonics in white noise, ``sum_m |sum_t F(t) exp(-i m N angle(t))|^2`` for m = 1 ... 3, is
    maximised.
    """
    time = np.arange(len(force)) / rate
    law = stated.about(float(time[-1]) / 2)
    if not law.speeds(time).min() > 0:
        raise InputError("the stated sweep of the spindle stops within the recording; cut out the part that mills")
    slow, centre = _phasors(force - force.mean(axis=0), time, law, teeth)
    step = 0.5 * np.pi / (HARMONICS * teeth * time[-1])
    speeds = np.arange(-SPEED_TOLERANCE * law.speed, SPEED_TOLERANCE * law.speed + step, step)
    bend = 6.0 / (HARMONICS * teeth * (time[-1] / 2) ** 2) / 4
    wide = max(3.0, 0.01 * abs(law.change) / bend)
    changes = bend * np.arange(-np.ceil(wide), np.ceil(wide) + 1)
    powers = np.array([[_power(slow, centre, teeth, dw, da) for dw in speeds] for da in changes])
    row, column = np.unravel_index(int(np.argmax(powers)), powers.shape)
    share = 2 * powers.max() / slow.shape[1] ** 2 / float(np.sum(np.var(force, axis=0)))
    if powers.max() < MIN_CONTRAST * np.median(powers[row]) or share < MIN_SHARE:
        raise InputError(
            f"no tooth passing within {100 * SPEED_TOLERANCE:g} % of {law.speed * 30 / np.pi:.4g} rpm stands out of "
            "the forces; give the right speed (speed in rad/s, --speed in rpm), and a cut of constant engagement"
        )
    return replace(law, speed=law.speed + float(speeds[column]), change=law.change + float(changes[row]))


def _phasors(force: Real, time: Real, law: SpindleLaw, teeth: int) -> tuple[NDArray[np.complex128], Real]:
    """Return demodulated forces averaged over half revolutions, (HARMONICS, n_parts, n_channels), and their times."""
    size = max(1, int(np.pi / law.speed / (time[1] - time[0])))
    used = len(time) // size * size
    angles = law.angles(time[:used])
    parts = [
        (force[:used] * np.exp(-1j * m * teeth * angles)[:, None]).reshape(-1, size, force.shape[1]).mean(axis=1)
        for m in range(1, HARMONICS + 1)
    ]
    return np.array(parts), time[:used].reshape(-1, size).mean(axis=1) - law.middle


def _power(slow: NDArray[np.complex128], centre: Real, teeth: int, speed: float, change: float) -> float:
    turned = teeth * (speed * centre + 0.5 * change * centre**2)
    waves = np.exp(-1j * np.arange(1, HARMONICS + 1)[:, None] * turned)
    return float(np.sum(np.abs(np.einsum("mt,mtc->mc", waves, slow)) ** 2))


CORNER = 2.0  # largest frequency below which motion is left out, Hz

NOISE_BAND = 0.7  # share of half the sampling rate above which a filter may have removed the noise

# least ratio of a line's power to that of its neighbourhood if it is not noise; noise exceeds it once in 160 000
SIGNIFICANT_RATIO = 12.0


@dataclass(frozen=True)
class TipMotion:
    """Motion at the tool tip without its slow part."""

    # displacement (m) and velocity (m/s) along X, Y and Z; zero in a direction that was not measured, (n_samples, 3)
    displacement: Real
    velocity: Real
    origin: str  # origin of the motion: ``measured`` or ``model``
    # simulated noise with the power of the noise in displacement and velocity, (2, n_samples, 3); None if not known
    noise: Real | None = None

    def noisier(self) -> "TipMotion":
        """Return the motion with further noise of the same power, whose effect on a fit shows the effect of the noise.

        Cook & Stefanski, Journal of the American Statistical Association 89, 1994.
        """
        if self.noise is None:
            return self
        return TipMotion(self.displacement + self.noise[0], self.velocity + self.noise[1], self.origin)


def corner_of(rotation: float) -> float:
    """Return the frequency below which motion is left out, Hz: a tenth of the spindle frequency, at most 2 Hz.

    Slower motion hardly changes from tooth to tooth, and the integrated sensor noise would exceed it.
    """
    return min(0.1 * rotation, CORNER)


def integrated(samples: Real, order: int, rate: float, corner: float, high_pass: float = 0.0) -> tuple[Real, Real]:
    """Compute displacement and velocity from displacement (order 0), velocity (1) or acceleration (2).

    In the frequency domain, ``X = Y / (i w)^order`` for the measured spectrum Y, divided by a known high-pass and faded
    in from ``corner`` to 2.5 times ``corner``, Hz. A regression on noisy motion is biased towards zero. Lines are
    therefore weighted by ``1 - S / P``, with the power P around a line and the power S of the quietest lines (Carroll,
    Ruppert, Stefanski & Crainiceanu, Measurement Error in Nonlinear Models, 2nd ed., chapter 4). This removes the bias.
    """
    spectrum, frequencies = _padded(samples - samples.mean(axis=0), rate, corner)
    trusted = spectrum * _true_part(spectrum, _quiet(spectrum, frequencies))
    return _motion(trusted / _kinematic(frequencies, order, high_pass), frequencies, corner, len(samples))


def integrated_noise(
    samples: Real, order: int, rate: float, corner: float, seed: int, high_pass: float = 0.0
) -> tuple[Real, Real]:
    """Return simulated noise in displacement and velocity with the power that the result of :func:`integrated` has."""
    spectrum, frequencies = _padded(samples - samples.mean(axis=0), rate, corner)
    drawn = _drawn(spectrum, frequencies, seed)
    return _motion(drawn / _kinematic(frequencies, order, high_pass), frequencies, corner, len(samples))


def computed(model: ModalModel, force: Real, rate: float, corner: float) -> tuple[Real, Real]:
    """Return displacement and velocity from the receptance of the tip, driven by the measured forces.

    Lines are weighted as in :func:`integrated`, as noise of the forces would cause motion correlated with the forces.
    """
    spectrum, frequencies = _padded(force - force.mean(axis=0), rate, corner)
    spectrum = spectrum * _true_part(spectrum, _quiet(spectrum, frequencies))
    needed = frequencies < min(4.0 * float(model.natural_frequencies.max()), 0.5 * rate)
    response = np.zeros((len(frequencies), len(model.responses)), dtype=complex)
    response[needed] = np.einsum("kpq,kq->kp", receptance_at(model, frequencies[needed]), spectrum[needed])
    return _motion(response, frequencies, corner, len(force))


def _quiet(spectrum: Complex, frequencies: Real) -> Real:
    """Return the power of the quietest lines, (n_channels,), which is taken as the power of white sensor noise."""
    in_band = frequencies < NOISE_BAND * frequencies[-1]
    power = np.abs(spectrum[in_band]) ** 2
    return np.asarray(np.quantile(scipy.ndimage.uniform_filter1d(power, 64, axis=0), 0.05, axis=0))


def _true_part(spectrum: Complex, quiet: Real) -> Real:
    """Return ``1 - S / P`` of each line, with the power P around the line, or of the line if that is significant."""
    power = np.abs(spectrum) ** 2
    around = scipy.ndimage.median_filter(power, size=(17, 1)) / np.log(2)
    own = np.where(power > SIGNIFICANT_RATIO * around, power, around)
    return np.asarray(np.maximum(1 - quiet / np.maximum(own, 1e-300), 0.0))


def _drawn(spectrum: Complex, frequencies: Real, seed: int) -> Complex:
    """Return the spectrum of noise with the power of the quietest lines, weighted like the signal."""
    rng, quiet = np.random.default_rng(seed), _quiet(spectrum, frequencies)
    parts = rng.standard_normal((2, *spectrum.shape))
    return np.asarray(np.sqrt(quiet / 2) * (parts[0] + 1j * parts[1]) * _true_part(spectrum, quiet))


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
    faded = displacement * fade[:, None]
    velocity = faded * _kinematic(frequencies, 1)
    return np.asarray(scipy.fft.irfft(faded, n=room, axis=0)[:n]), np.asarray(
        scipy.fft.irfft(velocity, n=room, axis=0)[:n]
    )


def _kinematic(frequencies: Real, order: int, high_pass: float = 0.0) -> Complex:
    """Return the factor (n, 1) from displacement to the measured quantity; 1 at 0 Hz, which is faded out later."""
    factor = np.ones((len(frequencies), 1), dtype=complex)
    factor[1:] = kinematic_factor(frequencies[1:], np.array([order]), (high_pass,))
    return factor
