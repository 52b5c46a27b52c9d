"""Serial chains from URDF files, and from tables of Denavit-Hartenberg parameters."""

import csv
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import scipy

from millfrf.core import FileFormatError, InputError, Real, optional_library

from ..settings import ROBOT
from .serial_chain import BASE, RigidPart, SerialChain, SerialJoint, inertia_fault, symmetric

_TIPS = ("tcp", "tool0", "tool", "flange", "ee_link")  # usual names of the flange link, in order of preference
_MOVING = ("revolute", "continuous", "prismatic")
_CLOSED_LOOP = "describe the loop with [[closures]] (docs/robot_files.md, fanuc_s420if.toml is an example)"


@dataclass(frozen=True)
class UrdfTree:
    """Links and joints of a URDF by name, and the joint above each link; all are objects of ``yourdfpy``."""

    links: dict[str, Any]
    joints: dict[str, Any]
    above: dict[str, Any]
    root: str

    def joints_to(self, link: str) -> list[Any]:
        """Joints from the root to a link, in order."""
        row: list[Any] = []
        while link != self.root:
            row.append(self.above[link])
            link = self.above[link].parent
        return row[::-1]


def read_tree(path: Path) -> UrdfTree:
    """Read links and joints of a URDF, and check that they form one tree."""
    if not path.is_file():
        raise InputError(f"no file {path}; check the name")
    head = path.read_text(encoding="utf-8", errors="replace")
    if "xacro:" in head and "${" in head:
        raise FileFormatError(f"{path} is a xacro file; expand it first: xacro {path.name} > robot.urdf")
    try:  # the library's parser repairs broken XML silently, and so reads half a robot from half a file
        root = ElementTree.fromstring(path.read_bytes())
    except ElementTree.ParseError as error:
        raise FileFormatError(f"{path} is not a URDF: {error}") from error
    if root.tag != "robot":
        raise FileFormatError(f"{path} is not a URDF: its first element is <{root.tag}>, not <robot>")
    library = optional_library("yourdfpy", "Reading URDF", "urdf")
    try:
        robot = library.URDF.load(
            str(path), build_scene_graph=False, load_meshes=False, build_collision_scene_graph=False
        ).robot
    except Exception as error:  # the library lets through whatever its XML parser raises
        message = " ".join(str(error).split())[:160] or type(error).__name__
        raise FileFormatError(f"{path} is not a URDF: {message}") from error
    return _tree(path, robot.links, robot.joints)


def _tree(path: Path, all_links: list[Any], all_joints: list[Any]) -> UrdfTree:
    links, joints = {link.name: link for link in all_links}, {joint.name: joint for joint in all_joints}
    if len(links) < len(all_links) or len(joints) < len(all_joints):
        raise FileFormatError(f"{path}: two links or two joints have one name; name each once")
    if not links:
        raise FileFormatError(f"{path} is not a URDF: it has no link")
    above: dict[str, Any] = {}
    for joint in all_joints:
        for end in (joint.parent, joint.child):
            if end not in links:
                raise FileFormatError(f"{path}: joint {joint.name} names a link {end!r} that does not exist")
        if joint.child in above:
            raise InputError(
                f"{path}: link {joint.child} is the child of two joints, {above[joint.child].name} and {joint.name}: a "
                "closed loop, which a serial robot does not have; describe it with [[closures]] (docs/robot_files.md)"
            )
        above[joint.child] = joint
    roots = [name for name in links if name not in above]
    if len(roots) != 1:
        raise FileFormatError(f"{path}: {len(roots)} links have no parent joint ({', '.join(roots)}); give one root")
    return UrdfTree(links, joints, above, roots[0])


def chosen_tip(tree: UrdfTree, tip: str | None) -> str:
    """Return the given tip, or the end of the only row of joints; several rows without a given tip are an error."""
    if tip is not None:
        if tip not in tree.links:
            raise InputError(f"--flange {tip}: there is no such link; the links are {', '.join(tree.links)}")
        return tip
    parents = {joint.parent for joint in tree.joints.values()}
    ends = [name for name in tree.links if name not in parents]
    behind = {end: [joint.name for joint in tree.joints_to(end) if joint.type != "fixed"] for end in ends}
    longest = max(ends, key=lambda end: len(behind[end]))
    branches = [end for end in ends if behind[end] != behind[longest][: len(behind[end])]]
    if branches:
        reason = ""
        coupled = next((joint for joint in tree.joints.values() if joint.mimic is not None), None)
        if coupled is not None:
            reason = f" (joint {coupled.name} follows {coupled.mimic.joint}: a parallelogram, a linkage or a gripper)"
        raise InputError(
            f"the joints branch{reason}: ends {', '.join([longest, *branches])}; choose the branch that carries the "
            "tool with --flange LINK: the masses of the others are then carried along, not their stiffness; a closed "
            "loop is described with [[closures]] (docs/robot_files.md)"
        )
    last = [end for end in ends if behind[end] == behind[longest]]
    named = [name for name in _TIPS if name in last]
    if len(last) == 1 or named:
        return named[0] if named else last[0]
    raise InputError(f"the last body has several ends: {', '.join(last)}; choose the tool's with --flange LINK")


@dataclass(frozen=True)
class ReadChain:
    """A chain as it was read, with the name of its flange and notes for the reader of the file."""

    name: str
    chain: SerialChain
    notes: tuple[str, ...]


def read_urdf(path: str | os.PathLike[str], tip: str | None = None) -> ReadChain:
    """Read the row of joints from the root of a URDF to its tip; fixed joints are merged, meshes are not needed.

    Joints that are not on this row are held at zero (or at the limit nearest to zero), and the masses behind them move
    with the link on which they stand.

    Parameters
    ----------
    path
        Path of the URDF file.
    tip
        Link at whose origin the flange is, z away from the robot; None: the only end, or ``tool0`` on the last body.

    Raises
    ------
    InputError
        Several rows of joints and no tip chosen, a joint on the row that mimics another, a kind of joint that a serial
        robot does not have, or an impossible mass or inertia.
    FileFormatError
        Not a URDF.
    """
    tree = read_tree(Path(path))
    last = chosen_tip(tree, tip)
    moving = [joint for joint in tree.joints_to(last) if joint.type in _MOVING]
    if not moving:
        raise InputError(f"{path}: no moving joint between {tree.root} and {last}; give another --flange LINK")
    _refuse_coupled(tree, moving, last, tip is not None)
    notes: list[str] = []
    placed = _placed_links(tree, {joint.name for joint in moving}, notes)
    joints = []
    for joint in moving:
        motion = "prismatic" if joint.type == "prismatic" else "revolute"
        place = placed[joint.parent][1] @ _origin(joint)
        joints.append(SerialJoint(joint.name, motion, place, _axis(joint), *_limits(joint)))
    parts = [part for name in tree.links if (part := _part(tree.links[name], *placed[name])) is not None]
    endless = [joint.name for joint in moving if joint.type != "continuous" and not np.isfinite(_limits(joint)).all()]
    if endless:
        notes.append(f"the URDF gives no limits of {', '.join(endless)}: no posture is beyond them")
    notes += _mass_notes(placed, {part.name for part in parts})
    chain = SerialChain(tuple(joints), tuple(parts), np.eye(4), placed[last][1])
    return ReadChain(last, chain, tuple(notes))


def _refuse_coupled(tree: UrdfTree, moving: list[Any], last: str, chosen: bool) -> None:
    """Raise an error if a joint mimics another joint, unless it is outside the row to a chosen tip."""
    for joint in moving:
        if joint.mimic is not None:
            raise InputError(
                f"joint {joint.name} on the way to {last} follows joint {joint.mimic.joint} (mimic): a parallelogram "
                f"or a geared pair, which is no serial robot; {_CLOSED_LOOP}"
            )
    names = {joint.name for joint in moving}
    for joint in tree.joints.values():
        if not chosen and joint.mimic is not None and joint.mimic.joint in names:
            raise InputError(
                f"joint {joint.name}, not on the way to {last}, follows joint {joint.mimic.joint} (mimic): a "
                "parallelogram or a linkage; choose --flange LINK to leave its stiffness out and carry its masses along"
            )


def _placed_links(tree: UrdfTree, moving: set[str], notes: list[str]) -> dict[str, tuple[str, Real]]:
    """Return for each link the joint after which it moves, and the link's place in the body of that joint, (4, 4)."""
    placed: dict[str, tuple[str, Real]] = {tree.root: (BASE, np.eye(4))}
    waiting = list(tree.joints.values())
    while waiting:
        ready = [joint for joint in waiting if joint.parent in placed]
        if not ready:
            raise InputError(
                f"joints {', '.join(joint.name for joint in waiting)} form a closed circle; correct the URDF"
            )
        for joint in ready:
            owner, axes = placed[joint.parent]
            if joint.name in moving:
                placed[joint.child] = (joint.name, np.eye(4))
            else:
                placed[joint.child] = (owner, axes @ _origin(joint) @ _held_transform(joint, notes))
            waiting.remove(joint)
    return placed


def _held_transform(joint: Any, notes: list[str]) -> Real:
    """Compute the transformation (4, 4) of a joint that is outside the row and therefore held still."""
    transform = np.eye(4)
    if joint.type == "fixed":
        return transform
    if joint.type not in _MOVING:
        raise InputError(f"joint {joint.name} is {joint.type}; only revolute, continuous, prismatic and fixed are read")
    value = float(np.clip(0.0, *_limits(joint)))
    axis = _axis(joint)
    if joint.type == "prismatic":
        transform[:3, 3] = value * axis
    else:
        transform[:3, :3] = scipy.spatial.transform.Rotation.from_rotvec(value * axis).as_matrix()
    follows = f", which follows {joint.mimic.joint}," if joint.mimic is not None else ""
    notes.append(
        f"joint {joint.name}{follows} is not on the way to the tip: it is held at {value:g}, the links on it are "
        "carried along as masses, and its stiffness is left out"
    )
    return transform


def _limits(joint: Any) -> tuple[float, float]:
    """Return the limits of a joint in rad or m; infinite for a continuous joint, or where lower = upper = 0."""
    limit = joint.limit
    if joint.type == "continuous" or limit is None or limit.lower is None or limit.upper is None:
        return -np.inf, np.inf
    lower, upper = float(limit.lower), float(limit.upper)
    if lower == upper == 0:
        return -np.inf, np.inf
    if not lower <= upper:
        raise InputError(f"joint {joint.name}: limits {lower:g} to {upper:g} are not increasing; correct the URDF")
    return lower, upper


def _axis(joint: Any) -> Real:
    axis = np.array([1.0, 0.0, 0.0]) if joint.axis is None else np.asarray(joint.axis, dtype=float)
    if axis.shape != (3,) or not np.linalg.norm(axis) > 1e-9:
        raise InputError(f"joint {joint.name}: axis {axis.tolist()} has no direction; correct the URDF")
    return np.asarray(axis / np.linalg.norm(axis))


def _origin(part: Any) -> Real:
    place = np.eye(4) if part.origin is None else np.asarray(part.origin, dtype=float)
    if not np.all(np.isfinite(place)):
        raise InputError(f"{getattr(part, 'name', 'a link')}: its origin is not finite; correct the URDF")
    return place


def _part(link: Any, joint: str, axes: Real) -> RigidPart | None:
    """Return a link's mass in the axes of its body; None if the mass is missing or negligible (a link for frames)."""
    if link.inertial is None or not link.inertial.mass:
        return None
    mass = float(link.inertial.mass)
    if not (np.isfinite(mass) and mass > 0):
        raise InputError(f"link {link.name}: mass {mass:g} kg; give a positive mass, or leave <inertial> out")
    if mass < ROBOT.massless_link:
        return None
    place = axes @ _origin(link.inertial)
    inertia = np.zeros((3, 3)) if link.inertial.inertia is None else np.asarray(link.inertial.inertia, dtype=float)
    fault = inertia_fault(inertia)
    if fault is not None:
        raise InputError(f"link {link.name}: {fault}; correct <inertia> in the URDF")
    turn = place[:3, :3]
    return RigidPart(link.name, joint, mass, place[:3, 3], turn @ inertia @ turn.T)


def _mass_notes(placed: dict[str, tuple[str, Real]], with_mass: set[str]) -> list[str]:
    """Note the bodies between joints on which no link has a mass."""
    carried = {placed[name][0] for name in with_mass}
    if not carried - {BASE}:
        return ["the URDF gives no masses: statics only, until [[bodies]] are added or --total-mass is given"]
    empty = [joint for joint in dict.fromkeys(owner for owner, _ in placed.values()) if joint not in {*carried, BASE}]
    return [f"the URDF gives no mass behind joint {', '.join(empty)}"] if empty else []


_SCALES = {"m": 1.0, "mm": 1e-3, "rad": 1.0, "deg": np.pi / 180}
_LENGTHS, _ANGLES = ("a", "d", "b"), ("alpha", "theta", "gamma")
_CENTRE = ("cx_m", "cy_m", "cz_m")
_INERTIA = ("ixx_kg_m2", "iyy_kg_m2", "izz_kg_m2", "ixy_kg_m2", "ixz_kg_m2", "iyz_kg_m2")
_COLUMNS = {
    *(f"{key}_{unit}" for key in _LENGTHS for unit in ("m", "mm")),
    *(f"{key}_{unit}" for key in _ANGLES for unit in ("deg", "rad")),
    *("name", "motion", "lower", "upper", "mass_kg", *_CENTRE, *_INERTIA),
}


def read_dh(path: str | os.PathLike[str], convention: str) -> ReadChain:
    """Read a robot from a CSV with one row for each joint.

    Standard: ``Rot(z, theta + q) Trans(z, d) Trans(x, a) Rot(x, alpha)``, joint i turns about z of frame i - 1
    (Denavit & Hartenberg 1955; Paul 1981). Modified: ``Rot(z, gamma) Trans(z, b) Rot(x, alpha) Trans(x, a)
    Rot(z, theta + q) Trans(z, d)``, joint i turns about z of frame i (Craig 1986; Khalil & Kleinfinger 1986). For a
    prismatic joint q is added to d.

    Parameters
    ----------
    path
        CSV with the columns ``a``, ``alpha``, ``d``, ``theta`` with their unit (``a_mm`` or ``a_m``, ``alpha_deg`` or
        ``alpha_rad``); optional ``name``, ``motion``, ``lower`` and ``upper`` (degrees; metres for prismatic joints),
        ``gamma`` and ``b`` (modified), ``mass_kg``, ``cx_m cy_m cz_m`` and ``ixx_kg_m2`` to ``iyz_kg_m2`` about the
        centre, in the axes of frame i.
    convention
        ``standard`` or ``modified``: the same numbers mean two different robots.

    Raises
    ------
    InputError
        No such file or convention.
    FileFormatError
        A column that is missing or unknown, or a value that is not a number.
    """
    if convention not in ("standard", "modified"):
        raise InputError(f"--dh {convention}: give standard or modified; the same table means another robot in each")
    joints, parts = [], []
    behind = np.eye(4)  # standard: frame i - 1 in the axes of joint i
    for number, cells in enumerate(_rows(Path(path)), 1):
        row = _Row(path, number, cells)
        name, motion = cells.get("name") or str(number), cells.get("motion") or "revolute"
        fixed = _about_z(row.parameter("theta"), row.parameter("d"))
        twist = _about_x(row.parameter("alpha"), row.parameter("a"))
        if convention == "standard":
            place, body = behind, fixed @ twist
            behind = body
        else:
            place, body = _about_z(row.parameter("gamma"), row.parameter("b")) @ twist @ fixed, np.eye(4)
        joints.append(SerialJoint(name, motion, place, np.array([0.0, 0.0, 1.0]), *row.limits(motion)))
        part = row.part(name, body)
        parts += [part] if part is not None else []
    flange = behind if convention == "standard" else np.eye(4)
    notes = () if parts else ("the table gives no masses: statics only, until [[bodies]] or --total-mass are given",)
    return ReadChain("flange", SerialChain(tuple(joints), tuple(parts), np.eye(4), flange), notes)


def _rows(path: Path) -> list[dict[str, str]]:
    if not path.is_file():
        raise InputError(f"no file {path}; check the name")
    lines = [line for line in path.read_text(encoding="utf-8-sig").splitlines() if line.strip() and line[0] != "#"]
    rows = list(csv.DictReader(lines, skipinitialspace=True))
    if not rows:
        raise FileFormatError(f"{path}: no row of parameters; give a header and one row for each joint")
    columns = [name.strip() for name in rows[0] if name is not None]
    for name in columns:
        if name not in _COLUMNS:
            raise FileFormatError(f"{path}: column {name!r} is not known; columns are {', '.join(sorted(_COLUMNS))}")
    for key in ("a", "alpha", "d", "theta"):
        if sum(name.rpartition("_")[0] == key for name in columns) != 1:
            unit = "m or _mm" if key in _LENGTHS else "deg or _rad"
            raise FileFormatError(f"{path}: give the column {key} once, with its unit: {key}_{unit}")
    return [{(key or "").strip(): (text or "").strip() for key, text in row.items()} for row in rows]


@dataclass(frozen=True)
class _Row:
    """One joint of a table, with its place for messages."""

    path: object
    number: int
    cells: Mapping[str, str]

    def parameter(self, key: str) -> float:
        """Return a length in m or an angle in rad; 0 if there is no such column."""
        for column in self.cells:
            name, _, unit = column.rpartition("_")
            if name == key and unit in _SCALES:
                return _SCALES[unit] * self.value(column)
        return 0.0

    def value(self, column: str, default: str = "") -> float:
        text = self.cells.get(column) or default
        try:
            value = float(text)
        except ValueError:
            value = np.nan
        if not np.isfinite(value):
            raise FileFormatError(f"{self.path}: row {self.number}, column {column}: {text!r} is not a number")
        return value

    def limits(self, motion: str) -> tuple[float, float]:
        if not (self.cells.get("lower") or self.cells.get("upper")):
            return -np.inf, np.inf
        scale = 1.0 if motion == "prismatic" else _SCALES["deg"]
        return scale * self.value("lower"), scale * self.value("upper")

    def part(self, name: str, body: Real) -> RigidPart | None:
        """Return the link's mass, transformed from the axes of frame i into the axes of the joint's body."""
        mass = self.value("mass_kg", "0")
        if not mass:
            return None
        if mass < 0:
            raise InputError(f"{self.path}: row {self.number}: mass_kg = {mass:g} must be positive")
        centre = np.array([self.value(column, "0") for column in _CENTRE])
        inertia = symmetric([self.value(column, "0") for column in _INERTIA])
        fault = inertia_fault(inertia)
        if fault is not None:
            raise InputError(f"{self.path}: row {self.number}: {fault}")
        turn = body[:3, :3]
        return RigidPart(f"link {name}", name, mass, turn @ centre + body[:3, 3], turn @ inertia @ turn.T)


def _about_z(angle: float, along: float) -> Real:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0, 0], [sine, cosine, 0, 0], [0, 0, 1, along], [0, 0, 0, 1.0]])


def _about_x(angle: float, along: float) -> Real:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0, along], [0, cosine, -sine, 0], [0, sine, cosine, 0], [0, 0, 0, 1.0]])
