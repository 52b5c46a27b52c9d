"""Postures and loads of a robot as a user types them, as checked numbers."""

from dataclasses import dataclass

import numpy as np

from millfrf.core import InputError, Real
from millfrf.core.terminal import say
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
    named_posture,
    nearest_solution,
    reach,
    tool_down,
    turned_place,
    unit_doubts,
)

FURTHEST = 20.0
"""Largest coordinate of a place that is taken, m."""


@dataclass(frozen=True)
class Loads:
    """Payload, and the part of the weight's deflection that counts: ``all``, ``change`` or ``none``."""

    payload: Payload
    weight: str = "all"


def loads_of(payload: float, at: tuple[float, float, float] | None, weight: str = "all") -> Loads:
    """Options ``--payload KG``, ``--payload-at X Y Z`` and ``--weight``.

    Raises
    ------
    InputError
        A place without a mass, or numbers that no payload has.
    """
    if at is not None and not payload:
        raise InputError("--payload-at says where a payload is: give its mass too, --payload KG")
    return Loads(Payload(payload, (0.0, 0.0, 0.0) if at is None else at), weight)


def check_places(**coordinates: float) -> None:
    """Refuse coordinates that are no numbers, or that look like millimetres.

    Raises
    ------
    InputError
        With the option, the value and the remedy.
    """
    for name, value in coordinates.items():
        if not abs(value) <= FURTHEST:
            raise InputError(f"--{name} {value:g}: give metres from the robot's base, at most {FURTHEST:g}")


def check_axis(name: str, axis: tuple[float, float, int]) -> None:
    """Refuse an area's axis ``LO HI N`` that is empty, falls, or looks like millimetres.

    Raises
    ------
    InputError
        With the option, the values and the remedy.
    """
    low, high, count = axis
    for value in (low, high):
        check_places(**{name: value})
    if low > high or not 1 <= count <= 1000:
        raise InputError(f"--{name} {low:g} {high:g} {count}: give LO HI N with LO <= HI and 1 to 1000 places")


def check_near(name: str, place: tuple[float, float, float]) -> None:
    """Refuse a place at the tool that is no number, or that looks like millimetres.

    Raises
    ------
    InputError
        With the option, the values and the remedy.
    """
    if not all(abs(value) <= 5 for value in place):
        raise InputError(f"--{name} {' '.join(f'{v:g}' for v in place)}: give metres from the tool tip, at most 5")


def check_degrees(**angles: float) -> None:
    """Refuse angles that are no numbers or more than three turns.

    Raises
    ------
    InputError
        With the option, the value and the remedy.
    """
    for name, value in angles.items():
        if not abs(value) <= 1080:
            raise InputError(f"--{name} {value:g}: give degrees, at most 1080")


def check_positive(name: str, value: float, unit: str, most: float) -> None:
    """Refuse a number that is not positive, not finite or beyond what the option can mean.

    Raises
    ------
    InputError
        With the option, the value and the remedy.
    """
    if not (np.isfinite(value) and 0 < value <= most):
        raise InputError(f"--{name} {value:g}: give {unit}, above 0 and at most {most:g}")


@dataclass(frozen=True)
class Asked:
    """Options of a posture as they were typed.

    Parameters
    ----------
    pose
        Name in the robot's file, or None.
    joints
        Driven joint values, degrees (prismatic joints: metres), comma-separated, or None.
    at
        Place of a vertical tool, m, or None.
    feed
        Direction of feed in the horizontal plane from the base's x, degrees.
    turn
        Turn of the redundancy, degrees.
    redundancy
        ``tool`` or ``table``.
    """

    pose: str | None = None
    joints: str | None = None
    at: tuple[float, float, float] | None = None
    feed: float = 0.0
    turn: float = 0.0
    redundancy: str = "tool"


def posture_of(case: PlanarCase | SpatialCase, asked: Asked) -> tuple[Real, Real | None]:
    """Driven joint values, rad (prismatic joints: m), and the axes of the cut (None: the base frame).

    Raises
    ------
    InputError
        More than one way of saying it, joint values that are no numbers, or a place out of reach.
    """
    given = sum(option is not None for option in (asked.pose, asked.joints, asked.at))
    if given > 1:
        raise InputError("give the posture once: --pose NAME, --joints DEG,DEG,... or --at X Y Z")
    if asked.at is not None:
        place = cut_place(asked)
        return solve_place(spatial(case).robot, place, named_posture(case, None)), place.axes
    if asked.joints is not None:
        return _typed(case, asked.joints), None
    return named_posture(case, asked.pose), None


def mechanism_of(case: PlanarCase | SpatialCase) -> Mechanism:
    """Names, motions and units of a robot's joints, of either kind."""
    return case.mechanism if isinstance(case, PlanarCase) else case.robot.mechanism


def _typed(case: PlanarCase | SpatialCase, text: str) -> Real:
    """Joint values from ``0,-20,110,...``; a doubt about their unit is printed."""
    try:
        typed = [float(value) for value in text.split(",")]
    except ValueError as error:
        raise InputError(
            f"--joints {text!r} is not a list of degrees (prismatic joints: metres) such as 0,-20,110,0,90,0"
        ) from error
    mechanism = mechanism_of(case)
    values = driven_values(mechanism, typed)
    for doubt in unit_doubts(mechanism, typed):
        say(f"warning: {doubt}")
    return values


def cut_place(asked: Asked) -> CutPlace:
    """The place of a vertical tool, after the redundancy turned."""
    if asked.at is None:
        raise InputError("give the place of the tool tip: --at X Y Z, in metres")
    for value in asked.at:
        check_places(at=value)
    check_degrees(feed=asked.feed, turn=asked.turn)
    return turned_place(tool_down(asked.at, np.radians(asked.feed)), np.radians(asked.turn), asked.redundancy)


def solve_place(robot: SpatialRobot, place: CutPlace, start: Real) -> Real:
    """Driven joint values at a place, within the limits, as near to ``start`` as the branches allow.

    Raises
    ------
    InputError
        Out of reach; the line says how near the tool comes.
    """
    target = np.eye(4)
    target[:3, :3], target[:3, 3] = place.attitude, place.position
    return _solve(robot, target, start)


def start_of_path(robot: SpatialRobot, path: ToolPath, start: Real) -> Real:
    """Driven joint values at a path's first place, within the limits; ``start`` itself where there are none."""
    from scipy.spatial.transform import Rotation

    target = np.eye(4)
    target[:3, :3], target[:3, 3] = Rotation.from_rotvec(path.attitudes[0]).as_matrix(), path.positions[0]
    try:
        return _solve(robot, target, start)
    except InputError:
        return start


def _solve(robot: SpatialRobot, target: Real, start: Real) -> Real:
    if robot.mechanism.closures:
        q = inverse_kinematics(robot.mechanism, target, start)
        return np.asarray(q[robot.mechanism.active])
    if not has_spherical_wrist(robot.mechanism):
        return reach(robot.mechanism, target, start)
    found = nearest_solution(robot.mechanism, target, close_loops(robot.mechanism, start))
    return reach(robot.mechanism, target, start) if found is None else found


def spatial(case: PlanarCase | SpatialCase) -> SpatialCase:
    """The robot, if it is one in space.

    Raises
    ------
    InputError
        A planar one.
    """
    if isinstance(case, PlanarCase):
        raise InputError("this robot is planar; places, maps, pictures and paths need a robot in space")
    return case
