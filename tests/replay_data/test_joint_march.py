"""Joint laws in the time domain against an independent integrator, and limits that are known."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from replay_data import posture_robot, tip_motion
from replay_data.joints import JOINT_LAWS, LINEAR, hysteretic_stretch, joint_force

ROBOT = posture_robot(np.random.default_rng(4))
DIRECTION = np.array([0.6, -0.48, 0.64])
STIFFNESS = float(1 / (DIRECTION @ ROBOT.receptance(np.array([1e-6]))[0].real @ DIRECTION))
"""Along the joint, N/m."""

STEP = 1 / 8192


def force_at(times: np.ndarray) -> np.ndarray:
    swept = np.sin(2 * math.pi * (6 * times + 10 * times**2))
    return np.stack([40 * swept, 25 * np.cos(90 * times) - 25, 30 * np.sin(130 * times)], axis=-1)


def reference(law: str, values: np.ndarray, coupling: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Displacement by DOP853 on ``M X'' + C X' + K X = F - d g - G X'`` in real modal coordinates."""
    shapes, natural, zeta = ROBOT.left.real, 2 * np.pi * ROBOT.natural_frequencies, ROBOT.damping_ratios

    def rate(t: float, state: np.ndarray) -> np.ndarray:
        place, speed = state[:3], state[3:]
        tip, tip_speed = place @ shapes, speed @ shapes
        g = joint_force(JOINT_LAWS[law], values, DIRECTION @ tip, DIRECTION @ tip_speed, t, 0.0)
        pull = force_at(np.array(t)) - DIRECTION * g - coupling @ tip_speed
        return np.concatenate([speed, shapes @ pull - 2 * zeta * natural * speed - natural**2 * place])

    run = solve_ivp(rate, (0, times[-1]), np.zeros(6), "DOP853", times, rtol=1e-9, atol=1e-14, max_step=2e-3)
    return np.asarray(run.y[:3].T @ shapes)


@pytest.mark.parametrize(
    ("law", "values", "turn"),
    [
        ("linear", (0.0, 0.0), 0.0),
        ("linear", (0.0, 0.0), 4000.0),
        ("stiffness_hardening", (STIFFNESS / 1e-10, 0.0), 0.0),
        ("stiffness_softening", (0.7 * STIFFNESS, 5e-6), 0.0),
        ("backlash", (0.6 * STIFFNESS, 1e-5), 0.0),
        ("coulomb_friction", (12.0, 5e-4), 0.0),
        ("pose_drift", (0.8 * STIFFNESS, 1.5), 0.0),
        ("stiffness_modulation", (0.6 * STIFFNESS, 25.0), 0.0),
    ],
)
def test_marching_agrees_with_an_independent_integrator(law: str, values: tuple[float, float], turn: float) -> None:
    times = STEP * np.arange(8192)
    numbers = np.array([*values, 0.0])
    coupling = turn * np.array([[0.0, -0.6, 0.5], [0.6, 0.0, -0.4], [-0.5, 0.4, 0.0]])
    done = LINEAR._replace(name=law, direction=DIRECTION, parameters=numbers, coupling=coupling)
    result = tip_motion(ROBOT, force_at(times), STEP, done)[0]
    expected = reference(law, numbers, coupling, times)
    np.testing.assert_allclose(result, expected, atol=2e-3 * np.abs(expected).max())
    if law != "linear" or turn:
        linear = tip_motion(ROBOT, force_at(times), STEP)[0]
        assert np.abs(linear - expected).max() > 0.05 * np.abs(expected).max()  # the law is not a trifle


def test_velocity_and_acceleration_are_the_derivatives_of_displacement() -> None:
    times = STEP * np.arange(8192)
    law = LINEAR._replace(
        name="stiffness_softening", direction=DIRECTION, parameters=np.array([0.7 * STIFFNESS, 5e-6, 0.0])
    )
    x, v, a = tip_motion(ROBOT, force_at(times), STEP, law)
    inner = slice(2000, -1)
    np.testing.assert_allclose(np.gradient(x, STEP, axis=0)[inner], v[inner], atol=1e-3 * np.abs(v).max())
    np.testing.assert_allclose(np.gradient(v, STEP, axis=0)[inner], a[inner], atol=5e-3 * np.abs(a).max())


def test_hysteresis_yields_remembers_and_takes_energy() -> None:
    values = np.array([1e5, 0.6 / 2e-5, 0.4 / 2e-5])
    turns = np.sin(np.linspace(0, 6 * np.pi, 30001)) * 3e-4
    stretch = [0.0]
    for moved in np.diff(turns):
        stretch.append(hysteretic_stretch(JOINT_LAWS["hysteresis"], values, stretch[-1], float(moved)))
    force = values[0] * np.array(stretch)
    assert np.abs(force).max() == pytest.approx(values[0] * 2e-5, rel=1e-3)  # k / (beta + gamma)
    loop = float(np.sum(0.5 * (force[20001:] + force[20000:-1]) * np.diff(turns[20000:])))
    assert 0.7 * 4 * 3e-4 * 2.0 < loop < 4 * 3e-4 * 2.0  # a little less than the rectangle of a slider


def test_half_the_step_gives_the_same_friction() -> None:
    law = LINEAR._replace(name="coulomb_friction", direction=DIRECTION, parameters=np.array([15.0, 1e-4, 0.0]))
    coarse, fine = (
        tip_motion(ROBOT, force_at(step * np.arange(round(1 / step))), step, law)[0] for step in (STEP, STEP / 2)
    )
    np.testing.assert_allclose(coarse, fine[::2], atol=5e-3 * np.abs(fine).max())
