"""Links and joints of a URDF as a tree, read by yourdfpy, and the link that carries the tool."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from foundation import FileFormatError, InputError, optional_library

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
