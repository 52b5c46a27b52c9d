"""Deflection of the tool under the force of a cut, own weight and a payload, in one posture."""

import numpy as np
from numpy.typing import NDArray

from ..spatial import Payload, SpatialRobot, payload_wrench, static_response, structure_at, tool_attitude

Real = NDArray[np.float64]


def tool_deflection(robot: SpatialRobot, q: Real, wrench: Real, payload: Payload) -> tuple[Real, Real]:
    """Give what the cut moves the tool by, and what weight does, each (6,), m and rad, base frame.

    ``delta = C W`` and ``C W_payload + sag`` with the static compliance C of the whole structure. Where the file gives
    no masses, own weight is left out.

    Parameters
    ----------
    robot
        Robot with its structure.
    q : (n_moving,), rad or m
        Joint values of the posture.
    wrench : (6,), N and N m
        Force and moment on the tool, base frame.
    payload
        Load besides the bodies of the file.
    """
    static = static_response(robot, structure_at(robot, q))
    weight = static.compliance @ payload_wrench(robot, tool_attitude(robot.mechanism, q), payload)
    if static.own_weight is not None:
        weight = weight + static.own_weight
    return np.asarray(static.compliance @ wrench), np.asarray(weight)
