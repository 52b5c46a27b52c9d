"""The covariance of an update in derived results, where a part that is rigid in the file may be compliant."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from millfrf.robot_model import SpatialCase, in_posture, modes_at, numbered_robot_text, read_robot
from millfrf.robot_model.model_updating.bands import RobotUncertainty, drawn_robots
from millfrf.robot_model.model_updating.changed_structure import free_parameters
from millfrf.steps.robot.uncertainty import frequency_errors

OPEN = ("joint joint_6 damping", "joint joint_6 stiffness")


def updated(robot: str = "staubli_rx160") -> tuple[SpatialCase, np.ndarray]:
    """A robot of rigid links, known to 2 % of the prior; no measurement determines its last joint."""
    case = read_robot(robot)
    assert isinstance(case, SpatialCase)
    parameters = free_parameters(case.robot)
    share = np.array([1.0 if parameter.name in OPEN else 0.02 for parameter in parameters])
    covariance = np.diag((share * [parameter.spread for parameter in parameters]) ** 2)
    uncertainty = RobotUncertainty(parameters, np.zeros(len(parameters)), covariance)
    return replace(case, uncertainty=uncertainty), next(iter(case.poses.values()))


def test_a_rigid_tool_and_base_that_may_be_compliant_add_no_modes() -> None:
    case, posture = updated()
    plain = in_posture(replace(case, uncertainty=None), posture).known_model()
    model = in_posture(case, posture).known_model()
    assert model.covariance is not None
    assert np.isfinite(model.covariance).all()
    kept = len(model.poles)
    assert kept >= 3
    assert model.poles == pytest.approx(plain.poles[:kept], rel=1e-9)
    assert model.frf(np.array([1.0])).values == pytest.approx(plain.frf(np.array([1.0])).values, rel=1e-6)


def test_errors_of_frequencies_are_those_of_drawn_robots() -> None:
    case, posture = updated()
    assert case.uncertainty is not None
    errors = in_posture(case, posture).known_model().standard_errors()
    assert errors is not None
    q = posture
    drawn = [modes_at(robot, q).frequencies[:3] for robot in drawn_robots(case.robot, case.uncertainty, 300, seed=3)]
    assert errors[0][:3] == pytest.approx(np.std(drawn, axis=0), rel=0.2)


def test_a_stiffness_that_no_measurement_determines_gives_a_warning(tmp_path: Path) -> None:
    text = numbered_robot_text("staubli_rx160")
    rows = "".join(
        f'[[update.numbers]]\nname = "joint joint_{n} stiffness"\nkind = "stiffness"\nframe = "joint_{n}"\n'
        f'group = "turning"\nspread = 0.7\nvalue = 0.0\ntold = {stated}\nsource = "robot update"\n'
        for n, stated in ((5, "true"), (6, "false"))
    )
    head = (
        '[update]\nsource = "robot update"\nverdict = "explained"\nnamed = []\ncovariance = [[1e-6, 0.0], [0.0, 0.4]]\n'
    )
    path = tmp_path / "updated.toml"
    path.write_text(f"{text}\n{head}{rows}")
    case = read_robot(path)
    warnings = in_posture(case, next(iter(case.poses.values()))).warnings
    assert [line for line in warnings if "do not determine the stiffness of joint joint_6" in line]
    assert not [line for line in warnings if "joint_5" in line]


def test_errors_in_a_map_are_the_scatter_of_drawn_robots() -> None:
    case, posture = updated()
    assert case.uncertainty is not None
    other = posture + np.radians([10.0, 5.0, -10.0, 0.0, 10.0, 0.0])
    errors = frequency_errors(case, [posture, None, other])
    assert errors is not None
    assert np.isnan(errors[1])
    robots = drawn_robots(case.robot, case.uncertainty, 300, seed=4)
    drawn = [[modes_at(robot, q).frequencies[0] for q in (posture, other)] for robot in robots]
    assert errors[[0, 2]] == pytest.approx(np.std(drawn, axis=0), rel=0.2)
    assert frequency_errors(replace(case, uncertainty=None), [posture]) is None
