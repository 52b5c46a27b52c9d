"""The elastic robot of Belchior et al. 2013: loops, sizes, condensation, identification, compensation."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from millfrf.core import FileFormatError, InputError
from millfrf.robot_model import (
    Deflection,
    ToolPath,
    apply_joint_stiffness,
    close_loops,
    compensate_path,
    identify_joint_stiffness,
    inverse_kinematics,
    predicted_deflections,
    read_spatial_robot,
    read_tool_path,
    stiffness_names,
    structure_at,
    tip_compliance,
    tool_jacobian,
    write_compensated_path,
)
from millfrf.robot_model.finite_elements.statics import constrained_system, tip_stiffness
from millfrf.robot_model.finite_elements.structure import coordinate_basis, stiffness_matrix
from millfrf.robot_model.kinematics.mechanism import posture_warnings

FANUC = read_spatial_robot("fanuc_s420if").robot
READY = np.radians([0.0, 20.0, 0.0, 45.0, 0.0, 10.0])


def _postures(n: int, seed: int = 1) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    low, high = np.radians([-40, -20, -90, 20, -90, -20]), np.radians([40, 40, 90, 80, 90, 25])
    return [close_loops(FANUC.mechanism, rng.uniform(low, high)) for _ in range(n)]


@settings(max_examples=20)
@given(st.floats(-0.9, 0.7), st.floats(-0.6, 0.6))
def test_loop_is_the_parallelogram_of_the_paper(second: float, seventh: float) -> None:
    """q3 = q9 = -q8 = q2 + q7, from the geometry alone; at +-90 degrees crank and arm are in line, a singularity."""
    q = close_loops(FANUC.mechanism, np.array([0.3, second, 0.1, 0.5, 0.0, seventh]))
    by_name = dict(zip([FANUC.mechanism.frames[i].name for i in FANUC.mechanism.moving], q, strict=True))
    assert [by_name["3"], by_name["9"], -by_name["8"]] == pytest.approx([second + seventh] * 3, abs=1e-9)


def test_jacobian_is_the_derivative_with_loops_closed() -> None:
    mechanism = FANUC.mechanism
    tool = mechanism.index(mechanism.tool)
    analytic = tool_jacobian(mechanism, close_loops(mechanism, READY))[:3]
    for column in range(6):
        step = 1e-6 * np.eye(6)[column]
        ahead, behind = (mechanism.transforms(close_loops(mechanism, READY + s))[tool, :3, 3] for s in (step, -step))
        assert analytic[:, column] == pytest.approx((ahead - behind) / 2e-6, abs=1e-8)


def test_inverse_kinematics_returns_to_the_pose() -> None:
    q = close_loops(FANUC.mechanism, READY)
    target = FANUC.mechanism.transforms(q)[FANUC.mechanism.index("E")]
    result = inverse_kinematics(FANUC.mechanism, target, READY + 0.1)
    reached = FANUC.mechanism.transforms(result)[FANUC.mechanism.index("E")]
    assert reached == pytest.approx(target, abs=1e-9)
    target[:3, 3] *= 10
    with pytest.raises(InputError, match="does not reach"):
        inverse_kinematics(FANUC.mechanism, target, READY)


def test_limits_and_singularities_are_named() -> None:
    q = close_loops(FANUC.mechanism, np.array([0.0, 0.3, 0.0, 0.0, 0.0, 0.2]))
    assert any("singularity" in warning for warning in posture_warnings(FANUC.mechanism, q))
    q[0] = 4.0
    assert any("joint 1 = 4 is outside" in warning for warning in posture_warnings(FANUC.mechanism, q))


def test_sizes_of_the_paper() -> None:
    structure = structure_at(FANUC, close_loops(FANUC.mechanism, READY))
    system = constrained_system(structure)
    assert stiffness_matrix(structure).shape == (102, 102)
    assert system.stiffness.shape == (96, 96)
    assert len(system.constraints) == 42
    assert system.matrix.shape == (138, 138)
    assert len(stiffness_names(FANUC)) == 33


def test_saddle_matrix_is_symmetric_and_invertible_but_not_definite() -> None:
    matrix = constrained_system(structure_at(FANUC, close_loops(FANUC.mechanism, READY))).matrix
    eigenvalues = np.linalg.eigvalsh(matrix)
    assert np.abs(matrix - matrix.T).max() <= 1e-9 * np.abs(matrix).max()
    assert int((eigenvalues < 0).sum()) == 42
    assert np.abs(eigenvalues).min() > 0


def test_condensation_multipliers_and_coordinates_agree() -> None:
    for q in _postures(3):
        structure = structure_at(FANUC, q)
        compliance = tip_compliance(structure)
        assert tip_stiffness(structure) @ compliance == pytest.approx(np.eye(6), abs=1e-8)
        basis = coordinate_basis(structure)
        tip = basis[6 * structure.tip : 6 * structure.tip + 6]
        reduced = tip @ np.linalg.solve(basis.T @ stiffness_matrix(structure) @ basis, tip.T)
        assert reduced == pytest.approx(compliance, rel=1e-7, abs=1e-9 * np.abs(compliance).max())
        assert np.linalg.eigvalsh(compliance).min() > 0


@settings(max_examples=10)
@given(st.lists(st.floats(-1, 1), min_size=12, max_size=12), st.integers(0, 2**16))
def test_work_is_reciprocal_and_stored(loads: list[float], seed: int) -> None:
    """Betti: the work of one load over the other's displacement does not depend on the order."""
    first, second = np.array(loads[:6]), np.array(loads[6:])
    compliance = tip_compliance(structure_at(FANUC, _postures(1, seed)[0]))
    assert first @ compliance @ second == pytest.approx(second @ compliance @ first, rel=1e-9, abs=1e-15)
    assert first @ compliance @ first >= 0


def test_stiff_everything_but_joints_is_the_jacobian_formula() -> None:
    """``C = J K^-1 J^T`` of flexible joints alone, over the loop: joint 7 drives the forearm."""
    turning = np.array([j.stiffness[5] for j in FANUC.joints])
    stiff = np.full((9, 6), 1e11)
    stiff[:, 5] = turning
    links = tuple(replace(link, section=None) for link in FANUC.links)
    rigid = replace(FANUC, links=links).with_stiffness(stiff)
    q = close_loops(FANUC.mechanism, READY)
    jacobian = tool_jacobian(FANUC.mechanism, q)
    driven = turning[[0, 1, 3, 4, 5, 6]]
    compliance = tip_compliance(structure_at(rigid, q))
    assert compliance == pytest.approx((jacobian / driven) @ jacobian.T, rel=1e-3, abs=1e-3 * np.abs(compliance).max())


def _measured(robot: object, postures: list[np.ndarray], forces: tuple[float, float], noise: float) -> list[Deflection]:
    rng = np.random.default_rng(5)
    cases = []
    for q in postures:
        direction = rng.normal(size=3)
        pull = forces[1] * direction / np.linalg.norm(direction) + [0, 0, forces[0]]
        arm = [0.05, 0.1, -0.15]  # the loads act beside the tool's centre, so they turn it too
        cases.append(Deflection(q, np.concatenate([pull, np.cross(arm, pull)]), np.zeros(3)))
    clean = predicted_deflections(robot, cases)  # type: ignore[arg-type]
    noisy = clean + noise * rng.normal(size=clean.shape)
    return [replace(case, displacement=row) for case, row in zip(cases, noisy, strict=True)]


@pytest.mark.long
def test_known_stiffnesses_are_recovered_within_their_error_bars() -> None:
    rng = np.random.default_rng(11)
    names = stiffness_names(FANUC)
    nominal = apply_values(FANUC)
    truth = apply_joint_stiffness(FANUC, nominal * np.exp(0.3 * rng.normal(size=len(names))))
    noise = 1e-6
    result = identify_joint_stiffness(FANUC, _measured(truth, _postures(30), (800.0, 600.0), noise), noise)
    true_values = apply_values(truth)
    assert result.residual == pytest.approx(1.0, abs=0.2)
    known = result.identifiable
    assert known.sum() >= 6  # at least the turning stiffness of the driven joints
    assert {n for n, k in zip(names, known, strict=True) if k} >= {f"joint {j} turning" for j in (1, 2, 4, 5, 7)}
    pull = np.log(result.values / true_values)[known] / result.relative_errors[known]
    assert np.abs(pull).max() < 4
    assert np.sqrt(np.mean(pull**2)) < 1.6
    verify = _measured(truth, _postures(20, 9), (600.0, 200.0), 0.0)
    left = predicted_deflections(apply_joint_stiffness(FANUC, result.values), verify)
    assert np.abs(left - [case.displacement for case in verify]).max() < 20 * noise


def apply_values(robot: object) -> np.ndarray:
    """Values in the order of the names."""
    places = {"radial": 0, "axial": 2, "tilting": 3, "turning": 5}
    by_frame = {joint.frame: joint.stiffness for joint in robot.joints}  # type: ignore[attr-defined]
    split = [name.split() for name in stiffness_names(robot)]  # type: ignore[arg-type]
    return np.array([by_frame[frame][places[group]] for _, frame, group in split])


def test_one_posture_leaves_combinations_unidentified() -> None:
    result = identify_joint_stiffness(FANUC, _measured(FANUC, _postures(1) * 3, (800.0, 600.0), 1e-5), 1e-5)
    assert len(result.unidentifiable) > 20
    assert not result.identifiable.all()


def test_compensated_path_meets_the_nominal_one(tmp_path: Path) -> None:
    mechanism = FANUC.mechanism
    q = close_loops(mechanism, READY)
    place = mechanism.transforms(q)[mechanism.index("E")]
    phase = np.linspace(0, 2 * np.pi, 8)
    positions = place[:3, 3] + 0.05 * np.column_stack([np.cos(phase) - 1, np.sin(phase), 0 * phase])
    from millfrf.robot_model import rotation_vector

    path = ToolPath(
        positions,
        np.tile(rotation_vector(place[:3, :3]), (8, 1)),
        np.column_stack([200 * np.cos(phase), 200 * np.sin(phase), np.full(8, 600.0), *np.zeros((3, 8))]),
    )
    result = compensate_path(FANUC, path, READY)
    assert np.linalg.norm(result.deviations[:, :3], axis=1).min() > 1e-4
    assert np.abs(result.left[:, :3]).max() < 1e-7
    write_compensated_path(tmp_path / "out.csv", result)
    assert read_tool_path(tmp_path / "out.csv").positions == pytest.approx(result.path.positions, abs=1e-8)


def test_bad_paths(tmp_path: Path) -> None:
    (tmp_path / "p.csv").write_text("x_m,y_m\n1,2\n")
    with pytest.raises(FileFormatError, match="z_m"):
        read_tool_path(tmp_path / "p.csv")
    with pytest.raises(InputError, match="must be"):
        compensate_path(FANUC, ToolPath(np.zeros((2, 3)), np.zeros((1, 3)), np.zeros((2, 6))), READY)
