"""`TrueRobot`: the robot that is milled with, of which the robot's file knows only a part."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from millfrf.core import HOUSING, TIP
from millfrf.robot_model import (
    SpatialRobot,
    StructureModes,
    gravity_torques,
    housing_node,
    modes_at,
    structure_at,
    with_tool_spring,
)
from modal_fit import ModalModel

Real = NDArray[np.float64]

ABOUT_AXIS = 5
"""Rotation about its own axis among a joint's six motions."""

GRAVITY = 9.80665
FULL_LOAD = np.array([2000.0, 9000.0, 5000.0, 300.0, 300.0, 80.0])
"""Turning moments, N m, at which a gear's stiffness has left its light-load value (a gear's teeth come into mesh)."""

SPRINGS_OFF, MASSES_OFF = 0.15, 0.04
"""Standard deviations of the logarithms by which the file's springs and masses are wrong."""

STIFFENING, WAVE, FRICTION = 0.25, 0.08, 0.6
"""Largest shares by which a joint stiffens under load and over its angle, and by which load adds to its loss."""

JOINT_LOSS, LINK_LOSS = 0.09, 0.04
"""Loss factors: median of the joints, and of links and tool."""

TOOL_COMPLIANCE, TOOL_MASS = 3e-8, 1.0
"""Compliance across the tool, m/N, and the mass on it, kg: a mode of the tool near 900 Hz."""

SENSOR = np.array([0.06, -0.04, 0.25])
"""Place of the accelerometers from the tip, m, in the base frame: they are glued to the spindle housing."""

HIGHEST = 1000.0
"""Modes up to here are simulated, Hz; the recordings hold what lies below half their sample rate."""

SOFTER_PER_KELVIN, LESS_LOSS_PER_KELVIN = 1.0e-3, 8e-3
"""Shares of stiffness and loss that each joint loses per kelvin: grease and gears that get warm."""

REFERENCE_TEMPERATURE = 22.0
"""Degrees Celsius."""


@dataclass(frozen=True)
class Condition:
    """In what state the robot is.

    Parameters
    ----------
    temperature : degrees Celsius
        Temperature of hall and gears.
    joint_factors
        Factors on the stiffness of joints, by frame; others are as they are.
    idle
        Whether no cut is going on: joints at rest stick, so that they are stiffer and lose less.
    """

    temperature: float = REFERENCE_TEMPERATURE
    joint_factors: Mapping[str, float] = field(default_factory=dict)
    idle: bool = False


IDLE_STIFFER, IDLE_LOSS = 1.03, 0.8
"""Factors on stiffness and loss of the joints of a robot at rest."""


@dataclass(frozen=True)
class TrueRobot:
    """A robot whose joints depend on angle, load and temperature.

    Parameters
    ----------
    robot
        Kinematics, masses, links, the joints' stiffness at light load, and the tool's spring.
    stiffening, wave, phase : (n_joints,)
        Shares by which a joint stiffens under load and over its angle, and the angle of the wave, rad.
    loss, friction : (n_joints,)
        Loss factor of each joint, and the share that load adds to it.
    """

    robot: SpatialRobot
    stiffening: Real
    wave: Real
    phase: Real
    loss: Real
    friction: Real

    def joints(self, q: Real, condition: Condition) -> tuple[Real, Real]:
        """Factors on stiffness at light load, and loss factors, of each joint about a posture."""
        torques = gravity_torques(self.robot, q, structure_at(self.robot, q), GRAVITY)
        load = np.tanh(np.abs(torques) / FULL_LOAD)
        wave = 1 + self.wave * np.cos(2 * q + self.phase)
        warmer = condition.temperature - REFERENCE_TEMPERATURE
        own = np.array([condition.joint_factors.get(joint.frame, 1.0) for joint in self.driven_joints()])
        at_rest = (IDLE_STIFFER, IDLE_LOSS) if condition.idle else (1.0, 1.0)
        stiffness = (1 + self.stiffening * load) * wave * (1 - SOFTER_PER_KELVIN * warmer) * own * at_rest[0]
        loss = self.loss * (1 + self.friction * load) * (1 - LESS_LOSS_PER_KELVIN * warmer) * at_rest[1]
        return stiffness, loss

    def driven_joints(self) -> tuple:  # type: ignore[type-arg]
        """Joints that a motor drives: all but the tool's spring."""
        return tuple(joint for joint in self.robot.joints if joint.frame != self.robot.mechanism.tool)

    def structure(self, q: Real, condition: Condition | None = None) -> ModalModel:
        """Modal model about a posture q (n_driven,), rad: motion at the tip and at the housing, force at the tip.

        Modes are real; their damping ratios are half the loss factors, weighed by the share of each part in the mode's
        energy.
        """
        stiffness, loss = self.joints(q, Condition() if condition is None else condition)
        modes = modes_at(_stiffened(self.robot, stiffness), q)
        ratios = (energy_shares(self.robot, modes) @ np.append(loss, LINK_LOSS)) / 2
        return _model(self.robot, modes, ratios)


def energy_shares(robot: SpatialRobot, modes: StructureModes) -> Real:
    """Share of each driven joint in the elastic energy of each mode, and last of all else, (n_modes, n_joints + 1)."""
    shares = []
    for joint, spring in zip(robot.joints, modes.structure.springs, strict=True):
        if joint.frame == robot.mechanism.tool:
            continue
        before, after = spring.motions(modes.structure.positions)
        first, second = spring.nodes
        turned = modes.shapes[:, second] @ after[ABOUT_AXIS] - modes.shapes[:, first] @ before[ABOUT_AXIS]
        shares.append(spring.stiffness[ABOUT_AXIS] * turned**2 / modes.squares)
    own = np.array(shares).T
    return np.column_stack([own, np.maximum(1 - own.sum(axis=1), 0.0)])


def drawn_robot(filed: SpatialRobot, generator: np.random.Generator) -> TrueRobot:
    """Draw what a robot's file does not know: its errors, and how joints depend on angle and load.

    Parameters
    ----------
    filed
        Robot as its file describes it.
    generator
        Random generator that draws it all.
    """
    count = len(filed.joints)
    bodies = tuple(
        replace(body, mass=body.mass * factor, inertia=body.inertia * factor)
        for body, factor in zip(filed.bodies, np.exp(generator.normal(0, MASSES_OFF, len(filed.bodies))), strict=True)
    )
    softer = _stiffened(replace(filed, bodies=bodies), np.exp(generator.normal(0, SPRINGS_OFF, count)))
    return TrueRobot(
        with_tool_spring(softer, TOOL_COMPLIANCE, 0.3 * TOOL_COMPLIANCE, TOOL_MASS),
        generator.uniform(0.0, STIFFENING, count),
        generator.uniform(0.0, WAVE, count),
        generator.uniform(0.0, 2 * np.pi, count),
        JOINT_LOSS * np.exp(generator.normal(0, 0.25, count)),
        generator.uniform(0.0, FRICTION, count),
    )


def _stiffened(robot: SpatialRobot, factors: Real) -> SpatialRobot:
    """The robot with factors on the stiffness of its driven joints; a spring of the tool stays."""
    driven = [joint for joint in robot.joints if joint.frame != robot.mechanism.tool]
    scaled = {joint.frame: float(factor) for joint, factor in zip(driven, factors, strict=True)}
    joints = tuple(
        replace(joint, stiffness=np.append(joint.stiffness[:ABOUT_AXIS], joint.stiffness[ABOUT_AXIS] * factor))
        if (factor := scaled.get(joint.frame)) is not None
        else joint
        for joint in robot.joints
    )
    return replace(robot, joints=joints)


def _model(robot: SpatialRobot, modes: StructureModes, ratios: Real) -> ModalModel:
    tip = modes.shapes[:, modes.structure.tip, :3]
    held = modes.shapes[:, housing_node(robot)]
    natural = np.sqrt(modes.squares)
    kept = (natural < 2 * np.pi * HIGHEST) & (ratios < 1)
    damped = (natural * np.sqrt(1 - np.minimum(ratios, 0.99) ** 2))[kept]
    right = np.hstack([tip, held[:, :3] + np.cross(held[:, 3:], SENSOR)])[kept].astype(complex)
    poles = -(ratios * natural)[kept] + 1j * damped
    return ModalModel(poles, right, tip[kept] / (2j * damped[:, None]), (*TIP, *HOUSING), TIP)
