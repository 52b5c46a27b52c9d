"""Weight as a load: how far the tool sinks under the robot's own weight and under what it carries."""

from dataclasses import dataclass

import numpy as np

from millfrf.core import InputError, Real

from ..finite_elements.statics import STANDARD_GRAVITY, constrained_system
from ..finite_elements.structure import Structure, mass_matrix
from ..kinematics.mechanism import Mechanism
from .spatial_robot import SpatialRobot

WEIGHTS = ("all", "change", "none")
"""Which part of the weight's deflection counts as deviation: see :func:`counted_weight`."""

NO_MASSES = (
    "the robot's file gives no [[bodies]]: the deflection under its own weight cannot be told and is left out "
    "(0.3 to 1.4 mm is usual for a heavy robot)"
)


@dataclass(frozen=True)
class Payload:
    """Load that the robot carries besides the bodies of its file: a tool, a spindle, a workpiece.

    Parameters
    ----------
    mass : kg
        Mass of the payload.
    centre : (3,), m
        Centre of mass from the tool tip, in the tool frame.

    Raises
    ------
    InputError
        A mass below 0 or above 10 t, or a centre more than 5 m from the tip.
    """

    mass: float = 0.0
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if not 0 <= self.mass <= 1e4:
            raise InputError(f"payload {self.mass!r} kg: give a mass from 0 to 10000 kg")
        if not all(abs(value) <= 5 for value in self.centre):
            raise InputError(f"payload at {self.centre} m from the tip: give metres in the tool frame, at most 5")


@dataclass(frozen=True)
class StaticResponse:
    """Static compliance and sag of the tool in one posture, in the base frame.

    Parameters
    ----------
    compliance : (6, 6), m/N, rad/N, rad/(N m)
        Displacement and rotation of the tool over force and moment on it.
    own_weight : (6,), m and rad, or None
        Displacement and rotation of the tool under the weight of the robot's links and bodies; None: the file gives
        no bodies.
    """

    compliance: Real
    own_weight: Real | None


def static_response(robot: SpatialRobot, structure: Structure) -> StaticResponse:
    """Compute compliance and sag at the tool: ``sag = C (-g M u)``, with u a unit step of all nodes upwards.

    ``M u`` is the mass that each node carries: beams give their consistent share (with end moments, so that the sag at
    the nodes is exact), bodies theirs with the arm of their centre. The posture is that of the unloaded robot; the
    deflection is linear in the loads.

    Parameters
    ----------
    robot
        Robot; its ``gravity`` counts where it is positive, else 9.80665 m/s^2.
    structure
        Structure of the same robot at one posture.
    """
    system = constrained_system(structure)
    responses = system.tip_responses()
    compliance = responses[system.tip : system.tip + 6]
    own = responses.T @ weight_loads(robot, structure)[6:] if robot.bodies else None
    return StaticResponse((compliance + compliance.T) / 2, own)


def weight_loads(robot: SpatialRobot, structure: Structure) -> Real:
    """Force and moment of the weight at every node, N and N m, (6 n_nodes,)."""
    step = np.zeros((len(structure.positions), 6))
    step[:, :3] = robot.up
    return np.asarray(-acceleration(robot) * (mass_matrix(structure) @ step.ravel()))


def acceleration(robot: SpatialRobot) -> float:
    """Acceleration of gravity, m/s^2: the robot's own figure where it has one, else 9.80665."""
    return robot.gravity if robot.gravity > 0 else STANDARD_GRAVITY


def payload_wrench(robot: SpatialRobot, attitude: Real, payload: Payload) -> Real:
    """Force and moment of a payload's weight at the tool tip, base frame, (6,), N and N m.

    Parameters
    ----------
    attitude : (3, 3)
        Tool frame in the base frame.
    """
    force = -payload.mass * acceleration(robot) * np.asarray(robot.up)
    return np.concatenate([force, np.cross(np.asarray(attitude) @ np.asarray(payload.centre), force)])


def tool_attitude(mechanism: Mechanism, q: Real) -> Real:
    """Tool frame in the base frame, (3, 3)."""
    return np.asarray(mechanism.transforms(q)[mechanism.index(mechanism.tool), :3, :3])


def sag_at(robot: SpatialRobot, q: Real, response: StaticResponse, payload: Payload) -> Real:
    """Displacement and rotation of the tool under own weight (where it is known) and payload, (6,), m and rad."""
    carried = response.compliance @ payload_wrench(robot, tool_attitude(robot.mechanism, q), payload)
    return np.asarray(carried if response.own_weight is None else carried + response.own_weight)


def counted_weight(sags: Real, weight: str) -> Real:
    """The part of the weight's deflection that a machined part sees, (n, 6).

    ``all``: the controller knows the unloaded robot, so the whole deflection counts. ``change``: the work frame was
    touched off at the first place with the same load, so only what changes from there counts. ``none``: the controller
    makes up for weight (calibrated under load, or with a load model of its own).

    Raises
    ------
    InputError
        Another word.
    """
    if weight not in WEIGHTS:
        raise InputError(f"weight {weight!r} is none of {', '.join(WEIGHTS)}")
    if weight == "none":
        return np.zeros_like(sags)
    if weight == "change" and len(sags):
        known = sags[~np.isnan(sags).any(axis=1)]
        return np.asarray(sags - known[0]) if len(known) else sags
    return sags
