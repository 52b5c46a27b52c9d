"""Weight as a load: displacement of the tool under the robot's own weight and under a payload."""

from dataclasses import dataclass

import numpy as np

from millfrf.core import InputError, Real

from ..finite_elements.statics import STANDARD_GRAVITY, constrained_system
from ..finite_elements.structure import Structure, mass_matrix
from ..kinematics.mechanism import Mechanism
from ..settings import ROBOT
from .spatial_robot import SpatialRobot, structure_at

WEIGHTS = ("all", "change", "none")

NO_MASSES = (
    "the robot's file gives no [[bodies]]: the deflection under its own weight is unknown and is left out "
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
        most, farthest = ROBOT.largest_payload, ROBOT.largest_payload_distance
        if not 0 <= self.mass <= most:
            raise InputError(f"payload {self.mass!r} kg: give a mass from 0 to {most:.0f} kg")
        if not all(abs(value) <= farthest for value in self.centre):
            raise InputError(
                f"payload at {self.centre} m from the tip: give metres in the tool frame, at most {farthest:g}"
            )


NO_PAYLOAD = Payload()


@dataclass(frozen=True)
class StaticResponse:
    """Static compliance at the tool and deflection of the tool under the robot's weight, in the base frame."""

    compliance: Real  # (6, 6), displacement and rotation over force and moment, m/N, rad/N, rad/(N m)
    own_weight: Real | None  # (6,), m and rad; None: the file gives no bodies


def static_response(robot: SpatialRobot, structure: Structure) -> StaticResponse:
    """Compute the compliance C at the tool, and the deflection ``C (-g M u)`` of the tool under the robot's weight.

    u moves all nodes upwards by one unit, so that ``-g M u`` is the weight at each node. Beams give consistent forces
    and end moments, which make the deflection of the nodes exact; bodies give moments by the arm of their centre.
    The posture is that of the unloaded robot; the deflection is linear in the loads.
    """
    system = constrained_system(structure)
    responses = system.tip_responses()
    compliance = responses[system.tip : system.tip + 6]
    own = responses.T @ weight_loads(robot, structure)[6:] if robot.bodies else None
    return StaticResponse((compliance + compliance.T) / 2, own)


def weight_loads(robot: SpatialRobot, structure: Structure) -> Real:
    """Compute the force and moment of the weight at every node, N and N m, (6 n_nodes,)."""
    step = np.zeros((len(structure.positions), 6))
    step[:, :3] = robot.up
    return np.asarray(-acceleration(robot) * (mass_matrix(structure) @ step.ravel()))


def acceleration(robot: SpatialRobot) -> float:
    """Return the acceleration of gravity, m/s^2: the robot's value if it is positive, otherwise the standard value."""
    return robot.gravity if robot.gravity > 0 else STANDARD_GRAVITY


def payload_wrench(robot: SpatialRobot, attitude: Real, payload: Payload) -> Real:
    """Compute force and moment of the payload's weight at the tool tip, base frame, (6,), N and N m.

    Parameters
    ----------
    attitude : (3, 3)
        Tool frame in the base frame.
    """
    force = -payload.mass * acceleration(robot) * np.asarray(robot.up)
    return np.concatenate([force, np.cross(np.asarray(attitude) @ np.asarray(payload.centre), force)])


def tool_attitude(mechanism: Mechanism, q: Real) -> Real:
    """Axes of the tool frame as columns in the base frame, (3, 3)."""
    return mechanism.tool_transform(q)[:3, :3]


def weight_deflection(robot: SpatialRobot, q: Real, response: StaticResponse, payload: Payload) -> Real:
    """Compute the displacement of the tool under the robot's weight (if known) and the payload, (6,), m and rad."""
    carried = response.compliance @ payload_wrench(robot, tool_attitude(robot.mechanism, q), payload)
    return np.asarray(carried if response.own_weight is None else carried + response.own_weight)


def tool_deflection(robot: SpatialRobot, q: Real, wrench: Real, payload: Payload) -> tuple[Real, Real]:
    """Compute the displacement of the tool by the cut and by weight, each (6,), m and rad, base frame.

    The cut causes ``C W`` with the static compliance C of the structure. Weight causes ``C W_payload`` plus the
    deflection under the robot's weight, which is left out if the file gives no masses.

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
    return np.asarray(static.compliance @ wrench), weight_deflection(robot, q, static, payload)


def counted_weight(sags: Real, weight: str) -> Real:
    """Select the part of the deflection under weight that a machined part sees, (n, 6).

    Parameters
    ----------
    sags : (n, 6), m and rad
        Deflection under weight at each place of the tool; NaN where it is unknown.
    weight
        ``all``: the controller knows the unloaded robot, so the whole deflection counts. ``change``: the work frame
        was measured at the first place with the same load, so only the change from there counts. ``none``: the
        controller compensates weight (it was calibrated under load, or has a load model of its own).

    Raises
    ------
    InputError
        Another word for the weight.
    """
    if weight not in WEIGHTS:
        raise InputError(f"weight {weight!r} is none of {', '.join(WEIGHTS)}")
    if weight == "none":
        return np.zeros_like(sags)
    if weight == "change" and len(sags):
        known = sags[~np.isnan(sags).any(axis=1)]
        return np.asarray(sags - known[0]) if len(known) else sags
    return sags
