"""Whether a robot's nodes, joints, links and bodies fit together: what cannot be meant is refused with a remedy."""

from __future__ import annotations

from typing import TYPE_CHECKING

from foundation import InputError

if TYPE_CHECKING:
    from .spatial_robot import SpatialRobot


def check_robot(robot: SpatialRobot) -> None:
    """Refuse a robot whose parts do not fit together.

    A node stands on one body: the body before a joint for the joint's first node, the body after it for the second,
    the frame's own for a point. Links and lumped masses stay on one body, or they would bypass a joint.

    Raises
    ------
    InputError
        A frame that is not there, a node that is placed nowhere or on two bodies, a link over a joint, a mass in the
        axes of another body, or gravity on a robot with closed loops.
    """
    _frames_exist(robot)
    _nodes_exist(robot)
    owner = node_bodies(robot)
    if owner.get(0, "0") != "0":
        raise InputError(f"robot: node 0 is the clamped base, but it stands on frame {owner[0]}; number that node anew")
    for link in robot.links:
        first, second = (owner[node] for node in link.nodes)
        if first != second:
            raise InputError(
                f"link {list(link.nodes)} joins frames {first} and {second} and so bypasses the joint between them; "
                "let each link end on the body it starts on"
            )
    for body in robot.bodies:
        if robot.mechanism.body_of[body.frame] != owner[body.node]:
            raise InputError(
                f"body at node {body.node}: its frame {body.frame} is on another body than the node, which moves with "
                f"frame {owner[body.node]}; give it that frame"
            )
    if robot.gravity and robot.mechanism.closures:
        raise InputError("gravity is given for open chains only; this robot has closed loops: leave it at 0")


def node_bodies(robot: SpatialRobot) -> dict[int, str]:
    """Body of each node, named as in :attr:`robot_model.Mechanism.body_of`.

    Raises
    ------
    InputError
        A node that two joints, or a joint and a point, put on different bodies.
    """
    mechanism = robot.mechanism
    before = {frame.name: frame.antecedent for frame in mechanism.frames}
    claims = [(node, mechanism.body_of[name], f"point in frame {name}") for node, (name, _) in robot.points.items()]
    for joint in robot.joints:
        claims.append((joint.nodes[0], mechanism.body_of[before[joint.frame]], f"joint {joint.frame}"))
        claims.append((joint.nodes[1], mechanism.body_of[joint.frame], f"joint {joint.frame}"))
    owner: dict[int, tuple[str, str]] = {}
    for node, body, who in claims:
        known, first = owner.setdefault(node, (body, who))
        if known != body:
            raise InputError(
                f"robot: node {node} stands on two bodies: {who} puts it on that of frame {body}, {first} on that of "
                f"frame {known}; a joint's first node is on the body before it, its second on the body after it"
            )
    return {node: body for node, (body, _) in owner.items()}


def _frames_exist(robot: SpatialRobot) -> None:
    known = {"0"} | {frame.name for frame in robot.mechanism.frames}
    named = [(f"point at node {node}", name) for node, (name, _) in robot.points.items()]
    named += [(f"joint with nodes {list(joint.nodes)}", joint.frame) for joint in robot.joints]
    named += [(f"body at node {body.node}", body.frame) for body in robot.bodies]
    named += [(f"link {list(link.nodes)}", link.frame) for link in robot.links if link.frame is not None]
    for who, name in named:
        if name not in known:
            raise InputError(f"{who}: there is no frame {name!r}; the frames are {', '.join(sorted(known))}")
    if any(joint.frame == "0" for joint in robot.joints):
        raise InputError("a joint is at frame '0', the base, which does not move; give the frame after the joint")


def _nodes_exist(robot: SpatialRobot) -> None:
    for what, pairs in (("joint", robot.joints), ("link", robot.links)):
        for pair in pairs:
            if pair.nodes[0] == pair.nodes[1]:
                raise InputError(f"{what} {list(pair.nodes)} starts and ends at one node; give two different nodes")
    placed = {node for joint in robot.joints for node in joint.nodes} | set(robot.points)
    wanted = {node for link in robot.links for node in link.nodes} | {body.node for body in robot.bodies} | {robot.tip}
    negative = sorted(node for node in wanted | placed if node < 0)
    if negative:
        raise InputError(f"robot: node {negative[0]} is negative; number nodes from 0, the clamped base")
    missing = sorted((wanted | set(range(max(wanted | placed) + 1))) - placed)
    if missing:
        raise InputError(f"robot: nodes {missing} are at no joint and no point; give their place")
