"""Changed numbers in a robot's file; comments, order and spelling are kept."""

import json
import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import tomlkit
from tomlkit.exceptions import NonExistentKey

from millfrf.core import InputError

from ..kinematics.mechanism import Frame
from ..spatial.spatial_robot import ElasticJoint, SpatialRobot
from .robot_files import read_table, robot_text
from .serial_file import read_serial_robot

_GROUPS = ((0, "radial_n_per_m"), (2, "axial_n_per_m"), (3, "tilting_nm_per_rad"), (5, "turning_nm_per_rad"))


def numbered_robot_text(robot: str | os.PathLike[str]) -> str:
    """Text of a robot's file; a serial robot is written out with its frames and nodes, as kind ``spatial``.

    An update adds springs, bodies and frames, for which the short form has no place. The long form is the same robot.

    Parameters
    ----------
    robot
        Path of a file, or name of a robot that comes along.

    Raises
    ------
    InputError
        No such robot, or one whose parts do not fit together.
    FileFormatError
        Not a robot file.

    Examples
    --------
    >>> 'kind = "spatial"' in numbered_robot_text("staubli_rx160")
    True
    """
    content = read_table(robot)
    if content.get("robot", {}).get("kind") != "serial":
        return robot_text(robot)
    built = read_serial_robot(robot).robot
    head = content["robot"]
    lines = ["# Written out from a file of kind serial: the same robot with frames and numbered nodes.", "", "[robot]"]
    lines += [f"{key} = {_value(value)}" for key, value in head.items() if key not in ("kind", "source")]
    lines += ['kind = "spatial"', f"tip_node = {built.tip}", f"tool_frame = {_value(built.mechanism.tool)}"]
    lines.append(f"source = {_value(head['source'])}")
    blocks = ["\n".join(lines), *(_frame(frame) for frame in built.mechanism.frames), *_nodes(built)]
    sources = [row["stiffness"]["source"] for row in content["joints"]]
    blocks += [_joint(joint, source) for joint, source in zip(built.joints, sources, strict=True)]
    blocks += [_block("links", [("nodes", list(link.nodes)), ("source", "rigid")]) for link in built.links]
    blocks += _bodies(built, content)
    if "damping" in content:
        blocks.append(_block("damping", list(content["damping"].items()), many=False))
    blocks += [_block("poses", list(pose.items())) for pose in content.get("poses", [])]
    return "\n\n".join(blocks) + "\n"


def _frame(frame: Frame) -> str:
    rows: list[tuple[str, Any]] = [("name", frame.name), ("antecedent", frame.antecedent), ("motion", frame.motion)]
    rows += [(f"{key}_deg", float(np.degrees(getattr(frame, key)))) for key in ("gamma", "alpha", "theta")]
    rows += [(f"{key}_m", float(getattr(frame, key))) for key in ("b", "d", "r")]
    limits = np.array([frame.lower, frame.upper])
    if frame.motion != "fixed" and np.isfinite(limits).all():
        sliding = frame.motion == "prismatic"
        rows.append(("limits_m" if sliding else "limits_deg", (limits if sliding else np.degrees(limits)).tolist()))
    return _block("frames", [*rows, ("source", "from the joints' places and axes")])


def _nodes(robot: SpatialRobot) -> list[str]:
    return [
        _block("points", [("node", node), ("frame", name), ("at_m", place.tolist()), ("source", "joint or tip")])
        for node, (name, place) in robot.points.items()
    ]


def _joint(joint: ElasticJoint, source: str) -> str:
    rows: list[tuple[str, Any]] = [("frame", joint.frame), ("nodes", list(joint.nodes))]
    rows += [(key, float(joint.stiffness[at])) for at, key in _GROUPS if np.isfinite(joint.stiffness[at])]
    return _block("joints", [*rows, ("source", source)])


def _bodies(robot: SpatialRobot, content: dict[str, Any]) -> list[str]:
    sources = [row["source"] for row in content.get("bodies", []) if row["joint"] != "base"]
    sources += [content["spindle"]["source"]] if "spindle" in content else []
    blocks = []
    for body, source in zip(robot.bodies, sources, strict=True):
        inertia = [float(body.inertia[at]) for at in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        rows = [("node", body.node), ("frame", body.frame), ("mass_kg", body.mass), ("centre_m", body.centre.tolist())]
        blocks.append(_block("bodies", [*rows, ("inertia_kg_m2", inertia), ("source", source)]))
    return blocks


def _block(table: str, rows: Sequence[tuple[str, Any]], many: bool = True) -> str:
    head = f"[[{table}]]" if many else f"[{table}]"
    return "\n".join([head, *(f"{key} = {_value(value)}" for key, value in rows)])


def _value(value: Any) -> str:
    """A number, a list or a text as TOML writes it: JSON's form serves all three."""
    return json.dumps(value, ensure_ascii=False)


Place = tuple[str | int, ...]
"""Where a value stands: ``("joints", 2, "turning_nm_per_rad")``, tables counted from 0."""


def changed_robot_text(robot: str | os.PathLike[str], changes: Mapping[Place, Any]) -> str:
    """Text of a robot's file with other values at some places; a key that is not there is added to its table.

    Parameters
    ----------
    robot
        Path of a file, or name of a robot that comes along.
    changes
        New values by place: numbers (written with nine digits), text, lists or tables.

    Raises
    ------
    InputError
        No such robot, or a place whose table the file does not have.
    FileFormatError
        Not TOML.

    Examples
    --------
    >>> text = changed_robot_text("chen_2026", {("links", 0, "mass_kg"): 43.0})
    >>> text.splitlines()[0].startswith("#"), "mass_kg = 43.0" in text
    (True, True)
    """
    if not changes:
        return robot_text(robot)
    document = tomlkit.parse(numbered_robot_text(robot))
    for place, value in changes.items():
        table: Any = document
        try:
            for step in place[:-1]:
                table = table[step]
        except (NonExistentKey, IndexError, TypeError) as error:
            raise InputError(f"{robot} has no table {_shown(place[:-1])}; only values of its tables change") from error
        table[place[-1]] = float(f"{value:.9g}") if isinstance(value, float) else value
    return tomlkit.dumps(document)


def _shown(place: Place) -> str:
    """``joints[3].tube``, counted from 1 as in messages about a file's numbers."""
    words = "".join(f"[{step + 1}]" if isinstance(step, int) else f".{step}" for step in place)
    return words.lstrip(".")
