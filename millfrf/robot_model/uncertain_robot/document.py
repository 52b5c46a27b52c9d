"""A robot's file with updated numbers: the user's own document, its comments and order kept."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import tomlkit
from tomlkit.items import AoT, Table

from millfrf.core import InputError, Real

from ..full_update.changed_structure import (
    FOUNDATION,
    LEAST_COMPLIANCE,
    UpdateParameter,
    carrier_node,
    changed_by,
    damping_unit,
    payload_centre,
    place_of_node,
    tool_node,
)
from ..full_update.update import RobotUpdate
from ..spatial.spatial_modes import tool_spring
from ..spatial.spatial_robot import SpatialRobot

KEYS = {
    "radial": "radial_n_per_m",
    "axial": "axial_n_per_m",
    "tilting": "tilting_nm_per_rad",
    "turning": "turning_nm_per_rad",
}
SOURCE = "robot update"


def updated_document(text: str, robot: SpatialRobot, update: RobotUpdate) -> str:
    """The text of a robot's file with the numbers of an update, and its covariance in ``[update]``.

    Stiffnesses, damping and moduli change in place. A payload is a further body, of negative mass where the file's
    spindle is too heavy. A tool that gives way is a spring with a small part of the spindle's mass. A base that gives
    way is a fixed frame ``foundation`` with a spring, between node 0 and what was bolted to it.

    Parameters
    ----------
    text
        Content of the file, of kind ``spatial`` or ``serial``. A serial one has no keys for payload, tool and base:
        they stand in ``[update]`` alone and are applied on reading.
    robot
        The robot that it describes.
    update
        What was found.

    Raises
    ------
    InputError
        A file that was updated already, or whose tables are written in one line.
    """
    document = tomlkit.parse(text)
    if "update" in document:
        raise InputError(
            "this file was updated already; update the file before it, with all measurements together: "
            "what an update leaves open is not the belief that the next one begins with"
        )
    parameters, x = update.parameters, update.x
    serial = document["robot"]["kind"] == "serial"
    for one, value in zip(parameters, x, strict=True):
        if one.kind == "stiffness":
            _scale_joint(document, robot, one, float(np.exp(value)))
        elif one.kind == "joint damping" and value and not serial:
            _damp_joint(document, robot, one, float(value))
        elif one.kind == "damping":
            _scale_damping(document, float(np.exp(value)))
        elif one.kind == "inertia" and not serial:
            row = _rows(document, "bodies")[one.axis]
            row["inertia_kg_m2"] = [_short(float(moment) * float(np.exp(value))) for moment in row["inertia_kg_m2"]]
        elif one.kind == "links":
            _scale_links(document, float(np.exp(value)))
    if not serial:
        _add_masses(document, robot, parameters, x)
        _add_tool(document, robot, parameters, x)
        _add_base(document, parameters, x)
    document["update"] = _table_of(update, serial)
    return tomlkit.dumps(document)


def _table_of(update: RobotUpdate, serial: bool) -> Table:
    table = tomlkit.table()
    table["source"] = f"{SOURCE}: {update.verdict}; {update.reason}"
    table["verdict"] = update.verdict
    table["named"] = list(update.names)
    covariance = tomlkit.array()
    for row in update.covariance:
        covariance.append([float(f"{value:.10g}") for value in row])
    table["covariance"] = covariance.multiline(True)
    numbers = tomlkit.aot()
    for one, value, error, told in zip(update.parameters, update.x, update.errors, update.told, strict=True):
        entry = tomlkit.table()
        entry.update({"name": one.name, "kind": one.kind, "unit": one.unit, "frame": one.frame, "group": one.group})
        entry.update({"axis": one.axis, "spread": one.spread, "value": float(value)})
        entry.update({"standard_error": float(error), "told": bool(told), "source": SOURCE})
        entry["in_file"] = not serial or one.kind in ("stiffness", "damping")
        numbers.append(entry)
    table["numbers"] = numbers
    return table


def _rows(document: Any, key: str) -> AoT:
    if key not in document:
        document[key] = tomlkit.aot()
    found = document[key]
    if not isinstance(found, AoT):
        raise InputError(f"{key} = [...] is written in one line; write it as tables [[{key}]] to have it updated")
    return found


def _scale_joint(document: Any, robot: SpatialRobot, one: UpdateParameter, factor: float) -> None:
    """Scale a joint's stiffness; in a serial robot's file it stands in its own table, ``drive`` along the motion."""
    motion = robot.mechanism.frames[robot.mechanism.index(one.frame)].motion
    own = {("revolute", "turning"): "drive_nm_per_rad", ("prismatic", "axial"): "drive_n_per_m"}
    for row in _rows(document, "joints"):
        table, key = row, KEYS[one.group]
        if "stiffness" in row:
            table, key = row["stiffness"], own.get((motion, one.group), key)
        if row.get("frame", row.get("name")) == one.frame and key in table:
            table[key] = _short(float(table[key]) * factor)


def _damp_joint(document: Any, robot: SpatialRobot, one: UpdateParameter, value: float) -> None:
    joint = next(joint for joint in robot.joints if joint.frame == one.frame)
    frame = robot.mechanism.frames[robot.mechanism.index(one.frame)]
    key = "damping_ns_per_m" if frame.motion == "prismatic" else "damping_nms_per_rad"
    for row in _rows(document, "joints"):
        if row["frame"] == one.frame:
            row[key] = _short(joint.damping + value * damping_unit(robot, joint))


def _scale_damping(document: Any, factor: float) -> None:
    table = document.get("damping")
    if table is None:
        return
    if "ratio" in table:
        table["ratio"] = _short(float(table["ratio"]) * factor)
    if "ratios" in table:
        table["ratios"] = [_short(float(ratio) * factor) for ratio in table["ratios"]]


def _scale_links(document: Any, factor: float) -> None:
    for row in document.get("links", []):
        if "tube" in row:
            for key in ("young_pa", "shear_pa"):
                row["tube"][key] = _short(float(row["tube"][key]) * factor)


def _add_masses(document: Any, robot: SpatialRobot, parameters: Sequence[UpdateParameter], x: Real) -> None:
    payload = {one.axis: float(value) for one, value in zip(parameters, x, strict=True) if one.kind == "payload"}
    if payload.get(3):
        place = payload_centre(robot) + np.array([payload.get(axis, 0.0) for axis in range(3)])
        lighter = " (negative: the spindle is lighter than the file said)" if payload[3] < 0 else ""
        _add_body(document, robot, carrier_node(robot), payload[3], place, f"{SOURCE}: payload{lighter}")
    mass = next((float(v) for one, v in zip(parameters, x, strict=True) if one.kind == "tool mass"), 0.0)
    if mass:
        _add_body(document, robot, tool_node(robot), mass, np.zeros(3), f"{SOURCE}: mass at the tool tip")


def _add_body(document: Any, robot: SpatialRobot, node: int, mass: float, place: Real, source: str) -> None:
    row = tomlkit.table()
    row.update({"node": node, "frame": robot.mechanism.tool, "mass_kg": _short(mass)})
    row["centre_m"] = [_short(value) for value in place - place_of_node(robot, node)]
    row["source"] = source
    _rows(document, "bodies").append(row)


def _add_tool(document: Any, robot: SpatialRobot, parameters: Sequence[UpdateParameter], x: Real) -> None:
    own = [(one, value) for one, value in zip(parameters, x, strict=True) if one.kind in ("tool", "sprung mass")]
    kept = tuple(one for one, _ in own)
    changed = changed_by(robot, kept, np.array([value for _, value in own]))
    spring, before = tool_spring(changed), tool_spring(robot)
    if spring is None:
        return
    numbers = {KEYS["radial"]: spring.stiffness[0], KEYS["axial"]: spring.stiffness[2]}
    finite = {key: _short(value) for key, value in numbers.items() if np.isfinite(value)}
    if before is not None:
        for row in _rows(document, "joints"):
            if row["frame"] == before.frame and tuple(row["nodes"]) == before.nodes:
                row.update(finite)
        return
    for body in changed.bodies[len(robot.bodies) :]:
        place = place_of_node(robot, robot.tip) if body.node == robot.tip else np.zeros(3)
        what = "its mass, taken from the spindle" if body.mass < 0 else "the tool on its spring"
        row = tomlkit.table()
        row.update({"node": body.node, "frame": body.frame, "mass_kg": _short(body.mass)})
        row["centre_m"] = [float(value) for value in place]
        row["source"] = f"{SOURCE}: {what}"
        _rows(document, "bodies").append(row)
    joint = tomlkit.table()
    joint.update({"frame": spring.frame, "nodes": list(spring.nodes), **finite})
    joint["source"] = f"{SOURCE}: a tool that gives way"
    _rows(document, "joints").append(joint)
    document["robot"]["tip_node"] = changed.tip


def _add_base(document: Any, parameters: Sequence[UpdateParameter], x: Real) -> None:
    """Put a foundation's frame and spring between node 0 and the robot."""
    found = {one.axis: float(value) for one, value in zip(parameters, x, strict=True) if one.kind == "base"}
    if max(found.values(), default=0.0) <= LEAST_COMPLIANCE:
        return
    new = _lift_from_floor(document)
    frame, joint, held = tomlkit.table(), tomlkit.table(), tomlkit.table()
    frame.update({"name": FOUNDATION, "antecedent": "0", "motion": "fixed", "source": f"{SOURCE}: the base gives way"})
    _rows(document, "frames").insert(0, frame)
    joint.update({"frame": FOUNDATION, "nodes": [0, new]})
    for axis, group in ((0, "tilting"), (1, "radial")):
        if found.get(axis, 0.0) > LEAST_COMPLIANCE:
            joint[KEYS[group]] = _short(1 / found[axis])
    joint["source"] = f"{SOURCE}: the base gives way"
    _rows(document, "joints").append(joint)
    held.update({"node": 0, "frame": "0", "at_m": [0.0, 0.0, 0.0], "source": "the floor"})
    _rows(document, "points").append(held)


def _lift_from_floor(document: Any) -> int:
    """Move what stands on frame 0 and node 0 to the foundation and to a new node; its number."""
    new = 1 + max(int(node) for row in document["joints"] for node in row["nodes"])
    new = max([new, *(1 + int(row["node"]) for row in document.get("points", []))])
    for key, field in (("frames", "antecedent"), ("points", "frame"), ("bodies", "frame"), ("links", "frame")):
        for row in document.get(key, []):
            if row.get(field) == "0":
                row[field] = FOUNDATION
    for key in ("joints", "links"):
        for row in document.get(key, []):
            row["nodes"] = [int(node) or new for node in row["nodes"]]
    for key in ("points", "bodies"):
        for row in document.get(key, []):
            row["node"] = int(row["node"]) or new
    return new


def _short(value: float) -> float:
    """A number with ten digits, as a file shows it."""
    return float(f"{float(value):.10g}")
