"""Sections of links from deflections: a cantilever in closed form, and the forearm of Belchior et al. (C4)."""

import importlib.util
from math import pi
from pathlib import Path

import numpy as np
import pytest

from millfrf.core import InputError
from millfrf.robot_model import (
    Deflection,
    Frame,
    Mechanism,
    SpatialRobot,
    apply_elastic,
    identify_elastic,
    joint_parameters,
    link_parameters,
    predicted_deflections,
    tube_diameters,
)
from millfrf.robot_model.finite_elements.beam_element import Material, hollow_circle
from millfrf.robot_model.spatial.spatial_robot import ElasticJoint, Link

LENGTH, STEEL = 1.2, Material(210e9, 81e9, 7850.0)
EXAMPLE = Path(__file__).resolve().parents[3] / "examples" / "robot_stiffness_identification.py"


def cantilever(turning: float, outer: float, inner: float, *, shear: bool, elements: int = 1) -> SpatialRobot:
    """A joint about the base's z, then a tube along x."""
    section = hollow_circle(outer, inner, STEEL, timoshenko=shear)
    return SpatialRobot(
        Mechanism((Frame("1", "0"),), "1"),
        (ElasticJoint("1", (0, 1), np.array([np.inf] * 5 + [turning])),),
        (Link((1, 2), section, elements),),
        (),
        {2: ("1", np.array([LENGTH, 0.0, 0.0]))},
        2,
    )


def closed_form(turning: float, bending: float, shear: float, force: float, moment: float, arm: float) -> float:
    """Sideways motion of a target ``arm`` beyond the tip: spring, bending, shear (Timoshenko's cantilever)."""
    there = force * (LENGTH**2 / turning + LENGTH**3 / (3 * bending) + LENGTH / shear)
    there += moment * (LENGTH / turning + LENGTH**2 / (2 * bending))
    turned = force * (LENGTH / turning + LENGTH**2 / (2 * bending)) + moment * (1 / turning + LENGTH / bending)
    return there + turned * arm


@pytest.mark.parametrize(("shear", "elements"), [(False, 1), (True, 1), (True, 3)])
def test_a_cantilever_is_found_from_its_closed_form(shear: bool, elements: int) -> None:
    """Spring and E I from forces and moments at the tip, both 40 % off at the start."""
    turning, outer, inner = 4e5, 0.1, 0.08
    true = hollow_circle(outer, inner, STEEL, timoshenko=shear)
    cases = []
    for force, moment, arm in ((500.0, 0.0, 0.0), (0.0, 400.0, 0.0), (500.0, 0.0, 0.3), (300.0, -300.0, 0.3)):
        moved = closed_form(turning, true.bending_z, true.shear_y, force, moment, arm)
        wrench = np.array([0.0, force, 0.0, 0.0, 0.0, moment])
        cases.append(Deflection(np.zeros(1), wrench, np.array([0.0, moved, 0.0]), np.array([arm, 0.0, 0.0])))
    start = cantilever(turning, outer, inner, shear=shear, elements=elements)
    parameters = (*joint_parameters(start), link_parameters(start)[0])
    assert [each.name(start) for each in parameters] == ["joint 1 turning", "link 1-2 bending"]
    true_values = np.array([each.value(start) for each in parameters])
    assert true_values == pytest.approx([turning, STEEL.young * pi / 64 * (outer**4 - inner**4)])
    off = apply_elastic(start, parameters, 1.4 * true_values)
    result = identify_elastic(off, cases, 1e-6, parameters)
    assert result.identifiable.all()
    assert result.values == pytest.approx(true_values, rel=1e-4)


def test_slopes_are_those_of_differences() -> None:
    """``dC / d ln p`` of every parameter of the FANUC against central differences of the deflections themselves."""
    example = _example()
    robot = example.read_spatial_robot("fanuc_s420if").robot
    parameters = (*joint_parameters(robot), *link_parameters(robot))
    cases = example.measure(robot, example.postures(robot, 3, 5), (800.0, 600.0), 0.0, 2)
    values = np.array([each.value(robot) for each in parameters])
    from millfrf.robot_model.identification.stiffness_identification import _Problem

    jacobian = _Problem(robot, tuple(cases), 1.0, parameters).jacobian(values)
    for column in range(len(parameters)):
        step = 1e-3 * np.eye(len(parameters))[column]
        ahead, behind = (
            predicted_deflections(apply_elastic(robot, parameters, values * np.exp(sign * step)), cases)
            for sign in (1, -1)
        )
        slope = (ahead - behind).ravel() / 2e-3
        assert jacobian[:, column] == pytest.approx(slope, rel=1e-4, abs=1e-9 * np.abs(jacobian).max())


@pytest.mark.long
def test_the_forearm_needs_more_than_one_target() -> None:
    """One target and the paper's camera leave E I of C4 open; three targets 0.3 m out fix it within its error bar."""
    example = _example()
    single = example.link_trial(count=60, targets=1)
    assert not single.identifiable[single.names.index("link 12-13 bending")]
    three = example.link_trial(count=60, targets=3)
    bending = three.names.index("link 12-13 bending")
    assert three.identifiable[bending]
    assert three.relative_errors[bending] < 0.3
    pull = np.log(three.values[bending] / example.TRUE_BENDING) / three.relative_errors[bending]
    assert abs(pull) < 3
    assert not three.identifiable[three.names.index("link 12-13 axial")]


def test_tubes_that_cannot_be_are_refused() -> None:
    with pytest.raises(InputError, match="no round tube"):
        tube_diameters(1e-2, 1e-6)


def _example() -> object:
    specification = importlib.util.spec_from_file_location("robot_stiffness_identification", EXAMPLE)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module
