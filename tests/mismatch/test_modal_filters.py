"""Modal filters in time against their spectra, and a law's slopes against difference quotients along a motion."""

import numpy as np
import pytest
from hidden_joint import MOTION, law_of
from scipy.fft import irfft, rfft

from millfrf.mismatch.joints.joint_law import JointMotion
from millfrf.mismatch.joints.tangent_loops import modal_filters
from millfrf.mismatch.joints.time_loops import driven_run, filters_run, law_change_run
from millfrf.mismatch.models.cause import Cause
from millfrf.mismatch.physics.wider_forms import FreeForm

PADDED, STEP = 1200, 1 / 512


def test_filters_in_time_are_those_of_the_spectra() -> None:
    """Two forces of all frequencies through a slow and a fast mode: deflections and rates at every instant."""
    rng = np.random.default_rng(3)
    force = rfft(rng.normal(size=(PADDED, 2)), axis=0)
    force[-1] = 0.0
    poles = np.array([-3 + 40j, -12 + 0.3 / STEP * 1j])
    left, ahead = rng.normal(size=(2, 2, 2)) @ [1, 1j], rng.normal(size=(2, 2)) @ [1, 1j]
    filters = modal_filters(force, (PADDED, STEP), (poles, left, ahead), (2, True))
    shown = (np.zeros((PADDED, filters.signals), np.float32), np.zeros((PADDED, filters.signals), np.float32))
    state, parts = filters.start.copy(), (filters.turns, filters.inputs, filters.direct)
    for begin in (0, 500):
        part = slice(begin, 500 if begin == 0 else PADDED)
        filters_run(filters.sources, begin, state, parts, (2, STEP), 0, (shown[0][part], shown[1][part]))
    s = 2j * np.pi * np.arange(len(force)) / (PADDED * STEP)

    def signals(over: np.ndarray, back: np.ndarray, through: np.ndarray) -> list[np.ndarray]:
        up, down = through * over, through.conj() * back
        return [up + down, 1j * (up - down)]

    spectra = np.zeros((len(s), 12), dtype=complex)
    for r, pole in enumerate(poles):
        over, back = 1 / (s - pole), 1 / (s - pole.conj())
        for q in range(2):
            first = signals(over * force[:, q], back * force[:, q], np.ones(1, dtype=complex))
            spectra[:, 2 * r + q], spectra[:, 6 + 2 * r + q] = first
        forces = ahead[r] * (force @ left[r]), ahead[r].conj() * (force @ left[r].conj())
        twice = over**2 * forces[0], back**2 * forces[1]
        spectra[:, 4 + r], spectra[:, 10 + r] = twice[0] + twice[1], 1j * (twice[0] - twice[1])
    for got, wanted in zip(shown, (spectra, s[:, None] * spectra), strict=True):
        due = irfft(wanted, n=PADDED, axis=0)
        np.testing.assert_allclose(np.linalg.norm(got - due, axis=0) / np.linalg.norm(due, axis=0), 0.0, atol=2e-3)


def _motion(motion: JointMotion) -> tuple[np.ndarray, np.ndarray]:
    """A deflection and its velocity that reach all of a law."""
    t = np.arange(4000) / 512
    x = motion.deflection * (1.3 * np.sin(40 * t) + np.sin(23 * t))
    return x, np.gradient(x) * 512


@pytest.mark.parametrize("name", ["stiffness_hardening", "coulomb_friction", "hysteresis", "pose_drift"])
@pytest.mark.parametrize("kinds", ["", "xvmt"])
def test_slopes_of_a_law_are_those_along_a_motion(name: str, kinds: str) -> None:
    law_physics = law_of(name)
    values = law_physics.starts(MOTION)[0]
    physics = law_physics
    if kinds:
        physics = FreeForm(law_physics, kinds)
        values = np.append(values, np.linspace(-0.4, 0.6, len(physics.parameters) - len(values)))
    cause = Cause(physics, values, motion=MOTION)
    law, (x, v), here = cause.law(), _motion(MOTION), cause.coordinates()
    out, sticks = np.empty((len(x), len(values)), np.float32), np.empty((len(x), len(law.yields)), np.bool_)
    memory = (np.zeros(len(law.yields)), np.zeros(len(law.yields)))
    passing = 1 / len(x)
    slopes = (*cause.law_slopes().parts, passing)
    law_change_run((x, v), 0, ((law.reach, law.speed), law.yields), slopes, memory, (sticks, out))

    def force(coordinates: np.ndarray) -> np.ndarray:
        moved, result = cause.moved(coordinates).law(), np.empty(len(x))
        tau = np.arange(len(x)) * passing - 0.5
        ramp = moved.ramp * tau + moved.bend * (4 * tau**2 - 1)
        driven_run(x, v, moved.tables(), (moved.reach, moved.speed), ramp, (moved.springs, moved.yields), result)
        return result

    for k in range(len(values)):
        aside = 0.002 * np.eye(len(values))[k]
        quotient = (force(here + aside) - force(here - aside)) / 0.004
        assert np.linalg.norm(out[:, k] - quotient) <= 0.03 * np.linalg.norm(quotient), k
