"""The step from a `SerialChain` to a `SpatialRobot`: nodes are built, not numbered by hand."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kinematics import Mechanism
from ..spatial import ElasticJoint, Link, LumpedBody, SpatialRobot
from .frames_of_axes import axis_frames, fixed_frames
from .serial_chain import BASE, SerialChain

Real = NDArray[np.float64]

FLANGE, TOOL = "flange (fixed)", "tool (fixed)"
"""Names of the frames after the last joint."""


def spatial_robot(chain: SerialChain, **options: Any) -> SpatialRobot:
    """Build the robot: two nodes a joint, rigid bodies between them, the tip behind the last.

    Joint i has node 2 i - 1 on the body before and node 2 i on the body after it, both at its origin; node 0 is the
    clamped base, the last node the tool tip. Parts on the base are left out: they do not move.

    Parameters
    ----------
    chain
        Joints and parts.
    options
        Damping and gravity as :class:`SpatialRobot` takes them: ``rayleigh``, ``damping_ratio``, ``gravity``, ``up``.
    """
    built = axis_frames(chain.joints, chain.base)
    names = [joint.name for joint in chain.joints]
    last = built.bodies[names[-1]]
    flange = fixed_frames(FLANGE, names[-1], last @ chain.flange)
    tool = fixed_frames(TOOL, FLANGE, chain.tool)
    points: dict[int, tuple[str, Real]] = {0: ("0", np.zeros(3))}
    joints, links = [], []
    before, inside = "0", chain.base
    for number, joint in enumerate(chain.joints):
        first, second = 2 * number + 1, 2 * number + 2
        points[first] = (before, (inside @ joint.place)[:3, 3])
        points[second] = (joint.name, built.bodies[joint.name][:3, 3])
        joints.append(ElasticJoint(joint.name, (first, second), np.asarray(joint.stiffness, dtype=float)))
        links.append(Link((first - 1, first)))
        before, inside = joint.name, built.bodies[joint.name]
    tip = 2 * len(names) + 1
    points[tip] = (TOOL, np.zeros(3))
    links.append(Link((tip - 1, tip)))
    bodies = []
    for part in chain.parts:
        if part.joint == BASE:
            continue
        axes = built.bodies[part.joint]
        turn = axes[:3, :3]
        node = 2 * names.index(part.joint) + 2
        bodies.append(LumpedBody(node, part.joint, part.mass, turn @ part.centre, turn @ part.inertia @ turn.T))
    mechanism = Mechanism((*built.frames, *flange, *tool), TOOL)
    return SpatialRobot(mechanism, tuple(joints), tuple(links), tuple(bodies), points, tip, **options)
