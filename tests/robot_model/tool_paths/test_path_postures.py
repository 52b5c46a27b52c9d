"""Every posture of a path holds the tool, within its margins, with whole turns of joints."""

from dataclasses import replace

import numpy as np
import pytest

from millfrf.robot_model import (
    CutPath,
    Payload,
    Redundancy,
    attitudes_along,
    cut_path,
    in_posture,
    named_posture,
    path_postures,
    read_robot,
    target_of,
    tool_deflection,
)

CASE = read_robot("kuka_kr90_angled")
ROBOT = CASE.robot  # type: ignore[union-attr]
START = named_posture(CASE, None)


def line(n: int = 4) -> CutPath:
    points = np.column_stack([np.linspace(1.5, 1.9, n), np.full(n, 0.1), np.full(n, 0.7)])
    return cut_path(points, attitudes_along(np.tile([0.0, 0, -1], (n, 1))))


def test_all_postures_hold_the_tool_and_their_margins() -> None:
    free = Redundancy(np.radians(np.arange(-180.0, 180, 30)), np.zeros(1), limit_margin=np.radians(8))
    path = line()
    result = path_postures(ROBOT, path, free, START)
    mechanism = ROBOT.mechanism
    lower, upper = (
        np.array([getattr(mechanism.frames[i], end) for i in mechanism.moving]) for end in ("lower", "upper")
    )
    for place, postures in zip(path.places, result, strict=True):
        assert len(postures) > 20
        for q, tool, table in zip(postures.q, postures.tool, postures.table, strict=True):
            target = target_of(free.place(place, tool, table))
            assert mechanism.transforms(q)[mechanism.index("tool")] == pytest.approx(target, abs=1e-9)
        margin = np.minimum(postures.q - lower, upper - postures.q).min(axis=1)
        assert postures.margin == pytest.approx(margin)
        assert margin.min() >= np.radians(8)
        assert len(np.unique(postures.same)) < len(postures)  # whole turns of joints 4 and 6


def test_a_robot_without_a_closed_form_finds_postures_from_its_neighbours() -> None:
    """Joint 5 moved off the axis of joint 4: no spherical wrist."""
    frames = tuple(replace(f, d=0.05) if f.name == "5" else f for f in ROBOT.mechanism.frames)
    offset = replace(ROBOT, mechanism=replace(ROBOT.mechanism, frames=frames))
    free = Redundancy(np.radians([-120.0, -90.0, -60.0]), np.zeros(1))
    path = line()
    result = path_postures(offset, path, free, START)
    mechanism = offset.mechanism
    for place, postures in zip(path.places, result, strict=True):
        assert set(np.round(np.degrees(postures.tool))) == {-120.0, -90.0, -60.0}
        for q, tool in zip(postures.q, postures.tool, strict=True):
            placed = mechanism.transforms(q)[mechanism.index("tool")]
            assert placed == pytest.approx(target_of(free.place(place, tool, 0.0)), abs=1e-8)


def test_deflection_is_that_of_the_compliance_and_the_weight() -> None:
    wrench, payload = np.array([50.0, -20, 80, 1, 2, 3]), Payload(30.0, (0.0, 0.05, -0.2))
    moved, sag = tool_deflection(ROBOT, START, wrench, payload)
    whole = in_posture(CASE, START)
    assert moved == pytest.approx(whole.compliance @ wrench)
    force = np.array([0, 0, -30 * 9.80665])
    arm = ROBOT.mechanism.transforms(START)[-1, :3, :3] @ np.array(payload.centre)
    carried = whole.compliance @ np.concatenate([force, np.cross(arm, force)])
    assert whole.own_weight is not None
    assert sag == pytest.approx(whole.own_weight + carried)
