"""Errors of told numbers contain the form of the law: coverage with friction of other families than the library's."""

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from concealed_recordings import RATE, forces, linear_acceleration, structure, trial

from estimation import BandRecording, WindowedSpectrum, windowed_spectrum
from millfrf.mismatch import Hypothesis, LabError, ModelShape, fit, library
from millfrf.mismatch.joints.joint_axis import JointAxis
from millfrf.mismatch.joints.joint_law import JointMotion
from millfrf.mismatch.models.cause import Cause
from millfrf.mismatch.models.fitting import Fit
from millfrf.mismatch.physics.joint_laws import POSE_DRIFT as PHYSICS
from millfrf.mismatch.records.reading import band_of
from millfrf.mismatch.structure.reported_causes import with_form_spread

DIRECTION = np.array([0.8, -0.6])
LEVELS = (20.0, 35.0, 60.0)


def _independent() -> ModuleType:
    path = Path(__file__).with_name("foreign_friction.py")
    spec = importlib.util.spec_from_file_location("foreign_friction", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["foreign_friction"] = module
    spec.loader.exec_module(module)
    return module


def _cut(seed: int, family: str) -> tuple[list[WindowedSpectrum], JointMotion, float]:
    """Recordings at three levels, how the joint moves, and the force at which the law saturates."""
    model, friction = structure(), _independent()
    rng = np.random.default_rng([seed, 77])
    saturation, share = rng.uniform(6, 14), rng.uniform(0.03, 0.08)
    velocity, deflection = _typical(linear_acceleration(model, forces(rng, LEVELS[1], 24.0)) @ DIRECTION)
    scale = share * (velocity if family in ("root", "arctangent") else deflection)
    made: list[BandRecording] = []
    for level in LEVELS:
        force = forces(rng, level, 24.0)
        moved = friction.response_with_friction(model, force, RATE, DIRECTION, family, saturation, scale)
        made.append(trial(f"{level:g} N", force, moved, rng))
    more = LEVELS[-1] / LEVELS[1]
    motion = JointMotion(more * deflection, more * velocity, 20 * deflection, 20 * velocity, 1e6)
    decay = float((-model.poles.real).min())
    return [windowed_spectrum(each, band_of(model, RATE), decay) for each in made], motion, saturation


def _typical(acceleration: np.ndarray) -> tuple[float, float]:
    """Root mean square velocity and deflection above 2 Hz."""
    axis = np.fft.rfftfreq(len(acceleration), 1 / RATE)
    lines = np.where(axis > 2, np.fft.rfft(acceleration), 0) / np.where(axis > 2, 2j * np.pi * axis, 1)
    velocity = np.fft.irfft(lines).std()
    return float(velocity), float(np.fft.irfft(lines / np.where(axis > 2, 2j * np.pi * axis, 1)).std())


def _named(lines: list[WindowedSpectrum], motion: JointMotion) -> Fit:
    """The likelier of the library's two forms of dry friction, fitted freely."""
    shape = ModelShape(structure(), LabError())
    fits = []
    for name, scale in (("coulomb_friction", motion.velocity), ("presliding_friction", motion.deflection)):
        cause = Cause(library()[name], np.array([9.0, 0.03 * scale]), "", JointAxis(DIRECTION), motion)
        fits.append(fit(lines, Hypothesis(shape, np.zeros(shape.size), (cause,)), iterations=25))
    return min(fits, key=lambda one: one.score)


def _off(seed: int, family: str) -> tuple[float, float]:
    """Found over true saturation minus one, in standard errors: of the noise alone, and with the form."""
    lines, motion, truth = _cut(seed, family)
    named = _named(lines, motion)
    place, cause = named.hypothesis.shape.size, named.hypothesis.causes[0]
    errors = [np.sqrt(each.covariance[place, place]) for each in (named, with_form_spread(named, lines))]
    step = cause.physics.parameters[0].unit_step * float(cause.values[0])
    miss = float(cause.values[0]) - truth
    return abs(miss) / (errors[0] * step), abs(miss) / (errors[1] * step)


@pytest.mark.long
def test_an_error_of_the_noise_alone_denies_another_form_and_the_told_one_does_not() -> None:
    """Friction that goes with v over the root of v^2 + v0^2, which the library does not have."""
    noise, stated = _off(0, "root")
    assert noise > 5
    assert stated < 1.96


@pytest.mark.slow
@pytest.mark.parametrize("family", ["root", "arctangent", "lugre", "iwan"])
def test_coverage_with_laws_of_other_families(family: str) -> None:
    """Of 20 draws at most three may lie outside 95 % intervals (binomial: 1.6 % chance of more)."""
    outside = [seed for seed in range(20) if _off(seed, family)[1] > 1.96]
    assert len(outside) <= 3, outside


def test_noise_alone_leaves_an_error_as_it_is(linear_trials: list[BandRecording]) -> None:
    """A linear cause that is exactly what was done: parts of the recordings agree, and nothing is added."""
    model = structure()
    late = [replace(each, response=each.response * np.array([1.2, 1.0])) for each in linear_trials]
    decay = float((-model.poles.real).min())
    lines = [windowed_spectrum(each, band_of(model, RATE), decay) for each in late]
    shape = ModelShape(model, LabError())
    cause = Cause(library()["gain_error"], np.array([0.15]), f"response {model.responses[0]}")
    result = fit(lines, Hypothesis(shape, np.zeros(shape.size), (cause,)), iterations=20)
    before, after = result.covariance[-1, -1], with_form_spread(result, lines).covariance[-1, -1]
    assert before <= after < 1.3 * before


@pytest.mark.parametrize(("rate", "change"), [(1.0, 4e5), (3.0, -2e5), (6.0, 1e5)])
def test_a_bent_drift_may_be_an_exponential_one(rate: float, change: float) -> None:
    """The numbers of the best parabola, by least squares on a fine grid, lead back to the exponential course."""
    time = np.linspace(0, 1, 20001)
    course = change * (1 - np.exp(-rate * time)) / (1 - np.exp(-rate))
    columns = np.column_stack([np.ones_like(time), time, 4 * (time - 0.5) ** 2 - 1])
    _, parabola, bend = np.linalg.lstsq(columns, course, rcond=None)[0]
    assert abs(parabola) < 0.99 * abs(change)
    assert PHYSICS.other_course(np.array([parabola, 0.2, bend])) == pytest.approx([change, 0.2, bend], rel=1e-3)


def test_an_even_drift_owes_nothing_to_another_course() -> None:
    even = np.array([3e4, 0.5, 10.0])
    assert PHYSICS.other_course(even) == pytest.approx(even)
