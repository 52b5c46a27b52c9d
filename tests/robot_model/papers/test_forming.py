"""Belchior et al. 2013, section 5.1: where the frustum ends up, and which torques add up."""

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from millfrf.robot_model import inverse_kinematics, named_posture, rotation_vector, tool_jacobian

EXAMPLE = Path(__file__).resolve().parents[3] / "examples" / "robot_path_compensation.py"


@pytest.fixture(scope="module")
def forming() -> ModuleType:
    specification = importlib.util.spec_from_file_location("robot_path_compensation", EXAMPLE)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def centre(places: np.ndarray) -> np.ndarray:
    """Centre of the least-squares circle through places, (2,): ``x^2 + y^2 = 2 a x + 2 b y + c`` (Kasa 1976)."""
    columns = np.column_stack([2 * places[:, :2], np.ones(len(places))])
    return np.asarray(np.linalg.lstsq(columns, np.sum(places[:, :2] ** 2, axis=1))[0][:2])


@pytest.mark.long
def test_concentricity_of_the_last_loop(forming: ModuleType) -> None:
    """3.2 mm without and 0.6 mm with correction on the real robot: here as a trend, with assumed forces."""
    outcome = forming.run(points=96)
    last = slice(84, 96)  # the eighth of eight loops
    nominal = centre(outcome.nominal.positions[last])
    result = [1e3 * np.linalg.norm(centre(each[last]) - nominal) for each in (outcome.places, outcome.corrected_places)]
    assert result == pytest.approx([1.06, 0.15], abs=0.02)


def test_torques_add_up_on_one_side_of_the_frustum(forming: ModuleType) -> None:
    """Fig. 13: about joints 3 and 5 F_z always turns one way, F_xy with it at one end of the loop and against it there.

    The moment about a joint's axis is taken here from the geometry, ``z . ((p - o) x F)``; Eq. 28 gives the same.
    """
    path = forming.frustum(97)
    mechanism, start = forming.CASE.robot.mechanism, named_posture(forming.CASE, None)
    loop = slice(84, 97)
    ends = [84 + int(pick(path.positions[loop, 0])) for pick in (np.argmin, np.argmax)]
    signs = {}
    for end in ends:
        target = np.eye(4)
        target[:3, 3] = path.positions[end]
        target[:3, :3] = _matrix(path.attitudes[end])
        q = inverse_kinematics(mechanism, target, start)
        placed = mechanism.transforms(q)
        down = np.array([0, 0, path.wrenches[end, 2]])
        across = path.wrenches[end, :3] - down
        for joint in ("7", "5"):
            frame = placed[mechanism.index(joint)]
            arm = path.positions[end] - frame[:3, 3]
            signs[end, joint] = [float(frame[:3, 2] @ np.cross(arm, force)) for force in (down, across)]
        jacobian = tool_jacobian(mechanism, q)
        column = next(i for i, frame in enumerate(f for f in mechanism.frames if f.active) if frame.name == "5")
        assert jacobian[:3, column] @ across == pytest.approx(signs[end, "5"][1], abs=1e-6)
    for joint in ("7", "5"):
        (low_z, low_xy), (high_z, high_xy) = signs[ends[0], joint], signs[ends[1], joint]
        assert low_z * high_z > 0
        assert low_xy * high_xy < 0


def _matrix(vector: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    matrix = Rotation.from_rotvec(vector).as_matrix()
    assert rotation_vector(matrix) == pytest.approx(vector)
    return np.asarray(matrix)
