"""Inverse kinematics from several starts: as near as the closed form, on rails, with offset wrists, within limits."""

from pathlib import Path

import numpy as np
import pytest

from millfrf.command_line import DONE, run
from millfrf.core import InputError
from millfrf.robot_model import SpatialCase, nearest_solution, reach, read_robot, tool_postures

ROBOTS = Path(__file__).parent / "robots"


def built(tmp_path: Path, name: str) -> SpatialCase:
    out = tmp_path / "r.toml"
    assert run(["new", "robot", str(ROBOTS / f"{name}.urdf"), "--out", str(out), "--rated-payload", "10"]) == DONE
    case = read_robot(out)
    assert isinstance(case, SpatialCase)
    return case


def test_the_search_is_as_near_as_the_closed_form() -> None:
    case = read_robot("kuka_kr90_r3100")
    assert isinstance(case, SpatialCase)
    mechanism, start = case.robot.mechanism, case.poses["ready"]
    rng = np.random.default_rng(5)
    for q in np.radians(rng.uniform([-90, -80, 10, -150, -110, -150], [90, 10, 140, 150, 110, 150], (4, 6))):
        target = mechanism.transforms(q)[-1]
        result, known = reach(mechanism, target, start), nearest_solution(mechanism, target, start)
        assert known is not None
        assert np.abs(result - start).max() == pytest.approx(np.abs(known - start).max(), abs=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("name", ["ur10e", "tx90_on_rail"])
def test_places_are_reached_within_the_limits(tmp_path: Path, name: str) -> None:
    case = built(tmp_path, name)
    mechanism, start = case.robot.mechanism, case.poses["ready"]
    frames = [mechanism.frames[index] for index in mechanism.moving]
    rng = np.random.default_rng(6)
    for _ in range(3):
        q = np.array([rng.uniform(max(frame.lower, -2.5), min(frame.upper, 2.5)) for frame in frames])
        target = mechanism.transforms(q)[-1]
        result = reach(mechanism, target, start)
        assert mechanism.transforms(result)[-1] == pytest.approx(target, abs=1e-8)
        assert all(frame.lower <= value <= frame.upper for frame, value in zip(frames, result, strict=True))
        if len(frames) == 6:
            assert np.abs(result - start).max() <= np.abs(q - start).max() + 1e-6
        for branch in tool_postures(mechanism, target, start):
            assert mechanism.transforms(branch)[-1] == pytest.approx(target, abs=1e-8)


@pytest.mark.long
def test_out_of_reach_is_said_with_what_is_left(tmp_path: Path) -> None:
    case = built(tmp_path, "tx90_on_rail")
    mechanism = case.robot.mechanism
    target = mechanism.transforms(case.poses["ready"])[-1].copy()
    target[1, 3] += 20.0
    with pytest.raises(InputError, match=r"comes within .* mm and .* joint .*rail.* at its limit"):
        reach(mechanism, target, case.poses["ready"])
