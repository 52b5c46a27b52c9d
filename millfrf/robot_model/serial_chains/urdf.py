"""Serial chains from URDF files."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from millfrf.core import FileFormatError, InputError, Real, optional_library

from .serial_chain import BASE, RigidPart, SerialChain, SerialJoint, inertia_fault

_TIPS = ("tcp", "tool0", "tool", "flange", "ee_link")
"""Links that are usual names of the flange, in this order, where several stand on the last body."""


@dataclass(frozen=True)
class UrdfTree:
    """Links and joints of a URDF by name, and the joint above each link."""

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
    """Read links and joints, and refuse what is no tree.

    Raises
    ------
    FileFormatError
        Not a URDF, or names that do not fit together.
    InputError
        No such file, or a link on two joints.
    """
    if not path.is_file():
        raise InputError(f"no file {path}; check the name")
    head = path.read_text(encoding="utf-8", errors="replace")
    if "xacro:" in head and "${" in head:
        raise FileFormatError(f"{path} is a xacro file; expand it first: xacro {path.name} > robot.urdf")
    try:  # the library's reader mends broken XML in silence, and so reads half a robot from half a file
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
    except Exception as error:  # the library lets through whatever its XML reader raises
        said = " ".join(str(error).split())[:160] or type(error).__name__
        raise FileFormatError(f"{path} is not a URDF: {said}") from error
    return _joined(path, robot.links, robot.joints)


def _joined(path: Path, all_links: list[Any], all_joints: list[Any]) -> UrdfTree:
    links, joints = {link.name: link for link in all_links}, {joint.name: joint for joint in all_joints}
    if len(links) < len(all_links) or len(joints) < len(all_joints):
        raise FileFormatError(f"{path}: two links or two joints have one name; name each once")
    if not links:
        raise FileFormatError(f"{path} is not a URDF: it has no link")
    above: dict[str, Any] = {}
    for joint in all_joints:
        for end in (joint.parent, joint.child):
            if end not in links:
                raise FileFormatError(f"{path}: joint {joint.name} names a link {end!r} that is not there")
        if joint.child in above:
            raise InputError(
                f"{path}: link {joint.child} hangs on two joints, {above[joint.child].name} and {joint.name}: a closed "
                "loop, which a serial robot does not have; describe it with [[closures]] (docs/robot_files.md)"
            )
        above[joint.child] = joint
    roots = [name for name in links if name not in above]
    if len(roots) != 1:
        raise FileFormatError(f"{path}: {len(roots)} links hang on no joint ({', '.join(roots)}); give one root")
    return UrdfTree(links, joints, above, roots[0])


def chosen_tip(tree: UrdfTree, tip: str | None) -> str:
    """The given tip, or the end of the only row of joints.

    Raises
    ------
    InputError
        No such link, or several rows of joints and none chosen.
    """
    if tip is not None:
        if tip not in tree.links:
            raise InputError(f"--flange {tip}: there is no such link; the links are {', '.join(tree.links)}")
        return tip
    parents = {joint.parent for joint in tree.joints.values()}
    ends = [name for name in tree.links if name not in parents]
    behind = {end: [joint.name for joint in tree.joints_to(end) if joint.type != "fixed"] for end in ends}
    longest = max(ends, key=lambda end: len(behind[end]))
    rows = [end for end in ends if behind[end] != behind[longest][: len(behind[end])]]
    if rows:
        coupled = [joint for joint in tree.joints.values() if joint.mimic is not None]
        why = ""
        if coupled:
            pair = coupled[0]
            why = f" (joint {pair.name} follows {pair.mimic.joint}: a parallelogram, a linkage or a gripper)"
        raise InputError(
            f"the joints branch{why}: ends {', '.join([longest, *rows])}; choose the branch that carries the tool with "
            "--flange LINK: the masses of the others are then carried along, not their stiffness; a closed loop is "
            "described with [[closures]] (docs/robot_files.md)"
        )
    last = [end for end in ends if behind[end] == behind[longest]]
    named = [name for name in _TIPS if name in last]
    if len(last) == 1 or named:
        return named[0] if named else last[0]
    raise InputError(f"the last body has several ends: {', '.join(last)}; choose the tool's with --flange LINK")


_LIGHTEST = 1e-6
"""Mass below which a link counts as massless, kg: such links only carry frames."""


@dataclass(frozen=True)
class ReadChain:
    """A chain as it was read, and what a reader of the file should know of it: one sentence each."""

    name: str
    chain: SerialChain
    notes: tuple[str, ...]


def read_urdf(path: str | os.PathLike[str], tip: str | None = None) -> ReadChain:
    """Read the row of joints from the root of a URDF to its tip; fixed joints are merged, meshes are not needed.

    Joints beside the row are held at zero (or at the limit nearest to it), and the masses behind them move with the
    link that they stand on.

    Parameters
    ----------
    path
        Path of the URDF file.
    tip
        Link at whose origin the flange is, z away from the robot; None: the only end, or ``tool0`` on the last body.

    Raises
    ------
    InputError
        Not one row of joints and no tip chosen, a joint on the row that mimics another, a kind of joint that a serial
        robot does not have, or a mass or inertia that no body has.
    FileFormatError
        Not a URDF.
    """
    tree = read_tree(Path(path))
    last = chosen_tip(tree, tip)
    row = tree.joints_to(last)
    moving = [joint for joint in row if joint.type in ("revolute", "continuous", "prismatic")]
    if not moving:
        raise InputError(f"{path}: no moving joint between {tree.root} and {last}; give another --flange LINK")
    _refuse_coupled(tree, moving, last, tip is not None)
    notes: list[str] = []
    placed = _placed_links(tree, {joint.name for joint in moving}, notes)
    joints, before = [], BASE
    for joint in moving:
        owner, inside = placed[joint.parent]
        assert owner == before
        joints.append(_serial_joint(joint, inside))
        before = joint.name
    parts = [part for name in tree.links if (part := _part(tree.links[name], *placed[name])) is not None]
    endless = [joint.name for joint in moving if joint.type != "continuous" and not np.isfinite(_limits(joint)).all()]
    if endless:
        notes.append(f"the URDF gives no limits of {', '.join(endless)}: no posture is beyond them")
    base, flange = np.eye(4), placed[last][1]
    notes += _mass_notes(tree, placed, {part.name for part in parts})
    return ReadChain(last, SerialChain(tuple(joints), tuple(parts), base, flange), tuple(notes))


def _refuse_coupled(tree: UrdfTree, moving: list[Any], last: str, chosen: bool) -> None:
    """Joints that follow others are no serial robot."""
    for joint in moving:
        if joint.mimic is not None:
            raise InputError(
                f"joint {joint.name} on the way to {last} follows joint {joint.mimic.joint} (mimic): a parallelogram "
                "or a geared pair, which is no serial robot; describe the loop with [[closures]] (docs/robot_files.md, "
                "fanuc_s420if.toml is an example)"
            )
    names = {joint.name for joint in moving}
    for joint in tree.joints.values():
        if not chosen and joint.mimic is not None and joint.mimic.joint in names:
            raise InputError(
                f"joint {joint.name} beside the way to {last} follows joint {joint.mimic.joint} (mimic): a "
                "parallelogram or a linkage; choose --flange LINK to leave its stiffness out and carry its masses along"
            )


def _placed_links(tree: UrdfTree, moving: set[str], notes: list[str]) -> dict[str, tuple[str, Real]]:
    """For each link the joint behind which it moves, and its axes in that body, shape (4, 4)."""
    placed: dict[str, tuple[str, Real]] = {tree.root: (BASE, np.eye(4))}
    waiting = list(tree.joints.values())
    while waiting:
        ready = [joint for joint in waiting if joint.parent in placed]
        if not ready:
            raise InputError(f"joints {', '.join(joint.name for joint in waiting)} go round in a circle; mend the URDF")
        for joint in ready:
            owner, inside = placed[joint.parent]
            if joint.name in moving:
                placed[joint.child] = (joint.name, np.eye(4))
            else:
                placed[joint.child] = (owner, inside @ _origin(joint) @ _held(joint, notes))
            waiting.remove(joint)
    return placed


def _held(joint: Any, notes: list[str]) -> Real:
    """Motion of a joint beside the row, which is held still."""
    from scipy.spatial.transform import Rotation

    held = np.eye(4)
    if joint.type == "fixed":
        return held
    if joint.type not in ("revolute", "continuous", "prismatic"):
        raise InputError(f"joint {joint.name} is {joint.type}; only revolute, continuous, prismatic and fixed are read")
    lower, upper = _limits(joint)
    value = float(np.clip(0.0, lower, upper))
    axis = _axis(joint)
    if joint.type == "prismatic":
        held[:3, 3] = value * axis
    else:
        held[:3, :3] = Rotation.from_rotvec(value * axis).as_matrix()
    follows = f", which follows {joint.mimic.joint}," if joint.mimic is not None else ""
    notes.append(
        f"joint {joint.name}{follows} is beside the way to the tip: it is held at {value:g}, what hangs on it is "
        "carried along as a mass, and its stiffness is left out"
    )
    return held


def _serial_joint(joint: Any, inside: Real) -> SerialJoint:
    lower, upper = _limits(joint)
    motion = "prismatic" if joint.type == "prismatic" else "revolute"
    return SerialJoint(joint.name, motion, inside @ _origin(joint), _axis(joint), lower, upper)


def _limits(joint: Any) -> tuple[float, float]:
    """Limits in rad or m; a continuous joint, or one with lower = upper = 0, has none."""
    limit = joint.limit
    if joint.type == "continuous" or limit is None or limit.lower is None or limit.upper is None:
        return -np.inf, np.inf
    lower, upper = float(limit.lower), float(limit.upper)
    if lower == upper == 0:
        return -np.inf, np.inf
    if not lower <= upper:
        raise InputError(f"joint {joint.name}: limits {lower:g} to {upper:g} are not increasing; mend the URDF")
    return lower, upper


def _axis(joint: Any) -> Real:
    given = np.array([1.0, 0.0, 0.0]) if joint.axis is None else np.asarray(joint.axis, dtype=float)
    if given.shape != (3,) or not np.linalg.norm(given) > 1e-9:
        raise InputError(f"joint {joint.name}: axis {given.tolist()} has no direction; mend the URDF")
    return np.asarray(given / np.linalg.norm(given))


def _origin(part: Any) -> Real:
    place = np.eye(4) if part.origin is None else np.asarray(part.origin, dtype=float)
    if not np.all(np.isfinite(place)):
        raise InputError(f"{getattr(part, 'name', 'a link')}: its origin is not finite; mend the URDF")
    return place


def _part(link: Any, joint: str, inside: Real) -> RigidPart | None:
    """A link's mass in the axes of the body that it belongs to; None where it has none."""
    if link.inertial is None or not link.inertial.mass:
        return None
    mass = float(link.inertial.mass)
    if not (np.isfinite(mass) and mass > 0):
        raise InputError(f"link {link.name}: mass {mass:g} kg; give a positive mass, or leave <inertial> out")
    if mass < _LIGHTEST:
        return None
    place = inside @ _origin(link.inertial)
    given = np.zeros((3, 3)) if link.inertial.inertia is None else np.asarray(link.inertial.inertia, dtype=float)
    fault = inertia_fault(given)
    if fault is not None:
        raise InputError(f"link {link.name}: {fault}; mend <inertia> in the URDF")
    turn = place[:3, :3]
    return RigidPart(link.name, joint, mass, place[:3, 3], turn @ given @ turn.T)


def _mass_notes(tree: UrdfTree, placed: dict[str, tuple[str, Real]], with_mass: set[str]) -> list[str]:
    """Bodies between joints on which no link has a mass."""
    carried = {placed[name][0] for name in with_mass}
    empty = [joint for joint in dict.fromkeys(owner for owner, _ in placed.values()) if joint not in {*carried, BASE}]
    if not with_mass - {name for name, (owner, _) in placed.items() if owner == BASE}:
        return ["the URDF gives no masses: statics only, until [[bodies]] are added or --total-mass is given"]
    return [f"the URDF gives no mass behind joint {', '.join(empty)}"] if empty else []
