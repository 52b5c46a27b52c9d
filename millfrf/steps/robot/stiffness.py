"""Step ``robot stiffness``: compliance and deflection in a posture."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from millfrf.core import InputError, Real, writing_whole_file
from millfrf.core.provenance import origin
from millfrf.core.terminal import Table, say, show, tell
from millfrf.figures import save_figure
from millfrf.options import check_output
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

from .common import check_drawn, warn
from .pictures import compliance_figure, joint_shares, write_compliance_table
from .postures import Asked, Loads, check_positive, mechanism_of, posture_of


def carried_wrench(case: PlanarCase | SpatialCase, driven: Real, axes: Real | None, payload: Payload) -> Real:
    """Force and moment of a payload at the tool, over the degrees of freedom of its compliance, N and N m.

    Raises
    ------
    InputError
        A payload beside the tip of a planar robot.
    """
    if isinstance(case, PlanarCase):
        if any(payload.centre):
            raise InputError("a planar robot carries a payload at its tip: leave --payload-at out")
        return np.array([0.0, -payload.mass * STANDARD_GRAVITY, 0.0])
    mechanism = case.robot.mechanism
    attitude = tool_attitude(mechanism, close_loops(mechanism, driven))
    turn = np.eye(6) if axes is None else np.kron(np.eye(2), np.asarray(axes))
    return np.asarray(turn.T @ payload_wrench(case.robot, attitude, payload))


def largest_together(sag: Real, gain: Real) -> float:
    """``max |s + G u|`` over unit vectors u: the worst direction of a force of given size beside a fixed deflection.

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
            pull = gain.T @ (sag + gain @ u)
            u = pull / max(float(np.linalg.norm(pull)), 1e-300)
        best = max(best, float(np.linalg.norm(sag + gain @ u)))
    return best


def show_stiffness(
    robot: str,
    asked: Asked,
    force: float,
    loads: Loads,
    links: bool = False,
    out: Path | None = None,
    drawn: tuple[Path | None, Path | None] = (None, None),
) -> None:
    """Compliance, principal directions, deflection under the force, under weight, and both; picture and table."""
    check_drawn(drawn, out)
    check_positive("tip-force", force, "newtons", 1e6)
    if out is not None:
        check_output(out, (".json",))
    case = read_robot(robot)
    driven, axes = posture_of(case, asked)
    result = in_posture(case, driven, axes, links=links)
    names = [label.split(":")[1] for label in result.labels]
    rows = tuple((name, *(f"{v:.3e}" for v in row)) for name, row in zip(names, result.compliance, strict=True))
    posture = shown_values(mechanism_of(case), driven)
    show(Table(f"Compliance at the tool (m/N, rad/N m), posture {posture}", ("", *names), rows))
    moving = [i for i, name in enumerate(names) if "R" not in name]
    compliance = result.compliance[np.ix_(moving, moving)]
    values, directions = np.linalg.eigh(compliance)
    for value, direction in zip(values[::-1], directions.T[::-1], strict=True):
        parts = ", ".join(f"{names[i][1:]} {d:+.2f}" for i, d in zip(moving, direction, strict=True))
        say(f"{1e-6 / value:8.3f} N/um along ({parts})")
    say(f"largest deflection under {force:g} N: {1e3 * force * values[-1]:.3f} mm")
    parts_of_sag = _sags(case, driven, axes, result, loads)
    sag = _show_sags(parts_of_sag, [names[i] for i in moving], len(names))
    together = largest_together(sag[moving], force * compliance)
    if sag.any():
        say(f"largest deflection under weight and {force:g} N together: {1e3 * together:.3f} mm")
    warn(result)
    _draw(case, (driven, axes), result, force, drawn, origin("robot stiffness", [robot], {"posture": posture}))
    found = {
        "largest_deflection_m": float(force * values[-1]),
        "deflection_under_m_rad": {what: moved.tolist() for what, moved in parts_of_sag},
        "largest_deflection_together_m": float(together),
    }
    numbers = _numbers(robot, posture, result, force, found)
    tell(lambda: numbers)
    if out is not None:
        _write(out, robot, result, numbers)


def _draw(
    case: PlanarCase | SpatialCase,
    posture: tuple[Real, Real | None],
    result: PostureResult,
    force: float,
    drawn: tuple[Path | None, Path | None],
    stated: dict[str, Any],
) -> None:
    """Picture and table, where they were asked for."""
    picture, table = drawn
    if picture is not None:
        driven, axes = posture
        moving = [i for i, label in enumerate(result.labels) if "R" not in label.split(":")[1]]
        values, directions = np.linalg.eigh(result.compliance[np.ix_(moving, moving)])
        softest = directions[:, -1] if axes is None else axes @ directions[:, -1]
        shares = joint_shares(case, driven, softest)
        save_figure(compliance_figure(result, force, shares, float(values[-1])), picture)
        say(f"wrote {picture}")
    if table is not None:
        write_compliance_table(table, result, stated)
        say(f"wrote {table}")


def _sags(
    case: PlanarCase | SpatialCase, driven: Real, axes: Real | None, result: PostureResult, loads: Loads
) -> list[tuple[str, Real]]:
    """Deflections under own weight and payload over the tool's degrees of freedom, with their names."""
    parts = []
    if result.own_weight is not None:
        parts.append(("the robot's own weight (links and bodies of its file)", result.own_weight))
    if loads.payload.mass:
        carried = result.compliance @ carried_wrench(case, driven, axes, loads.payload)
        parts.append((f"a payload of {loads.payload.mass:g} kg", carried))
    return parts


def _show_sags(parts: list[tuple[str, Real]], names: list[str], size: int) -> Real:
    """Print them; return their sum."""
    for what, moved in parts:
        cells = ", ".join(f"{name[1:]} {1e3 * value:+.3f}" for name, value in zip(names, moved, strict=False))
        say(f"deflection under {what}: {1e3 * np.linalg.norm(moved[: len(names)]):.3f} mm ({cells})")
    return np.sum([moved for _, moved in parts], axis=0) if parts else np.zeros(size)


def _numbers(robot: str, posture: str, result: PostureResult, force: float, found: dict[str, object]) -> dict[str, Any]:
    return {
        "robot": robot,
        "posture": posture,
        "degrees_of_freedom": list(result.labels),
        "compliance": result.compliance.tolist(),
        "force_n": force,
        **found,
    }


def _write(out: Path, robot: str, result: PostureResult, numbers: dict[str, Any]) -> None:
    content = {
        "format": "millfrf.robot_stiffness",
        "format_version": 1,
        **numbers,
        "warnings": list(result.warnings),
        "provenance": origin("robot stiffness", [robot]),
    }
    with writing_whole_file(out) as temporary:
        temporary.write_text(json.dumps(content, indent=1), encoding="utf-8")
    say(f"wrote {out}")
