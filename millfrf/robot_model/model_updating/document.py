"""A robot's file with updated numbers: the user's own document, its comments and order kept."""

from typing import Any

import numpy as np
import tomlkit
from tomlkit.items import AoT, Table

from millfrf.core import InputError, Real

from ..settings import UPDATE
from ..spatial.spatial_modes import tool_spring
from ..spatial.spatial_robot import SpatialRobot
from .changed_structure import (
    FOUNDATION,
    UpdateParameter,
    carrier_node,
    changed_by,
    damping_unit,
    of_kind,
    payload_place,
    place_of_node,
    tool_node,
    value_of,
)
from .update import RobotUpdate

KEYS = {
    "radial": "radial_n_per_m",
    "axial": "axial_n_per_m",
    "tilting": "tilting_nm_per_rad",
    "turning": "turning_nm_per_rad",
}
SOURCE = "robot update"


def updated_document(text: str, robot: SpatialRobot, update: RobotUpdate) -> str:
    """Write the numbers of an update into the text of a robot's file, and its covariance into ``[update]``.

    Stiffnesses, damping and moduli are replaced. A payload becomes an additional body, with negative mass if the file's
    spindle is too heavy. A compliant tool becomes a spring that carries a small part of the spindle's mass. A compliant
    base becomes a fixed frame ``foundation`` with a spring between node 0 and the robot.

    Parameters
    ----------
    text
        Content of the file, of kind ``spatial`` or ``serial``. A serial one has no keys for payload, tool and base:
        these are in ``[update]`` alone and are applied on reading.
    robot
        The robot that it describes.
    update
        Update whose numbers are written.

    Raises
    ------
    InputError
        A file that was updated already, or whose tables are written in one line.
    """
    document = tomlkit.parse(text)
    if "update" in document:
        raise InputError(
            "this file was updated already; update the file before it, with all measurements together: "
            "the prior of an update is that of a file that was never updated"
        )
    serial = document["robot"]["kind"] == "serial"
    for parameter, value in zip(update.parameters, update.x, strict=True):
        _write_in_place(document, robot, parameter, float(value), serial)
    if not serial:
        _add_masses(document, robot, update)
        _add_tool(document, robot, update)
        _add_base(document, of_kind(update.parameters, update.x, "base"))
    document["update"] = _update_table(update, serial)
    return tomlkit.dumps(document)


def _write_in_place(document: Any, robot: SpatialRobot, parameter: UpdateParameter, value: float, serial: bool) -> None:
    """Change the number of a parameter whose number has a key in the file."""
    factor = float(np.exp(value)) if parameter.logarithmic else 1.0
    if parameter.kind == "stiffness":
        _scale_joint(document, robot, parameter, factor)
    elif parameter.kind == "joint damping" and value and not serial:
        _damp_joint(document, robot, parameter.frame, value)
    elif parameter.kind == "damping":
        table = document.get("damping", {})
        if "ratio" in table:
            table["ratio"] = _short(float(table["ratio"]) * factor)
        if "ratios" in table:
            table["ratios"] = [_short(float(ratio) * factor) for ratio in table["ratios"]]
    elif parameter.kind == "inertia" and not serial:
        row = _rows(document, "bodies")[parameter.axis]
        row["inertia_kg_m2"] = [_short(float(moment) * factor) for moment in row["inertia_kg_m2"]]
    elif parameter.kind == "links":
        for tube in (row["tube"] for row in document.get("links", []) if "tube" in row):
            for key in ("young_pa", "shear_pa"):
                tube[key] = _short(float(tube[key]) * factor)


def _damp_joint(document: Any, robot: SpatialRobot, name: str, value: float) -> None:
    joint = next(joint for joint in robot.joints if joint.frame == name)
    frame = robot.mechanism.frames[robot.mechanism.index(name)]
    key = "damping_ns_per_m" if frame.motion == "prismatic" else "damping_nms_per_rad"
    for row in _rows(document, "joints"):
        if row["frame"] == name:
            row[key] = _short(joint.damping + value * damping_unit(robot, joint))


def _update_table(update: RobotUpdate, serial: bool) -> Table:
    covariance = tomlkit.array()  # a row per line, so that a large matrix stays readable
    for row in update.covariance:
        covariance.append([_short(value) for value in row])
    numbers = tomlkit.aot()
    for p, value, error, determined in zip(update.parameters, update.x, update.errors, update.determined, strict=True):
        numbers.append(
            _table(
                {
                    "name": p.name,
                    "kind": p.kind,
                    "unit": p.unit,
                    "frame": p.frame,
                    "group": p.group,
                    "axis": p.axis,
                    "spread": p.spread,
                    "value": float(value),
                    "standard_error": float(error),
                    "told": bool(determined),
                    "source": SOURCE,
                    "in_file": not serial or p.kind in ("stiffness", "damping"),
                }
            )
        )
    return _table(
        {
            "source": f"{SOURCE}: {update.verdict}; {update.reason}",
            "verdict": update.verdict,
            "named": list(update.names),
            "covariance": covariance.multiline(True),
            "numbers": numbers,
        }
    )


def _table(entries: dict[str, Any]) -> Table:
    table = tomlkit.table()
    table.update(entries)
    return table


def _rows(document: Any, key: str) -> AoT:
    if key not in document:
        document[key] = tomlkit.aot()
    tables = document[key]
    if not isinstance(tables, AoT):
        raise InputError(f"{key} = [...] is written in one line; write it as tables [[{key}]] to have it updated")
    return tables


def _scale_joint(document: Any, robot: SpatialRobot, parameter: UpdateParameter, factor: float) -> None:
    """Multiply a joint's stiffness by ``factor``.

    A serial robot's file has a table for each joint's stiffness, with ``drive`` keys for the direction of motion.
    """
    motion = robot.mechanism.frames[robot.mechanism.index(parameter.frame)].motion
    drives = {("revolute", "turning"): "drive_nm_per_rad", ("prismatic", "axial"): "drive_n_per_m"}
    for row in _rows(document, "joints"):
        table, key = row, KEYS[parameter.group]
        if "stiffness" in row:
            table, key = row["stiffness"], drives.get((motion, parameter.group), key)
        if row.get("frame", row.get("name")) == parameter.frame and key in table:
            table[key] = _short(float(table[key]) * factor)


def _add_masses(document: Any, robot: SpatialRobot, update: RobotUpdate) -> None:
    payload = of_kind(update.parameters, update.x, "payload")
    if payload.get(3):
        node = carrier_node(robot)
        lighter = " (negative: the spindle is lighter than the file said)" if payload[3] < 0 else ""
        centre = payload_place(payload) - place_of_node(robot, node)
        _add_body(document, node, robot.mechanism.tool, payload[3], _shortened(centre), f"payload{lighter}")
    mass = value_of(update.parameters, update.x, "tool mass")
    if mass:
        node = tool_node(robot)
        centre = np.zeros(3) - place_of_node(robot, node)
        _add_body(document, node, robot.mechanism.tool, mass, _shortened(centre), "mass at the tool tip")


def _add_body(document: Any, node: int, frame: str, mass: float, centre: list[float], what: str) -> None:
    row = {"node": node, "frame": frame, "mass_kg": _short(mass), "centre_m": centre, "source": f"{SOURCE}: {what}"}
    _rows(document, "bodies").append(_table(row))


def _add_tool(document: Any, robot: SpatialRobot, update: RobotUpdate) -> None:
    own = [(p, x) for p, x in zip(update.parameters, update.x, strict=True) if p.kind in ("tool", "sprung mass")]
    changed = changed_by(robot, [p for p, _ in own], np.array([x for _, x in own]))
    spring, before = tool_spring(changed), tool_spring(robot)
    if spring is None:
        return
    numbers = {KEYS["radial"]: spring.stiffness[0], KEYS["axial"]: spring.stiffness[2]}
    finite = {key: _short(value) for key, value in numbers.items() if np.isfinite(value)}
    if before is not None:  # the file's own spring is changed in place
        for row in _rows(document, "joints"):
            if row["frame"] == before.frame and tuple(row["nodes"]) == before.nodes:
                row.update(finite)
        return
    # the mass on the spring is taken off the spindle, so that the robot's total mass stays
    for body in changed.bodies[len(robot.bodies) :]:
        centre = place_of_node(robot, robot.tip) if body.node == robot.tip else np.zeros(3)
        what = "its mass, taken from the spindle" if body.mass < 0 else "the tool on its spring"
        _add_body(document, body.node, body.frame, body.mass, centre.tolist(), what)
    joint = {"frame": spring.frame, "nodes": list(spring.nodes), **finite, "source": f"{SOURCE}: a tool that gives way"}
    _rows(document, "joints").append(_table(joint))
    document["robot"]["tip_node"] = changed.tip


def _add_base(document: Any, compliance: dict[int, float]) -> None:
    """Put a foundation's frame and spring between node 0 and the robot."""
    if max(compliance.values(), default=0.0) <= UPDATE.least_compliance:
        return
    # a spring needs two nodes: node 0 becomes the floor, and a new node takes its place in the robot
    new, source = _move_to_foundation(document), f"{SOURCE}: the base gives way"
    frame = {"name": FOUNDATION, "antecedent": "0", "motion": "fixed", "source": source}
    _rows(document, "frames").insert(0, _table(frame))
    springs = {
        KEYS[group]: _short(1 / compliance[axis])
        for axis, group in ((0, "tilting"), (1, "radial"))
        if compliance.get(axis, 0.0) > UPDATE.least_compliance
    }
    _rows(document, "joints").append(_table({"frame": FOUNDATION, "nodes": [0, new], **springs, "source": source}))
    floor = {"node": 0, "frame": "0", "at_m": [0.0, 0.0, 0.0], "source": "the floor"}
    _rows(document, "points").append(_table(floor))


def _move_to_foundation(document: Any) -> int:
    """Move everything on frame 0 and node 0 to the foundation and to a new node; return the number of the new node."""
    new = 1 + max(int(node) for row in document["joints"] for node in row["nodes"])
    # points may name nodes that no joint uses
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
    """Round a number to ten digits for the file."""
    return float(f"{float(value):.10g}")


def _shortened(values: Real) -> list[float]:
    return [_short(value) for value in values]
