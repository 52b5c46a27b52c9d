"""A mass or a stiffness that changes during the recordings: which of both moves a mode, by an own integration."""

from dataclasses import replace

import numpy as np
import pytest
from concealed_recordings import FORCES, LABELS, MOTIONS, RATE
from numpy.typing import NDArray

from estimation import BandRecording, WindowedSpectrum, windowed_spectrum
from millfrf.mismatch import Hypothesis, LabError, ModelShape
from millfrf.mismatch.joints.joint_axis import JointAxis
from millfrf.mismatch.joints.joint_law import JointMotion
from millfrf.mismatch.models.cause import Cause
from millfrf.mismatch.models.fitting import Fit, fit
from millfrf.mismatch.physics.joint_laws import POSE_DRIFT
from millfrf.mismatch.structure.changing_mass import ChangingMass, changing_masses
from modal_fit import ModalModel

Real = NDArray[np.float64]
SHAPES = np.array([[1.0, 0.35], [-0.4, 1.0]])  # a row for each mode
MASSES, OMEGA, DAMPING = np.array([40.0, 30.0]), 2 * np.pi * np.array([9.0, 14.0]), np.array([0.03, 0.04])
DIRECTION = np.array([0.6, 0.8])
SECONDS, FINE, NEEDED = 24.0, 8, 20.0


def _model() -> ModalModel:
    poles = OMEGA * (-DAMPING + 1j * np.sqrt(1 - DAMPING**2))
    return ModalModel(poles, SHAPES / (2j * poles.imag * MASSES)[:, None], SHAPES.astype(complex), LABELS, LABELS)


def _simulated(force: Real, mass: Real, stiffness: Real) -> Real:
    """Integrate modes with a mass (kg) and a stiffness (N/m) along the direction by Newmark's mean acceleration."""
    h = 1 / (FINE * RATE)
    along = SHAPES @ DIRECTION
    coupling = np.outer(along, along) / MASSES[:, None]
    damping, spring = np.diag(2 * DAMPING * OMEGA), np.diag(OMEGA**2)
    driven = force @ SHAPES.T / MASSES
    q, v, a = np.zeros(2), np.zeros(2), np.linalg.solve(np.eye(2) + mass[0] * coupling, driven[0])
    out = np.empty((len(force), 2))
    for k in range(len(force)):
        if k:
            shifted, faster = q + h * v + h * h / 4 * a, v + h / 2 * a
            held = spring + stiffness[k] * coupling
            inertia = np.eye(2) + mass[k] * coupling + h / 2 * damping + h * h / 4 * held
            a = np.linalg.solve(inertia, driven[k] - damping @ faster - held @ shifted)
            q, v = shifted + h * h / 4 * a, faster + h / 2 * a
        out[k] = a @ SHAPES
    return out[::FINE]


def _recorded(seed: int, noise: float, mass_change: float, stiffness_change: float) -> WindowedSpectrum:
    rng = np.random.default_rng(seed)
    n = int(SECONDS * RATE)
    late = np.arange(FINE * n) / (FINE * n) - 0.5
    spectra = np.zeros((2, FINE * n // 2 + 1), complex)
    band = np.fft.rfftfreq(FINE * n, 1 / (FINE * RATE)) < 40
    spectra[:, band] = rng.normal(size=(2, band.sum())) + 1j * rng.normal(size=(2, band.sum()))
    force = np.fft.irfft(spectra, axis=1).T
    force *= 30 / force.std()
    motion = _simulated(force, mass_change * late, stiffness_change * late)
    motion += noise * motion.std(axis=0) * rng.normal(size=motion.shape)
    recording = BandRecording(f"run_{seed}", RATE, force[::FINE], motion, FORCES, MOTIONS)
    return windowed_spectrum(recording, (3.0, 30.0), 2 * np.pi * 0.27)


def _fitted(noise: float, mass_change: float, stiffness_change: float) -> tuple[Fit, list[WindowedSpectrum]]:
    lines = [_recorded(seed, noise, mass_change, stiffness_change) for seed in range(2)]
    shape = ModelShape(_model(), LabError())
    motion = JointMotion(1e-4, 6e-3, 1e-3, 6e-2, 1e5, None, (SECONDS, SECONDS))
    drift = Cause(POSE_DRIFT, np.array([1e3, 0.5, 0.0]), "", JointAxis(DIRECTION), motion)
    return fit(lines, Hypothesis(shape, np.zeros(shape.size)).with_cause(drift), iterations=15), lines


def _rival(noise: float, mass_change: float, stiffness_change: float) -> ChangingMass:
    (rival,) = changing_masses(*_fitted(noise, mass_change, stiffness_change), NEEDED)
    return rival


@pytest.mark.parametrize("change", [-3.0, 4.0])
def test_a_mass_that_changes_explains_more_than_a_stiffness(change: float) -> None:
    rival = _rival(0.01, change, 0.0)
    assert rival.explains_more
    assert rival.change == pytest.approx(change, rel=0.1)
    assert "weigh what moves" in rival.sentence


@pytest.mark.parametrize("change", [-1e4, 1.5e4])
def test_a_stiffness_that_changes_explains_more_than_a_mass(change: float) -> None:
    rival = _rival(0.01, 0.0, change)
    assert rival.gain < -NEEDED
    assert not rival.sentence


def test_in_noise_both_are_as_likely() -> None:
    rival = _rival(0.5, 0.0, 4e3)
    assert not rival.explains_more
    assert "as likely" in rival.sentence


def test_a_hypothesis_without_a_drift_has_no_rival() -> None:
    fitted, lines = _fitted(0.01, 0.0, 1e4)
    assert changing_masses(replace(fitted, hypothesis=fitted.hypothesis.without(0)), lines, NEEDED) == ()
