"""The robot of a simulated campaign, its work area, and the schedule of recordings."""

import datetime
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
import scipy

from millfrf.core import HOUSING, TIP, InputError, Real
from millfrf.robot_model import (
    Mechanism,
    SpatialRobot,
    StructureModes,
    gravity_torques,
    housing_node,
    modes_at,
    structure_at,
    target_of,
    tool_down,
    tool_postures,
    with_tool_spring,
)
from modal_fit import ModalModel
from replay_data import SWEEP_IMMERSIONS

ABOUT_AXIS = 5  # index of the rotation about the joint's axis among its six motions
GRAVITY = 9.80665
# turning moments, N m, at which a gear's stiffness has left its light-load value (a gear's teeth come into mesh)
FULL_LOAD = np.array([2000.0, 9000.0, 5000.0, 300.0, 300.0, 80.0])

# standard deviations of the log errors of springs and masses in the robot file
SPRINGS_OFF, MASSES_OFF = 0.15, 0.04

# largest shares by which a joint stiffens under load and over its angle, and by which load adds to its loss
STIFFENING, WAVE, FRICTION = 0.25, 0.08, 0.6
JOINT_LOSS, LINK_LOSS = 0.09, 0.04  # loss factors: median of the joints, and of links and tool

# compliance across the tool, m/N, and the mass on it, kg: a mode of the tool near 900 Hz
TOOL_COMPLIANCE, TOOL_MASS = 3e-8, 1.0

# place of the accelerometers from the tip, m, in the base frame: they are glued to the spindle housing
SENSOR = np.array([0.06, -0.04, 0.25])

# modes up to here are simulated, Hz; the recordings hold what lies below half their sample rate
TRUE_ROBOT_HIGHEST = 1000.0

# shares of stiffness and loss that each joint loses per kelvin: grease and gears that get warm
SOFTER_PER_KELVIN, LESS_LOSS_PER_KELVIN = 1.0e-3, 8e-3
REFERENCE_TEMPERATURE = 22.0  # degrees Celsius


@dataclass(frozen=True)
class Condition:
    """State of the robot."""

    temperature: float = REFERENCE_TEMPERATURE  # degrees Celsius, of hall and gears
    joint_factors: Mapping[str, float] = field(default_factory=dict)  # on stiffness, by frame; default 1
    idle: bool = False  # no cut: joints at rest stick, so they are stiffer and less damped


IDLE_STIFFER, IDLE_LOSS = 1.03, 0.8  # factors on stiffness and loss of the joints of a robot at rest


@dataclass(frozen=True)
class TrueRobot:
    """A robot whose joints depend on angle, load and temperature."""

    robot: SpatialRobot  # kinematics, masses, links, the joints' stiffness at light load, and the tool's spring
    # (n_joints,); shares by which a joint stiffens under load and over its angle, and the angle of the wave, rad
    stiffening: Real
    wave: Real
    phase: Real
    loss: Real  # (n_joints,); loss factor of each joint, and the share that load adds to it
    friction: Real

    def joints(self, q: Real, condition: Condition) -> tuple[Real, Real]:
        """Return for each joint in a posture the factor on its stiffness at light load, and its loss factor."""
        torques = gravity_torques(self.robot, q, structure_at(self.robot, q), GRAVITY)
        load = np.tanh(np.abs(torques) / FULL_LOAD)
        wave = 1 + self.wave * np.cos(2 * q + self.phase)
        warming = condition.temperature - REFERENCE_TEMPERATURE
        joint_factors = np.array([condition.joint_factors.get(joint.frame, 1.0) for joint in self.driven_joints()])
        at_rest = (IDLE_STIFFER, IDLE_LOSS) if condition.idle else (1.0, 1.0)
        stiffness = (1 + self.stiffening * load) * wave * (1 - SOFTER_PER_KELVIN * warming) * joint_factors * at_rest[0]
        loss = self.loss * (1 + self.friction * load) * (1 - LESS_LOSS_PER_KELVIN * warming) * at_rest[1]
        return stiffness, loss

    def driven_joints(self) -> tuple:  # type: ignore[type-arg]
        """Return all joints except the spring of the tool."""
        return tuple(joint for joint in self.robot.joints if joint.frame != self.robot.mechanism.tool)

    def structure(self, q: Real, condition: Condition | None = None) -> ModalModel:
        """Compute the modal model in a posture q (rad): motions at the tip and at the housing, forces at the tip.

        The modes are real. The damping ratio of a mode is half the mean loss factor of joints and other parts, weighted
        by their shares in the energy of the mode.
        """
        stiffness, loss = self.joints(q, Condition() if condition is None else condition)
        modes = modes_at(_stiffened(self.robot, stiffness), q)
        ratios = (energy_shares(self.robot, modes) @ np.append(loss, LINK_LOSS)) / 2
        return _model(self.robot, modes, ratios)


def energy_shares(robot: SpatialRobot, modes: StructureModes) -> Real:
    """Return the share of each driven joint, and of all other parts, in the elastic energy of each mode.

    The shape is number of modes x (number of joints + 1).
    """
    shares = []
    for joint, spring in zip(robot.joints, modes.structure.springs, strict=True):
        if joint.frame == robot.mechanism.tool:
            continue
        before, after = spring.motions(modes.structure.positions)
        first, second = spring.nodes
        turned = modes.shapes[:, second] @ after[ABOUT_AXIS] - modes.shapes[:, first] @ before[ABOUT_AXIS]
        shares.append(spring.stiffness[ABOUT_AXIS] * turned**2 / modes.squares)
    of_joints = np.array(shares).T
    return np.column_stack([of_joints, np.maximum(1 - of_joints.sum(axis=1), 0.0)])


def drawn_robot(filed: SpatialRobot, generator: np.random.Generator) -> TrueRobot:
    """Draw errors of the robot file, and the dependence of joints on angle and load."""
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
    """Multiply the stiffness of the driven joints by factors; keep the spring of the tool."""
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
    housing = modes.shapes[:, housing_node(robot)]
    natural = np.sqrt(modes.squares)
    selected = (natural < 2 * np.pi * TRUE_ROBOT_HIGHEST) & (ratios < 1)
    damped = (natural * np.sqrt(1 - np.minimum(ratios, 0.99) ** 2))[selected]
    right = np.hstack([tip, housing[:, :3] + np.cross(housing[:, 3:], SENSOR)])[selected].astype(complex)
    poles = -(ratios * natural)[selected] + 1j * damped
    return ModalModel(poles, right, tip[selected] / (2j * damped[:, None]), (*TIP, *HOUSING), TIP)


LOWEST = np.array([1.1, -0.8, 0.5, 110.0])
# work area: place of the tool tip in the base frame, m, and turn about the tool, degrees; 180 leaves joint 6 at 0
WORK_AREA_HIGHEST = np.array([2.1, 0.8, 1.2, 250.0])
MARGIN = np.radians(5.0)  # rad; distance from the limits of the joints
DIGITS = 3  # decimals of the angles (degrees), as on a robot controller


def spread_postures(mechanism: Mechanism, ready: Real, count: int, generator: np.random.Generator) -> Real:
    """Return postures over the work area, each on the branch nearest to the driven joint values ``ready`` (rad).

    The positions are a scrambled Halton sequence; positions out of reach are left out.
    """
    halton = scipy.stats.qmc.Halton(len(LOWEST), rng=generator)
    postures: list[Real] = []
    for _ in range(20 * count):
        x, y, z, turn = LOWEST + (WORK_AREA_HIGHEST - LOWEST) * halton.random(1)[0]
        target = target_of(tool_down([x, y, z], float(np.radians(turn))))
        branches = [q for q in tool_postures(mechanism, target, ready) if _inside(mechanism, q)]
        if branches:
            nearest = min(branches, key=lambda q: float(np.abs(q - ready).max()))
            postures.append(np.radians(np.round(np.degrees(nearest), DIGITS)))
        if len(postures) == count:
            return np.array(postures)
    raise InputError(f"the robot reaches {len(postures)} of {count} places of the work area; ask for fewer poses")


def _inside(mechanism: Mechanism, q: Real) -> bool:
    frames = [mechanism.frames[index] for index in mechanism.moving]
    return all(frame.lower + MARGIN < value < frame.upper - MARGIN for frame, value in zip(frames, q, strict=True))


LEVEL_TEST = "porous"  # A slot in porous material at another level: its random forces are independent in one recording
FULL_LEVEL, OTHER_LEVEL = 1.0, 0.5  # depth of cut over the depth of the sweeps

# faults of broken files: see :mod:`millfrf.campaign.simulated.recordings`
FAULTS = ("truncated", "no HDF5 file", "damaged block", "clipped", "wrong posture")
FIRST_DAY = datetime.datetime(2026, 3, 2, 8, tzinfo=datetime.UTC)
DAYS_BETWEEN, MINUTES_A_POSE, MINUTES_A_RECORDING = 7, 20, 4
# degrees Celsius; range of daily means, and warming of hall and robot in eight hours
MEAN_TEMPERATURES, WARMER_BY_EVENING = (17.0, 26.0), 5.0
LEAST_POSES, LEAST_A_POSE = len(FAULTS) + 1, 6


@dataclass(frozen=True)
class PlannedRecording:
    """One recording of the campaign."""

    name: str  # of the file, without suffix
    pose: int  # from 0
    immersion: str  # one of :data:`replay_data.SWEEP_IMMERSIONS`, or :data:`LEVEL_TEST`
    session: int  # from 1
    level: float  # depth of cut over the depth of the sweeps
    temperature: float  # degrees Celsius
    recorded_at: str  # ISO 8601, UTC
    seed: int  # of noise and pores
    fault: str | None  # one of :data:`FAULTS`, or None


def pose_name(number: int) -> str:
    """Return the name of a pose by its number from 0.

    Examples
    --------
    >>> pose_name(6)
    'P07'
    """
    return f"P{number + 1:02d}"


def sessions_of(recordings: int, poses: int) -> tuple[int, int]:
    """Return the number of sessions of three immersions, and of recordings at another level, per pose.

    Examples
    --------
    >>> sessions_of(200, 20)
    (3, 1)
    """
    if poses < LEAST_POSES:
        raise InputError(f"{poses} poses are too few for {len(FAULTS)} broken files and a drift: give {LEAST_POSES}")
    per_pose, remainder = divmod(recordings, poses)
    if remainder or per_pose < LEAST_A_POSE:
        raise InputError(
            f"{recordings} recordings in {poses} poses: give a multiple of the poses, {LEAST_A_POSE} or more a pose, "
            f"for example {10 * poses}"
        )
    return divmod(per_pose, len(SWEEP_IMMERSIONS))


def drawn_schedule(
    recordings: int, poses: int, drifting: int, generator: np.random.Generator
) -> list[PlannedRecording]:
    """Draw days, orders and temperatures; assign the faults to five poses without drift."""
    sessions, others = sessions_of(recordings, poses)
    faulty = generator.choice([p for p in range(poses) if p != drifting], len(FAULTS), replace=False).tolist()
    places = {
        (pose, int(generator.integers(1, sessions + 1)), str(generator.choice(list(SWEEP_IMMERSIONS)))): fault
        for pose, fault in zip(faulty, FAULTS, strict=True)
    }
    planned: list[PlannedRecording] = []
    for session in range(1, sessions + 1):
        mean = generator.uniform(*MEAN_TEMPERATURES)
        tests = list(product(SWEEP_IMMERSIONS, [FULL_LEVEL]))
        if session == sessions:
            tests += [(LEVEL_TEST, OTHER_LEVEL)] * others
        for order, pose in enumerate(generator.permutation(poses).tolist()):
            for number, (immersion, level) in enumerate(tests):
                minutes = MINUTES_A_POSE * order + MINUTES_A_RECORDING * number
                time = FIRST_DAY + datetime.timedelta(days=DAYS_BETWEEN * (session - 1), minutes=minutes)
                again = f"_{number - len(SWEEP_IMMERSIONS) + 1}" if number > len(SWEEP_IMMERSIONS) else ""
                planned.append(
                    PlannedRecording(
                        f"{pose_name(pose)}_{immersion}_{session}{again}",
                        pose,
                        immersion,
                        session,
                        level,
                        round(mean + WARMER_BY_EVENING * minutes / 480, 1),
                        time.isoformat(timespec="seconds"),
                        int(generator.integers(1 << 31)),
                        places.get((pose, session, immersion)),
                    )
                )
    return planned
