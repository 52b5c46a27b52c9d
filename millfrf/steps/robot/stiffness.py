"""Step ``robot stiffness``: compliance and deflection in a posture."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Gt, Le

from millfrf.core import InputError, Real, writing_whole_file
from millfrf.core.provenance import origin
from millfrf.core.steps import File, Typed, Writes, step
from millfrf.core.terminal import Table, say, say_written, show, tell, warn
from millfrf.figures import save_figure
from millfrf.robot_model import (
    STANDARD_GRAVITY,
    Payload,
    PlanarCase,
    PostureResult,
    SpatialCase,
    close_loops,
    in_posture,
    payload_wrench,
    read_robot,
    shown_values,
    tool_attitude,
)

from ..given import At, Degrees, Joints, Kilograms, NearTip, Picture, Pose, Robot, TableFile, Turning
from .pictures import compliance_figure, joint_shares, write_compliance_table
from .postures import cut_place, loads_of, mechanism_of, posture_of


@dataclass(frozen=True, eq=False)
class Stiffness:
    """Compliance at the tool tip in a posture, and deflections."""

    result: PostureResult
    posture: str  # joint values as text
    force: float  # at the tip, N
    largest_deflection: float  # m; largest deflection of the tip under the force, over its directions
    # m and rad; deflection over ``result.labels`` by its cause: own weight, and payload
    deflections: Mapping[str, Real]
    largest_together: float  # m; largest deflection of the tip under the force, own weight and payload together


@step
def robot_stiffness(
    robot: Robot,
    /,
    *,
    pose: Pose = None,
    joints: Joints = None,
    at: At = None,
    feed: Degrees = 0.0,
    turn: Degrees = 0.0,
    redundancy: Turning = "tool",
    links: bool = False,
    tip_force: Annotated[float, Typed("N"), Gt(0), Le(1_000_000)] = 650.0,
    payload: Kilograms = 0.0,
    payload_at: NearTip = None,
    out: Annotated[File | None, Writes(suffixes=(".json",))] = None,
    picture: Picture = None,
    table: TableFile = None,
) -> Stiffness:
    """Compliance at the tool tip, softest and stiffest directions, deflection under a force, weight and payload.

    Parameters
    ----------
    robot
        Robot file (.toml), or a name that `robot list` shows.
    pose
        Posture named in the robot's file; without it the first one.
    joints : deg
        Values of the driven joints; of prismatic joints in metres.
    at : m
        Place of the tip of a vertical tool, instead of a posture.
    feed : deg
        Direction of the feed from the base's x, with --at.
    turn : deg
        Turn of the redundancy, with --at.
    redundancy
        What turns, with --at: the robot about the tool's axis (tool), or tool and workpiece about the feed (table).
    links
        Include the flexible link sections of a planar robot's file; a robot in space always includes its links.
    tip_force : N
        Force at the tip.
    payload : kg
        Mass that the robot carries besides the bodies of its file.
    payload_at : m
        Centre of mass of the payload from the tip, in the tool frame; without it the tip.
    out
        File of all numbers and warnings to write.
    picture
        Picture of the deflection in every direction, and of the share of each joint, to write.
    table
        Table of the compliance to write.

    Returns
    -------
    Stiffness
        Compliance and deflections.

    Raises
    ------
    InputError
        A posture that the robot does not reach, or a payload without mass.

    Examples
    --------
    ::

        $ millfrf robot stiffness kuka_kr90_r3100 --at 2.0 0 0.8 --table stiffness.csv
    """
    carried = loads_of(payload, payload_at).payload
    case = read_robot(robot)
    driven, axes = posture_of(case, pose, joints, cut_place(at, feed, turn, redundancy))
    result = in_posture(case, driven, axes, links=links)
    posture = shown_values(mechanism_of(case), driven)
    moving = [i for i, label in enumerate(result.labels) if "R" not in _direction(label)]
    compliance = result.compliance[np.ix_(moving, moving)]
    values, directions = np.linalg.eigh(compliance)
    deflections = _deflections(case, driven, axes, result, carried)
    sag = np.sum(list(deflections.values()), axis=0) if deflections else np.zeros(len(result.labels))
    stiffness = Stiffness(
        result,
        posture,
        tip_force,
        float(tip_force * values[-1]),
        deflections,
        largest_together(sag[moving], tip_force * compliance),
    )
    _show_compliance(stiffness)
    _say_deflections(stiffness, moving, values, directions)
    warn(result.warnings)
    if picture is not None:
        softest = directions[:, -1] if axes is None else axes @ directions[:, -1]
        shares = joint_shares(case, driven, softest)
        save_figure(compliance_figure(result, tip_force, shares, float(values[-1])), picture)
        say_written([picture])
    if table is not None:
        write_compliance_table(Path(table), result, origin("robot stiffness", [robot], {"posture": posture}))
        say_written([table])
    tell(lambda: _numbers(robot, stiffness))
    if out is not None:
        _write(Path(out), robot, stiffness)
        say_written([out])
    return stiffness


def _direction(label: str) -> str:
    return label.split(":")[1]


def _deflections(
    case: PlanarCase | SpatialCase, driven: Real, axes: Real | None, result: PostureResult, payload: Payload
) -> dict[str, Real]:
    """Return the deflection of the tool under own weight and under the payload, by cause."""
    parts = {}
    if result.own_weight is not None:
        parts["the robot's own weight (links and bodies of its file)"] = result.own_weight
    if payload.mass:
        parts[f"a payload of {payload.mass:g} kg"] = result.compliance @ carried_wrench(case, driven, axes, payload)
    return parts


def carried_wrench(case: PlanarCase | SpatialCase, driven: Real, axes: Real | None, payload: Payload) -> Real:
    """Force and moment of a payload at the tool, over the degrees of freedom of its compliance, N and N m."""
    if isinstance(case, PlanarCase):
        if any(payload.centre):
            raise InputError("a planar robot carries a payload at its tip: leave --payload-at out")
        return np.array([0.0, -payload.mass * STANDARD_GRAVITY, 0.0])
    mechanism = case.robot.mechanism
    attitude = tool_attitude(mechanism, close_loops(mechanism, driven))
    turn = np.eye(6) if axes is None else np.kron(np.eye(2), np.asarray(axes))
    return np.asarray(turn.T @ payload_wrench(case.robot, attitude, payload))


def largest_together(resting: Real, gain: Real) -> float:
    """``max |s + G u|`` over unit vectors u: the worst direction of a force of given size with a fixed deflection.

    By repetition of ``u = G^T (s + G u) / |...|``, which never falls, from both ends of every principal direction.

    Examples
    --------
    >>> largest_together(np.array([0.0, 1.0]), np.diag([1.0, 2.0]))
    3.0
    """
    starts = np.linalg.svd(gain)[2]
    best = 0.0
    for u in (*starts, *(-starts)):
        for _ in range(200):
            pull = gain.T @ (resting + gain @ u)
            u = pull / max(float(np.linalg.norm(pull)), 1e-300)
        best = max(best, float(np.linalg.norm(resting + gain @ u)))
    return best


def _show_compliance(stiffness: Stiffness) -> None:
    names = [_direction(label) for label in stiffness.result.labels]
    rows = tuple(
        (name, *(f"{v:.3e}" for v in row)) for name, row in zip(names, stiffness.result.compliance, strict=True)
    )
    show(Table(f"Compliance at the tool (m/N, rad/N m), posture {stiffness.posture}", ("", *names), rows))


def _say_deflections(stiffness: Stiffness, moving: list[int], values: Real, directions: Real) -> None:
    """Print principal stiffnesses, and deflections under the force, under weight, and under both."""
    names = [_direction(stiffness.result.labels[i])[1:] for i in moving]
    for value, direction in zip(values[::-1], directions.T[::-1], strict=True):
        parts = ", ".join(f"{name} {part:+.2f}" for name, part in zip(names, direction, strict=True))
        say(f"{1e-6 / value:8.3f} N/um along ({parts})")
    say(f"largest deflection under {stiffness.force:g} N: {1e3 * stiffness.largest_deflection:.3f} mm")
    for cause, moved in stiffness.deflections.items():
        cells = ", ".join(f"{name} {1e3 * value:+.3f}" for name, value in zip(names, moved, strict=False))
        say(f"deflection under {cause}: {1e3 * np.linalg.norm(moved[: len(names)]):.3f} mm ({cells})")
    if any(moved.any() for moved in stiffness.deflections.values()):
        size = 1e3 * stiffness.largest_together
        say(f"largest deflection under weight and {stiffness.force:g} N together: {size:.3f} mm")


def _numbers(robot: File, stiffness: Stiffness) -> dict[str, Any]:
    return {
        "robot": str(robot),
        "posture": stiffness.posture,
        "degrees_of_freedom": list(stiffness.result.labels),
        "compliance": stiffness.result.compliance.tolist(),
        "force_n": stiffness.force,
        "largest_deflection_m": stiffness.largest_deflection,
        "deflection_under_m_rad": {cause: moved.tolist() for cause, moved in stiffness.deflections.items()},
        "largest_deflection_together_m": stiffness.largest_together,
    }


def _write(path: Path, robot: File, stiffness: Stiffness) -> None:
    content = {
        "format": "millfrf.robot_stiffness",
        "format_version": 1,
        **_numbers(robot, stiffness),
        "warnings": list(stiffness.result.warnings),
        "provenance": origin("robot stiffness", [robot]),
    }
    with writing_whole_file(path) as unfinished:
        unfinished.write_text(json.dumps(content, indent=1), encoding="utf-8")
