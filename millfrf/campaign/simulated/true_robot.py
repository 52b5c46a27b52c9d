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

TRUE_ROBOT_HIGHEST = 1000.0
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
    kept = (natural < 2 * np.pi * TRUE_ROBOT_HIGHEST) & (ratios < 1)
    damped = (natural * np.sqrt(1 - np.minimum(ratios, 0.99) ** 2))[kept]
    right = np.hstack([tip, held[:, :3] + np.cross(held[:, 3:], SENSOR)])[kept].astype(complex)
    poles = -(ratios * natural)[kept] + 1j * damped
    return ModalModel(poles, right, tip[kept] / (2j * damped[:, None]), (*TIP, *HOUSING), TIP)


LOWEST = np.array([1.1, -0.8, 0.5, 110.0])
WORK_AREA_HIGHEST = np.array([2.1, 0.8, 1.2, 250.0])
"""Work area: place of the tool tip in the base frame, m, and turn about the tool, degrees; 180 leaves joint 6 at 0."""

MARGIN = np.radians(5.0)
"""Distance that is kept from the joints' limits, rad."""

DIGITS = 3
"""Decimals of the angles, degrees, as a robot's controller shows them."""


def spread_postures(mechanism: Mechanism, ready: Real, count: int, generator: np.random.Generator) -> Real:
    """Postures over the work area, each the branch nearest to ``ready``.

    Places are a scrambled Halton sequence; those that the tool does not reach within the limits are left out.

    Parameters
    ----------
    mechanism
        Kinematics of the robot.
    ready : (n_driven,), rad
        Posture from which branches are chosen.
    count
        Number of postures.
    generator
        Random generator that scrambles the sequence.

    Returns
    -------
    (count, n_driven), rad
        Angles, whole thousandths of a degree.

    Raises
    ------
    InputError
        The robot reaches too few places of the area.
    """
    halton = scipy.stats.qmc.Halton(len(LOWEST), rng=generator)
    found: list[Real] = []
    for _ in range(20 * count):
        x, y, z, turn = LOWEST + (WORK_AREA_HIGHEST - LOWEST) * halton.random(1)[0]
        target = target_of(tool_down([x, y, z], float(np.radians(turn))))
        branches = [q for q in tool_postures(mechanism, target, ready) if _inside(mechanism, q)]
        if branches:
            nearest = min(branches, key=lambda q: float(np.abs(q - ready).max()))
            found.append(np.radians(np.round(np.degrees(nearest), DIGITS)))
        if len(found) == count:
            return np.array(found)
    raise InputError(f"the robot reaches {len(found)} of {count} places of the work area; ask for fewer poses")


def _inside(mechanism: Mechanism, q: Real) -> bool:
    frames = [mechanism.frames[index] for index in mechanism.moving]
    return all(frame.lower + MARGIN < value < frame.upper - MARGIN for frame, value in zip(frames, q, strict=True))


LEVEL_TEST = "porous"
"""A slot in porous material at another level: its random forces are independent in one recording."""

FULL_LEVEL, OTHER_LEVEL = 1.0, 0.5
"""Depth of cut over that of the sweeps."""

FAULTS = ("truncated", "no HDF5 file", "damaged block", "clipped", "wrong posture")
"""What is wrong with the broken files: see :mod:`millfrf.campaign.simulated.recordings`."""

FIRST_DAY = datetime.datetime(2026, 3, 2, 8, tzinfo=datetime.UTC)
DAYS_BETWEEN, MINUTES_A_POSE, MINUTES_A_RECORDING = 7, 20, 4
MEAN_TEMPERATURES, WARMER_BY_EVENING = (17.0, 26.0), 5.0
"""Mean of a day, degrees Celsius, and how much a hall and a robot warm up in eight hours."""

LEAST_POSES, LEAST_A_POSE = len(FAULTS) + 1, 6


@dataclass(frozen=True)
class PlannedRecording:
    """One recording of the campaign.

    Parameters
    ----------
    name
        Name of the file, without its suffix.
    pose
        Number of the pose, from 0.
    immersion
        One of :data:`replay_data.SWEEP_IMMERSIONS`, or :data:`LEVEL_TEST`.
    session
        Number of the session, from 1.
    level
        Depth of cut over that of the sweeps.
    temperature : degrees Celsius
        Temperature at the time.
    recorded_at
        Time of the recording, ISO 8601, UTC.
    seed
        Seed of noise and pores.
    fault
        One of :data:`FAULTS`, or None.
    """

    name: str
    pose: int
    immersion: str
    session: int
    level: float
    temperature: float
    recorded_at: str
    seed: int
    fault: str | None


def pose_name(number: int) -> str:
    """Name of a pose, from its number, from 0.

    Examples
    --------
    >>> pose_name(6)
    'P07'
    """
    return f"P{number + 1:02d}"


def sessions_of(recordings: int, poses: int) -> tuple[int, int]:
    """How many sessions of three immersions, and recordings at another level, each pose has.

    Raises
    ------
    InputError
        Numbers that do not divide, or too few.

    Examples
    --------
    >>> sessions_of(200, 20)
    (3, 1)
    """
    if poses < LEAST_POSES:
        raise InputError(f"{poses} poses are too few for {len(FAULTS)} broken files and a drift: give {LEAST_POSES}")
    each, rest = divmod(recordings, poses)
    if rest or each < LEAST_A_POSE:
        raise InputError(
            f"{recordings} recordings in {poses} poses: give a multiple of the poses, {LEAST_A_POSE} or more a pose, "
            f"for example {10 * poses}"
        )
    return divmod(each, len(SWEEP_IMMERSIONS))


def drawn_schedule(
    recordings: int, poses: int, drifting: int, generator: np.random.Generator
) -> list[PlannedRecording]:
    """Draw days, orders and temperatures; put the faults into five poses other than the drifting one.

    Parameters
    ----------
    recordings, poses
        Numbers of recordings and poses.
    drifting
        Number of the pose with the drift, which keeps whole files.
    generator
        Random generator that draws it all.
    """
    sessions, others = sessions_of(recordings, poses)
    spoilt = generator.choice([p for p in range(poses) if p != drifting], len(FAULTS), replace=False).tolist()
    places = {
        (pose, int(generator.integers(1, sessions + 1)), str(generator.choice(list(SWEEP_IMMERSIONS)))): fault
        for pose, fault in zip(spoilt, FAULTS, strict=True)
    }
    planned: list[PlannedRecording] = []
    for session in range(1, sessions + 1):
        mean = generator.uniform(*MEAN_TEMPERATURES)
        tests = list(product(SWEEP_IMMERSIONS, [FULL_LEVEL]))
        if session == sessions:
            tests += [(LEVEL_TEST, OTHER_LEVEL)] * others
        for turn, pose in enumerate(generator.permutation(poses).tolist()):
            for number, (immersion, level) in enumerate(tests):
                minutes = MINUTES_A_POSE * turn + MINUTES_A_RECORDING * number
                when = FIRST_DAY + datetime.timedelta(days=DAYS_BETWEEN * (session - 1), minutes=minutes)
                again = f"_{number - len(SWEEP_IMMERSIONS) + 1}" if number > len(SWEEP_IMMERSIONS) else ""
                planned.append(
                    PlannedRecording(
                        f"{pose_name(pose)}_{immersion}_{session}{again}",
                        pose,
                        immersion,
                        session,
                        level,
                        round(mean + WARMER_BY_EVENING * minutes / 480, 1),
                        when.isoformat(timespec="seconds"),
                        int(generator.integers(1 << 31)),
                        places.get((pose, session, immersion)),
                    )
                )
    return planned
