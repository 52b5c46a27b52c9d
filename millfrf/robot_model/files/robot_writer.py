"""Text of robot files: of a new serial robot, of a serial robot with numbered nodes, and of a file with new numbers."""

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import tomlkit
from tomlkit.exceptions import NonExistentKey

from millfrf.core import InputError, Real

from ..kinematics.mechanism import Frame
from ..serial_chains.serial_chain import BASE, SerialChain, SerialJoint, shift_and_angles, six_of
from ..settings import TYPICAL
from ..spatial.spatial_robot import ElasticJoint, LumpedBody, SpatialRobot
from .robot_files import kind_of, read_table, robot_text
from .serial_file import read_serial_robot

Entries = dict[str, Any]


@dataclass(frozen=True)
class SerialFileData:
    """Numbers of a serial robot's file besides its chain, and the source of every table.

    Parameters
    ----------
    stiffness
        Stiffness of each joint along its own motion, N m/rad or N/m, and its source.
    spindle
        Mass (kg), centre from the flange (m), inertia about the centre (3, 3), and source of the spindle; or None.
    damping
        Damping ratio of all modes, and its source.
    origin
        Source of joints and bodies in full, for the table ``[robot]``.
    short
        The same source in a word or two, for each table.
    tool
        Source of the tool tip's place.
    base
        Source of the base's place.
    posture
        Joint values of the first posture, degrees and metres, and its source.
    bodies
        Source of each part whose source is not ``short``.
    notes
        Notes for the reader of the file, one sentence each.
    """

    stiffness: Sequence[tuple[float, str]]
    spindle: tuple[float, Real, Real, str] | None
    damping: tuple[float, str]
    origin: str
    short: str
    tool: str
    base: str
    posture: tuple[Sequence[float], str]
    bodies: dict[str, str]
    notes: Sequence[str]


def chain_text(name: str, chain: SerialChain, data: SerialFileData) -> str:
    """Write the TOML text of a serial robot, with comments on the next steps."""
    notes = [f"# note: {note}" for note in data.notes]
    blocks = ["\n".join([*_INTRODUCTION, *notes])]
    blocks.append(_block("[robot]", {"name": name, "kind": "serial", "source": data.origin}))
    blocks.append(_block("[base]", _place(chain.base) | {"source": data.base}))
    blocks.append(_stiffness_comment())
    for joint, (stiffness, source) in zip(chain.joints, data.stiffness, strict=True):
        blocks.append(_block("[[joints]]", _joint(joint) | {"source": data.short}))
        key = "drive_n_per_m" if joint.motion == "prismatic" else "drive_nm_per_rad"
        blocks.append(_block("[joints.stiffness]", {key: float(stiffness), "source": source}))
    for part in chain.parts:
        head = {"name": part.name, "joint": part.joint}
        mass = _mass(part.mass, part.centre, part.inertia, data.bodies.get(part.name, data.short))
        blocks.append(_block("[[bodies]]", head | mass))
    flange = _place(chain.flange) | {"source": data.short}
    blocks.append("# in the axes of the last joint's body\n" + _block("[flange]", flange))
    tool = _place(chain.tool) | {"source": data.tool}
    blocks.append("# tip of the tool in the axes of the flange; z along the tool\n" + _block("[tool]", tool))
    if data.spindle is not None:
        comment = "# motor spindle, holder and tool together, in the axes of the flange\n"
        blocks.append(comment + _block("[spindle]", _mass(*data.spindle)))
    blocks.append(_block("[damping]", dict(zip(("ratio", "source"), data.damping, strict=True))))
    values, source = data.posture
    blocks.append(_block("[[poses]]", {"name": "ready", "driven": _list(values), "source": source}))
    return "\n\n".join(blocks) + "\n"


_INTRODUCTION = (
    "# A serial robot: joints and bodies in a row; nodes are built from them. Every table says where its numbers",
    "# come from; `assumed` is named in the warnings of each result. Keys: docs/robot_files.md.",
)


def _stiffness_comment() -> str:
    return (
        "# Joint stiffness in [joints.stiffness]. Order of magnitude, within a factor of "
        f"{TYPICAL.stiffness_factor:g}: {TYPICAL.arm_stiffness:g} (first three joints) and\n"
        f"# {TYPICAL.wrist_stiffness:g} (wrist) times the torque of the rated payload at the reach, N m/rad; "
        f"linear axis {TYPICAL.rail_stiffness:.0e} N/m."
    )


def _joint(joint: SerialJoint) -> Entries:
    head: Entries = {"name": joint.name, "motion": joint.motion}
    return head | _place(joint.place) | {"axis": _list(joint.axis)} | _limits(joint)


def _limits(joint: SerialJoint | Frame) -> Entries:
    limits = np.array([joint.lower, joint.upper])
    if joint.motion == "fixed" or not np.isfinite(limits).all():
        return {}
    return {"limits_m": _list(limits)} if joint.motion == "prismatic" else {"limits_deg": _list(np.degrees(limits))}


def _place(place: Real) -> Entries:
    shift, angles = shift_and_angles(place)
    return {"at_m": _list(shift), "turned_deg": _list(np.degrees(angles))}


def _mass(mass: float, centre: Real, inertia: Real, source: str) -> Entries:
    six = json.dumps(_list(six_of(inertia)))
    commented = _Literal(f"{six}  # xx, yy, zz, xy, xz, yz")
    return {"mass_kg": float(mass), "centre_m": _list(centre), "inertia_kg_m2": commented, "source": source}


def _list(values: Sequence[float] | Real) -> list[float]:
    return [float(value) + 0.0 for value in values]  # no negative zero


class _Literal(str):
    """A value that is written as it stands."""


def _block(heading: str, entries: Entries) -> str:
    # the JSON form of numbers, lists and texts is valid TOML
    lines = (f"{k} = {v if isinstance(v, _Literal) else json.dumps(v, ensure_ascii=False)}" for k, v in entries.items())
    return "\n".join([heading, *lines])


def numbered_robot_text(robot: str | os.PathLike[str]) -> str:
    """Return the text of a robot's file; a serial robot is written with its frames and nodes, as kind ``spatial``.

    An update adds springs, bodies and frames, which the kind ``serial`` cannot describe. Both texts describe the same
    robot.

    Parameters
    ----------
    robot
        Path of a file, or name of a robot of this package.

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
    if kind_of(content) != "serial":
        return robot_text(robot)
    built = read_serial_robot(robot).robot
    head = {key: value for key, value in content["robot"].items() if key not in ("kind", "source")}
    head |= {"kind": "spatial", "tip_node": built.tip, "tool_frame": built.mechanism.tool}
    head["source"] = content["robot"]["source"]
    blocks = ["# Written out from a file of kind serial: the same robot with frames and numbered nodes."]
    blocks.append(_block("[robot]", head))
    blocks += [_block("[[frames]]", _frame(frame)) for frame in built.mechanism.frames]
    for node, (name, place) in built.points.items():
        point = {"node": node, "frame": name, "at_m": place.tolist(), "source": "joint or tip"}
        blocks.append(_block("[[points]]", point))
    for joint, row in zip(built.joints, content["joints"], strict=True):
        blocks.append(_block("[[joints]]", _elastic_joint(joint) | {"source": row["stiffness"]["source"]}))
    blocks += [_block("[[links]]", {"nodes": list(link.nodes), "source": "rigid"}) for link in built.links]
    blocks += _bodies(built, content)
    if "damping" in content:
        blocks.append(_block("[damping]", content["damping"]))
    blocks += [_block("[[poses]]", pose) for pose in content.get("poses", [])]
    return "\n\n".join(blocks) + "\n"


def _frame(frame: Frame) -> Entries:
    entries: Entries = {"name": frame.name, "antecedent": frame.antecedent, "motion": frame.motion}
    entries |= {f"{key}_deg": float(np.degrees(getattr(frame, key))) for key in ("gamma", "alpha", "theta")}
    entries |= {f"{key}_m": float(getattr(frame, key)) for key in ("b", "d", "r")}
    return entries | _limits(frame) | {"source": "from the joints' places and axes"}


def _elastic_joint(joint: ElasticJoint) -> Entries:
    keys = {0: "radial_n_per_m", 2: "axial_n_per_m", 3: "tilting_nm_per_rad", 5: "turning_nm_per_rad"}
    elastic = {key: float(joint.stiffness[at]) for at, key in keys.items() if np.isfinite(joint.stiffness[at])}
    return {"frame": joint.frame, "nodes": list(joint.nodes)} | elastic


def _bodies(robot: SpatialRobot, content: dict[str, Any]) -> list[str]:
    sources = [row["source"] for row in content.get("bodies", []) if row["joint"] != BASE]
    sources += [content["spindle"]["source"]] if "spindle" in content else []
    return [
        _block("[[bodies]]", _lumped_body(body) | {"source": source})
        for body, source in zip(robot.bodies, sources, strict=True)
    ]


def _lumped_body(body: LumpedBody) -> Entries:
    inertia = [float(body.inertia[at]) for at in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    entries = {"node": body.node, "frame": body.frame, "mass_kg": body.mass, "centre_m": body.centre.tolist()}
    return entries | {"inertia_kg_m2": inertia}


Place = tuple[str | int, ...]  # of a value in a file: ("joints", 2, "turning_nm_per_rad"), tables counted from 0


def changed_robot_text(robot: str | os.PathLike[str], changes: Mapping[Place, Any]) -> str:
    """Write a robot's file with other values at some places; comments, order and spelling of the rest are kept.

    A key that is not in the file is added to its table.

    Parameters
    ----------
    robot
        Path of a file, or name of a robot of this package.
    changes
        New values by place, such as ``("joints", 2, "turning_nm_per_rad")`` with tables counted from 0: numbers
        (written with nine digits), text, lists or tables.

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
            words = "".join(f"[{step + 1}]" if isinstance(step, int) else f".{step}" for step in place[:-1])
            raise InputError(f"{robot} has no table {words.lstrip('.')}; only values of its tables change") from error
        table[place[-1]] = float(f"{value:.9g}") if isinstance(value, float) else value
    return tomlkit.dumps(document)
