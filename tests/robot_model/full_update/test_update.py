"""An update of all parameters together: which it frees, its derivatives, its file, and its verdicts."""

from pathlib import Path

import numpy as np
import pytest
import tomlkit
from numpy.typing import NDArray

from estimation import Frf, FrfCovariance
from millfrf.core import TIP
from millfrf.robot_model import (
    PosedReceptance,
    SpatialCase,
    SpatialRobot,
    in_posture,
    measured_frf,
    measured_model,
    modal_model_at,
    read_spatial_robot,
    update_robot,
    updated_document,
)
from millfrf.robot_model.files.robot_files import robot_text
from millfrf.robot_model.model_updating.changed_structure import changed_by, free_parameters
from millfrf.robot_model.model_updating.matrices import posture_system
from millfrf.robot_model.model_updating.posture_response import PostureResponse
from millfrf.robot_model.spatial.spatial_modes import frf_at

Real = NDArray[np.float64]
Q = np.radians([0.0, -10.0, 100.0, 20.0, 60.0, 10.0])
AXIS = np.arange(5.0, 60.0, 0.5)


@pytest.fixture(scope="module")
def kuka() -> SpatialCase:
    return read_spatial_robot("kuka_kr90_r3100")


def changes(robot: SpatialRobot, **differences: float) -> Real:
    names = [parameter.name.replace(" ", "_") for parameter in free_parameters(robot)]
    x = np.zeros(len(names))
    for name, value in differences.items():
        x[names.index(name)] = value
    return x


def measured(robot: SpatialRobot, count: int = 3, noise: float = 0.02, seed: int = 1) -> list[PosedReceptance]:
    generator = np.random.default_rng(seed)
    cases = []
    for k in range(count):
        q = Q + np.radians(generator.uniform(-40, 40, 6)) * np.array([1, 0.5, 0.5, 1, 1, 1])
        values = frf_at(robot, q, AXIS).values
        level = noise * np.sqrt(np.mean(np.abs(values) ** 2, axis=(1, 2)))
        errors = generator.normal(size=(2, *values.shape)) / np.sqrt(2)
        noisy = values + level[:, None, None] * (errors[0] + 1j * errors[1])
        unit = np.tile(np.eye(3, dtype=complex), (len(AXIS), 1, 1))
        covariance = FrfCovariance(level[:, None, None] ** 2 * unit, unit)
        frf = Frf(AXIS, noisy, TIP, TIP, "receptance", "m/N", AXIS > 0, covariance=covariance)
        cases.append(measured_frf(frf, f"posture {k}", q, (5.0, 60.0)))
    return cases


def test_the_quick_response_is_that_of_the_changed_robot(kuka: SpatialCase) -> None:
    parameters = free_parameters(kuka.robot)
    generator = np.random.default_rng(3)
    x = 0.4 * np.abs(generator.normal(size=len(parameters))) * [parameter.spread for parameter in parameters]
    system = posture_system(kuka.robot, parameters, Q, np.eye(3))
    quick = PostureResponse(system, parameters, x, AXIS, (0, 1, 2), (0, 1, 2)).receptance()
    whole = frf_at(changed_by(kuka.robot, parameters, x), Q, AXIS).values
    assert np.abs(quick - whole).max() < 1e-3 * np.abs(whole).max()


def test_derivatives_are_those_of_differences(kuka: SpatialCase) -> None:
    parameters = free_parameters(kuka.robot)
    # away from zero, where a base's compliance has a kink
    x = 0.2 * np.array([parameter.spread for parameter in parameters])
    system = posture_system(kuka.robot, parameters, Q, np.eye(3))

    def response(x: Real) -> PostureResponse:
        return PostureResponse(system, parameters, x, AXIS, (0, 1, 2), (0, 1, 2))

    computed = response(x)
    slopes, largest = computed.slopes(), np.abs(computed.receptance()).max()
    for i, parameter in enumerate(parameters):
        step = 1e-4 * parameter.spread * np.eye(len(x))[i]
        ahead, behind = (response(x + sign * step).receptance() for sign in (1, -1))
        slope = (ahead - behind) / 2e-4
        apart = np.abs(slope - parameter.spread * slopes[i]).max()
        assert apart < 0.03 * np.abs(slope).max() + 1e-4 * largest, parameter.name


@pytest.mark.long
def test_several_wrong_numbers_are_found_and_named_alone(kuka: SpatialCase, tmp_path: Path) -> None:
    x = changes(kuka.robot, joint_2_stiffness=np.log(0.8), joint_5_stiffness=np.log(0.7), payload_mass=-9.0)
    x += changes(kuka.robot, tool_lateral_compliance=1e-7, base_tilting_compliance=8e-9)
    parameters = free_parameters(kuka.robot)
    truth = changed_by(kuka.robot, parameters, x)
    update = update_robot(kuka.robot, measured(truth), kuka.poses)
    assert update.verdict == "explained"
    assert set(update.names) <= {parameter.name for parameter, value in zip(parameters, x, strict=True) if value}
    assert {"joint 2 stiffness", "joint 5 stiffness"} <= set(update.names)
    off = (update.x - x)[update.determined] / update.errors[update.determined]
    assert np.sqrt(np.mean(off**2)) < 1.6
    assert np.abs(off).max() < 4
    out = tmp_path / "updated.toml"
    out.write_text(updated_document(robot_text("kuka_kr90_r3100"), kuka.robot, update), encoding="utf-8")
    again = read_spatial_robot(out)
    q = Q + 0.3
    new, old = frf_at(again.robot, q, AXIS).values, frf_at(truth, q, AXIS).values
    assert np.abs(new - old).max() < 0.02 * np.abs(old).max()
    assert "no stiffness is printed" in out.read_text(encoding="utf-8")
    model = in_posture(again, Q).known_model()
    assert model.covariance is not None
    errors = model.standard_errors()
    assert errors is not None
    assert 0 < errors[0][0] / model.natural_frequencies[0] < 0.01


@pytest.mark.long
def test_a_right_robot_gets_no_name(kuka: SpatialCase) -> None:
    update = update_robot(kuka.robot, measured(kuka.robot, seed=5))
    assert (update.verdict, update.names) == ("none", ())


@pytest.mark.long
def test_modal_models_update_as_frfs_do(kuka: SpatialCase) -> None:
    x = changes(kuka.robot, joint_2_stiffness=np.log(0.75))
    truth = changed_by(kuka.robot, free_parameters(kuka.robot), x)
    generator = np.random.default_rng(0)
    models = []
    for k in range(3):
        q = Q + generator.uniform(-0.6, 0.6, 6)
        model = modal_model_at(truth, q, highest_frequency=60.0)
        models.append(measured_model(model, f"model {k}", q, (5.0, 60.0)))
    update = update_robot(kuka.robot, models)
    number = [parameter.name for parameter in update.parameters].index("joint 2 stiffness")
    assert abs(update.x[number] - x[number]) < 4 * update.errors[number] + 0.02
    assert update.verdict in ("explained", "partly explained")


@pytest.mark.long
def test_one_posture_leaves_directions_open_and_asks_for_another(kuka: SpatialCase) -> None:
    update = update_robot(kuka.robot, measured(kuka.robot, count=1, noise=0.1), kuka.poses)
    assert update.names == ()
    assert any(direction.names for direction in update.open)
    assert update.next is not None
    assert update.next.gain > 0


@pytest.mark.long
def test_a_document_without_update_is_the_users(kuka: SpatialCase) -> None:
    update = update_robot(kuka.robot, measured(kuka.robot, count=2))
    text = robot_text("kuka_kr90_r3100")
    new = tomlkit.parse(updated_document(text, kuka.robot, update))
    assert [row["source"] for row in new["frames"]] == [row["source"] for row in tomlkit.parse(text)["frames"]]
