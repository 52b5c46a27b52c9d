"""Postures and loads of a robot, from the options of the steps."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from millfrf.core import InputError, Real
from millfrf.core.terminal import warn
from millfrf.robot_model import (
    CutPlace,
    Mechanism,
    Payload,
    PlanarCase,
    SpatialCase,
    SpatialRobot,
    ToolPath,
    close_loops,
    driven_values,
    has_spherical_wrist,
    inverse_kinematics,
    modes_at,
    named_posture,
    nearest_solution,
    reach,
    tool_down,
    turned_place,
    unit_warnings,
)

from ..settings import ROBOT_STEPS


@dataclass(frozen=True)
class Loads:
    """Payload, and the part of the deflection under weight that counts: ``all``, ``change`` or ``none``."""

    payload: Payload
    weight: str = "all"


def loads_of(payload: float, at: tuple[float, float, float] | None, weight: str = "all") -> Loads:
    """Loads from a mass (kg), its place from the tool tip (m) and the part of the weight that counts."""
    if at is not None and not payload:
        raise InputError("--payload-at is the place of a payload: give its mass too, --payload KG")
    return Loads(Payload(payload, (0.0, 0.0, 0.0) if at is None else at), weight)


def check_axis(name: str, axis: tuple[float, float, int]) -> None:
    """Refuse an axis ``LO HI N`` of an area that is empty, decreasing, or in millimetres."""
    low, high, count = axis
    for value in (low, high):
        if not abs(value) <= 20:
            raise InputError(f"--{name} {value:g}: give metres from the robot's base, at most 20")
    if low > high or not 1 <= count <= 1000:
        raise InputError(f"--{name} {low:g} {high:g} {count}: give LO HI N with LO <= HI and 1 to 1000 places")


def cut_place(at: tuple[float, float, float] | None, feed: float, turn: float, redundancy: str) -> CutPlace | None:
    """Place of a vertical tool whose redundancy is turned; None without a place.

    Parameters
    ----------
    at : m
        Place of the tool tip.
    feed, turn : deg
        Direction of the feed from the base's x, and turn of the redundancy.
    redundancy
        ``tool`` or ``table``.
    """
    if at is None:
        return None
    return turned_place(tool_down(at, np.radians(feed)), np.radians(turn), redundancy)


def posture_of(
    case: PlanarCase | SpatialCase,
    pose: str | None,
    joints: str | Sequence[float] | None,
    place: CutPlace | None = None,
) -> tuple[Real, Real | None]:
    """Driven joint values, rad (prismatic joints: m), and the axes of the cut (None: the base frame)."""
    if sum(option is not None for option in (pose, joints, place)) > 1:
        raise InputError("give the posture once: --pose NAME, --joints DEG,DEG,... or --at X Y Z")
    if place is not None:
        return solve_place(spatial(case).robot, place, named_posture(case, None)), place.axes
    if joints is not None:
        return _joint_values(case, joints), None
    return named_posture(case, pose), None


def driven_of(case: PlanarCase | SpatialCase, pose: str) -> Real:
    """Driven joint values of a posture's name, or of degrees (prismatic joints: metres) with commas."""
    return posture_of(case, None, pose)[0] if "," in pose else named_posture(case, pose)


def driven_of_each(case: SpatialCase, poses: str | Sequence[str], count: int, what: str) -> list[Real]:
    """Driven joint values of one posture for each of ``count`` files; ``what`` names the files in the message."""
    names = [poses] if isinstance(poses, str) else list(poses)
    if len(names) != count:
        raise InputError(f"{len(names)} postures for {count} {what}; give --pose once for each, in the same order")
    return [driven_of(case, pose) for pose in names]


def axes_turned(channels_turned: float | None) -> Real:
    """Axes of channels whose X is turned (deg) from the base's x, with Z up; None: the axes of the base."""
    if channels_turned is None:
        return np.eye(3)
    return tool_down([0.0, 0.0, 0.0], np.radians(channels_turned)).axes


def band_of_modes(robot: SpatialRobot, postures: Sequence[Real], n_modes: int) -> tuple[float, float]:
    """Band about the first ``n_modes`` modes in all postures: 0.4 times the lowest to 1.3 times the highest, Hz."""
    frequencies = [modes_at(robot, q).frequencies[:n_modes] for q in postures]
    low, high = ROBOT_STEPS.band_factors
    return low * min(float(modes[0]) for modes in frequencies), high * max(float(modes[-1]) for modes in frequencies)


def mechanism_of(case: PlanarCase | SpatialCase) -> Mechanism:
    """Names, motions and units of a robot's joints, of either kind."""
    return case.mechanism if isinstance(case, PlanarCase) else case.robot.mechanism


def _joint_values(case: PlanarCase | SpatialCase, joints: str | Sequence[float]) -> Real:
    """Convert ``0,-20,110,...`` or numbers to joint values; warn if their unit may be wrong."""
    try:
        typed = [float(value) for value in (joints.split(",") if isinstance(joints, str) else joints)]
    except ValueError as error:
        raise InputError(
            f"--joints {joints!r} is not a list of degrees (prismatic joints: metres) such as 0,-20,110,0,90,0"
        ) from error
    mechanism = mechanism_of(case)
    values = driven_values(mechanism, typed)
    warn(unit_warnings(mechanism, typed), 6)
    return values


def solve_place(robot: SpatialRobot, place: CutPlace, start: Real) -> Real:
    """Driven joint values at a place, within the limits, as near to ``start`` as the branches allow."""
    return _solve(robot, place.attitude, place.position, start)


def start_of_path(robot: SpatialRobot, path: ToolPath, start: Real) -> Real:
    """Driven joint values at the first point of a path, within the limits; ``start`` if there are none."""
    try:
        return _solve(robot, Rotation.from_rotvec(path.attitudes[0]).as_matrix(), path.positions[0], start)
    except InputError:
        return start


def _solve(robot: SpatialRobot, attitude: Real, position: Real, start: Real) -> Real:
    target = np.eye(4)
    target[:3, :3], target[:3, 3] = attitude, position
    if robot.mechanism.closures:
        q = inverse_kinematics(robot.mechanism, target, start)
        return np.asarray(q[robot.mechanism.active])
    if not has_spherical_wrist(robot.mechanism):
        return reach(robot.mechanism, target, start)
    solution = nearest_solution(robot.mechanism, target, close_loops(robot.mechanism, start))
    return reach(robot.mechanism, target, start) if solution is None else solution


def spatial(case: PlanarCase | SpatialCase) -> SpatialCase:
    """The robot, if it moves in space."""
    if isinstance(case, PlanarCase):
        raise InputError("this robot is planar; places, maps, pictures and paths need a robot in space")
    return case
