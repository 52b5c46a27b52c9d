"""Limits at a varied spindle speed: against constant speed, and a simulation in time that shares no code with them."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from millfrf.core import InputError
from millfrf.cutting import MillingProcess, ball_profile
from millfrf.stability import SpeedVariation, certified_numerics, varied_speed_limits, varied_speed_radius
from modal_fit import ModalModel

Real = NDArray[np.float64]
RPM = math.pi / 30
NATURAL, DAMPING = 2 * np.pi * np.array([922.0, 800.0]), np.array([0.011, 0.02])  # rad/s; along X and Y
MASS = np.array([1.34e6, 2e6]) / NATURAL**2


def model() -> ModalModel:
    """One mode along X and one along Y."""
    damped, shapes, points = NATURAL * np.sqrt(1 - DAMPING**2), np.eye(2, dtype=complex), ("TCP:+X", "TCP:+Y")
    return ModalModel(-DAMPING * NATURAL + 1j * damped, shapes / (2j * MASS * damped)[:, None], shapes, points, points)


def cut(kind: str = "down", teeth: int = 3, helix: float = 0.0) -> MillingProcess:
    """Half immersion in an aluminium alloy."""
    start, leave = (0.0, math.pi / 2) if kind == "up" else (math.pi / 2, math.pi)
    return MillingProcess(teeth, 0.0127, math.pi / 2, 6e8, 1 / 3, 0.1, start, leave, 1e-4, helix_angle=helix)


@pytest.mark.parametrize(
    "process", [cut("down"), cut("up", 2, 0.3), cut("down", 4, 0.6)], ids=["straight", "up", "helix"]
)
def test_a_variation_that_vanishes_leaves_the_limits_of_the_lobes(process: MillingProcess) -> None:
    speeds = np.array([2500.0, 9000.0, 15000.0]) * RPM
    varied = varied_speed_limits(model(), process, speeds, 0.01, SpeedVariation(0.0, 1.0))
    constant = certified_numerics(model(), process, speeds, 0.01)
    np.testing.assert_allclose(varied.depth_limits, constant.depth_limits, rtol=5e-3)
    assert set(varied.status) == {"not-verified"}


def stiffness(process: MillingProcess, angle: float) -> Real:
    """Force per motion in X and Y and metre of depth, of straight edges."""
    total = np.zeros((2, 2))
    for tooth in range(process.teeth):
        phi = (angle + 2 * math.pi * tooth / process.teeth) % (2 * math.pi)
        if process.start_angle < phi < process.exit_angle:
            sine, cosine = math.sin(phi), math.cos(phi)
            force = [-cosine - process.krc * sine, sine - process.krc * cosine]
            total += process.ktc * np.outer(force, [sine, cosine])
    return total


def growth(process: MillingProcess, speed: float, depth: float, amplitude: float, frequency: float) -> float:
    """Growth (log) of a vibration per second in steps of time; the delay is found from the angle's course."""
    step, seconds = 1.2e-5, 1.2
    times = np.arange(int(seconds / step)) * step
    fine = np.linspace(0.0, 1.3 * speed * seconds / (1 - amplitude), 400_000)
    passed = np.concatenate(
        [[0.0], np.cumsum(np.diff(fine) / (speed * (1 + amplitude * np.sin(frequency * fine[:-1]))))]
    )
    angles = np.interp(times + step / 2, passed, fine)
    back = (np.interp(angles - 2 * math.pi / process.teeth, fine, passed) / step).clip(0)
    damped = NATURAL * np.sqrt(1 - DAMPING**2)
    decay = np.exp((-DAMPING * NATURAL + 1j * damped) * step)  # of z = v - conj(p) x, whose rate is p z + F / m
    pole = -DAMPING * NATURAL + 1j * damped
    push = (decay - 1) / pole / MASS
    z, motion = np.full(2, 1e-6 + 0j), np.zeros((len(times) + 1, 2))
    motion[0] = z.imag / damped
    for k in range(len(times)):
        velocity = z.real - DAMPING * NATURAL * motion[k]
        whole = int(back[k])
        share = back[k] - whole
        before = (1 - share) * motion[whole] + share * motion[whole + 1] if back[k] > 0 else np.zeros(2)
        force = depth * stiffness(process, float(angles[k])) @ (motion[k] + step / 2 * velocity - before)
        z = decay * z + push * force
        motion[k + 1] = z.imag / damped
    sizes = [float(np.sqrt(np.mean(part**2))) for part in np.array_split(motion, 12)]
    return float(np.polyfit(np.arange(6), np.log(sizes[6:]), 1)[0])


@pytest.mark.parametrize(("speed", "amplitude", "frequency"), [(2000.0, 0.2, 0.5), (9000.0, 0.1, 0.25)])
def test_a_vibration_decays_below_the_limit_and_grows_above(speed: float, amplitude: float, frequency: float) -> None:
    process = cut("down")
    lobes = varied_speed_limits(model(), process, np.array([speed * RPM]), 0.01, SpeedVariation(amplitude, frequency))
    [limit] = lobes.depth_limits
    below, above = (growth(process, speed * RPM, share * limit, amplitude, frequency) for share in (0.96, 1.04))
    assert below < 0 < above, (limit, below, above)


def test_a_slow_speed_gains_by_variation_and_the_radius_is_that_of_the_limit() -> None:
    """At low speed a variation of the speed lifts the limit (Insperger & Stepan 2004)."""
    process, speed, variation = cut("up"), 2000 * RPM, SpeedVariation(0.2, 0.5)
    [limit] = varied_speed_limits(model(), process, np.array([speed]), 0.01, variation).depth_limits
    [constant] = certified_numerics(model(), process, np.array([speed]), 0.01).depth_limits
    assert (limit, constant) == (pytest.approx(0.48e-3, rel=0.02), pytest.approx(0.26e-3, rel=0.02))
    assert varied_speed_radius(model(), process, speed, float(0.98 * limit), variation) < 1
    assert varied_speed_radius(model(), process, speed, float(1.02 * limit), variation) > 1


def test_a_variation_lowers_the_limit_in_a_pocket_between_lobes() -> None:
    speeds = np.array([9000.0]) * RPM
    [limit] = varied_speed_limits(model(), cut("up"), speeds, 0.01, SpeedVariation(0.2, 0.5)).depth_limits
    [constant] = certified_numerics(model(), cut("up"), speeds, 0.01).depth_limits
    assert (limit, constant) == (pytest.approx(0.47e-3, rel=0.02), pytest.approx(0.85e-3, rel=0.02))


@pytest.mark.parametrize(("typed", "passings"), [(0.3333333, 9), (0.05, 60), (0.04166667, 72)])
def test_a_typed_fraction_repeats_after_its_revolutions(typed: float, passings: int) -> None:
    assert SpeedVariation(0.1, typed).tooth_passings(3) == passings


@pytest.mark.parametrize("typed", [0.333, 0.001, 0.123456789])
def test_the_fraction_that_a_refusal_names_is_taken(typed: float) -> None:
    with pytest.raises(InputError, match="does not repeat within 24 revolutions") as refusal:
        SpeedVariation(0.1, typed).tooth_passings(3)
    assert SpeedVariation(0.1, float(str(refusal.value).rsplit(" ", 1)[1])).tooth_passings(3) > 0


def test_what_it_does_not_take_is_refused() -> None:
    speeds = np.array([3000.0]) * RPM
    ball = MillingProcess(3, 0.0127, math.pi / 2, 6e8, 0.3, 0.1, 0.0, 3.0, 1e-4, profile=ball_profile(0.0127))
    with pytest.raises(InputError, match="a limit at a varied speed does not take a cutter with a ball end"):
        varied_speed_limits(model(), ball, speeds, 0.01, SpeedVariation(0.1, 0.5))
    with pytest.raises(InputError, match="does not repeat within 24 revolutions"):
        varied_speed_limits(model(), cut(), speeds, 0.01, SpeedVariation(0.1, 0.123456789))
