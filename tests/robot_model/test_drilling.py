"""Drilling with a robot: deviations, budget; and the chain in natural coordinates."""

from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import eigh

from millfrf.core import InputError
from millfrf.cutting import Drill, drilling_load, fitted_to_catalogue
from millfrf.robot_model import (
    LoadUncertainty,
    UncertaintyBudget,
    deformation_uncertainty,
    deviation_map,
    drilling_wrench,
    lateral_uncertainty,
    measured_machining_uncertainty,
    monte_carlo_deformation,
    position_tolerance,
    position_verdict,
    read_planar_robot,
    read_spatial_robot,
    rigid_matrices,
    structure_at,
    tip_compliance,
    tool_down,
    tool_jacobian,
)
from millfrf.robot_model.machining.drilling_deviation import joint_deformation, joint_deviation
from millfrf.robot_model.machining.uncertainty_budget import machining_uncertainty
from millfrf.robot_model.natural_coordinates import NaturalChain

ROBOT = read_spatial_robot("staubli_rx170").robot
READY = read_spatial_robot("staubli_rx170").poses["ready"]
DRILL = Drill(8e-3)


def test_deviation_is_the_joint_compliance_for_small_loads() -> None:
    wrench = np.array([1.0, -0.5, 2.0, 0.1, 0.0, 0.2])
    jacobian = tool_jacobian(ROBOT.mechanism, READY)
    stiffness = np.array([joint.stiffness[5] for joint in ROBOT.joints])
    linear = -((jacobian / stiffness) @ jacobian.T @ wrench)[:3]
    assert joint_deviation(ROBOT, READY, wrench) == pytest.approx(linear, rel=1e-4, abs=1e-12)
    elastic = -(tip_compliance(structure_at(ROBOT, READY)) @ wrench)[:3]
    assert np.linalg.norm(elastic) > np.linalg.norm(linear)  # links give way too
    assert np.linalg.norm(elastic) < 1.3 * np.linalg.norm(linear)
    soft = joint_deformation(ROBOT, READY, wrench, position_gain=stiffness)
    assert soft == pytest.approx(2 * joint_deformation(ROBOT, READY, wrench))


def test_thrust_pushes_the_robot_back_and_feed_makes_it_worse() -> None:
    places = [tool_down([x, 0.1, 0.8]) for x in (0.6, 1.0, 1.4, 3.0)]
    forces = fitted_to_catalogue(DRILL)
    maps = [deviation_map(ROBOT, places, drilling_load(DRILL, feed, *forces)) for feed in (0.1e-3, 0.2e-3)]
    assert maps[0].reached.tolist() == [True, True, True, False]
    sizes = [np.linalg.norm(result.deviations[:3], axis=1) for result in maps]
    assert np.all(sizes[1] > sizes[0])
    assert sizes[0][2] > sizes[0][0]  # an extended arm gives way more
    assert np.all(maps[0].deviations[:3, 2] < 0)  # the real place is higher than the nominal one
    with pytest.raises(InputError, match="either"):
        deviation_map(ROBOT, places, drilling_load(DRILL, 1e-4, *forces), links=True, position_gain=np.ones(6))


def test_budget_of_the_paper() -> None:
    """+-40 um of the robot with +-30 um (8 mm) and +-60 um (12 mm) of machining."""
    small = UncertaintyBudget(40e-6, 0.0, measured_machining_uncertainty(8e-3))
    large = UncertaintyBudget(40e-6, 0.0, measured_machining_uncertainty(12e-3))
    assert small.work == pytest.approx(50e-6)
    assert large.work == pytest.approx(72.1e-6, abs=0.05e-6)
    assert small.process_share == pytest.approx(0.36)
    assert machining_uncertainty(2e-6, 3e-6, 6e-6) == pytest.approx(7e-6)
    with pytest.raises(InputError, match="8 to 12 mm"):
        measured_machining_uncertainty(5e-3)


def test_what_nobody_told_is_left_out_and_said() -> None:
    unknown = UncertaintyBudget(None, 30e-6, 40e-6)
    assert unknown.unknown == ("robot without load",)
    assert unknown.work == pytest.approx(50e-6)
    with pytest.raises(InputError, match="is unknown"):
        _ = unknown.process_share
    assert UncertaintyBudget(40e-6, 0.0, None).unknown == ("machining",)
    for name in ("kuka_kr90_r3100", "staubli_rx170", "fanuc_s420if"):
        assert read_spatial_robot(name).repeatability is None  # no source gives it: 40 um is another robot's


def test_a_position_is_graded_by_the_zone_of_its_axis() -> None:
    """An axis 0.1 mm off, known to 0.05 mm, lies in a zone of 0.3 mm; trials of such axes stay in it."""
    needed = position_tolerance(0.1e-3, 0.05e-3)
    assert needed == pytest.approx(0.3e-3)
    rng = np.random.default_rng(3)
    axes = np.array([0.1e-3, 0.0]) + 0.025e-3 * rng.standard_normal((4000, 2))
    inside = np.linalg.norm(axes, axis=1) <= needed / 2
    assert 0.95 < inside.mean() < 0.99
    assert np.mean(np.linalg.norm(axes, axis=1) <= 0.05e-3) < 0.05  # without the systematic part hardly one is inside
    assert position_verdict(0.3e-3, 0.4e-3) == "holds"
    assert position_verdict(0.5e-3, 0.4e-3, ("machining",)) == "does not hold"
    assert position_verdict(0.3e-3, 0.4e-3, ("machining",)) == "cannot tell"
    with pytest.raises(InputError, match="positive"):
        position_verdict(0.3e-3, 0.0)
    with pytest.raises(InputError, match="finite"):
        position_tolerance(np.nan, 1e-6)


def test_lateral_uncertainty_is_the_spread_of_trials() -> None:
    """Twice the largest standard deviation across the drill of trials with each stiffness and the force drawn."""
    wrench = np.array([150.0, -80.0, 400.0, 0.5, 0.0, 1.0])
    known = LoadUncertainty(0.05, 0.05)
    axis = np.array([0.0, 0.0, -1.0])
    result = lateral_uncertainty(ROBOT, READY, wrench, known, axis)
    rng = np.random.default_rng(8)
    nominal = np.array([joint.stiffness for joint in ROBOT.joints])
    trials = []
    for _ in range(1500):
        factors = np.exp(known.stiffness * rng.standard_normal(len(nominal)))
        pushed = wrench * (1 + known.wrench * rng.standard_normal())
        trials.append(joint_deviation(ROBOT.with_stiffness(nominal * factors[:, None]), READY, pushed)[:2])
    assert 2 * np.sqrt(np.linalg.eigvalsh(np.cov(np.array(trials).T))[-1]) == pytest.approx(result, rel=0.06)


def test_monte_carlo_agrees_with_the_budget() -> None:
    load = drilling_load(DRILL, 0.2e-3, *fitted_to_catalogue(DRILL))
    wrench = drilling_wrench(load, np.array([0.0, 0.0, -1.0]))
    known = LoadUncertainty()
    first_order = deformation_uncertainty(ROBOT, READY, wrench, known)
    _, trial = monte_carlo_deformation(ROBOT, READY, wrench, known, trials=600)
    assert trial == pytest.approx(first_order, rel=0.12)


@pytest.mark.parametrize("name", ["P1", "P2", "P3"])
def test_natural_coordinates_are_the_lagrange_model(name: str) -> None:
    case = read_planar_robot("chen_2026")
    chain = NaturalChain(case.robot)
    mass, stiffness = chain.matrices(chain.start(case.poses[name]))
    expected_mass, expected_stiffness = rigid_matrices(case.robot, case.poses[name])
    assert mass == pytest.approx(expected_mass, rel=1e-9)
    frequencies = np.sqrt(eigh(stiffness, mass, eigvals_only=True)) / (2 * pi)
    expected = np.sqrt(eigh(expected_stiffness, expected_mass, eigvals_only=True)) / (2 * pi)
    assert frequencies == pytest.approx(expected, rel=1e-9)


@settings(max_examples=30)
@given(st.lists(st.floats(-3.1, 3.1), min_size=3, max_size=3))
def test_constraints_hold_and_their_jacobian_is_the_derivative(angles: list[float]) -> None:
    chain = NaturalChain(read_planar_robot("chen_2026").robot)
    coordinates = chain.start(np.array(angles))
    assert np.abs(chain.constraints(coordinates)).max() < 1e-12
    step = 1e-6
    for column, row in enumerate(np.eye(9)):
        slope = (chain.constraints(coordinates + step * row) - chain.constraints(coordinates - step * row)) / (2 * step)
        assert chain.jacobian(coordinates)[:, column] == pytest.approx(slope, abs=1e-8)
    moved = chain.place(np.array(angles) + 0.05, coordinates)
    assert moved[4:6] == pytest.approx(chain.robot.tip(np.array(angles) + 0.05), abs=1e-9)
