"""The tool held, the robot free to turn: postures over a redundancy angle, and what a cut makes of each."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import InputError, Real
from modal_fit import ModalModel

from ..kinematics.inverse import tool_postures
from ..spatial.spatial_modes import model_of_modes, modes_at
from ..spatial.spatial_robot import SpatialRobot

REDUNDANCIES = ("tool", "table")


@dataclass(frozen=True)
class CutPlace:
    """Position and attitude of the tool in a cut, and the axes of the cut.

    Parameters
    ----------
    position : (3,), m
        Position of the tool tip in the base frame.
    attitude : (3, 3)
        Tool frame in the base frame, as columns x, y, z; z points along the tool.
    axes : (3, 3)
        Feed, normal and axial direction of the cut as columns, in the base frame.
    """

    position: Real
    attitude: Real
    axes: Real


@dataclass(frozen=True)
class PostureMap:
    """One value of a cut for each redundancy angle, on the best branch of the inverse kinematics.

    Parameters
    ----------
    angles : (n_angles,), rad
        Redundancy angles that were tried.
    values : (n_angles,)
        Values of the criterion; NaN exactly where ``reached`` is False.
    q : (n_angles, n_moving), rad or m
        Joint values behind each value; NaN where the place is not reached.
    frequencies : (n_angles,), Hz
        Lowest natural frequency at each angle.
    reached : (n_angles,), bool
        Whether the robot reaches the place at the angle.
    """

    angles: Real
    values: Real
    q: Real
    frequencies: Real
    reached: NDArray[np.bool_]

    def best(self) -> int:
        """Index of the largest value.

        Raises
        ------
        InputError
            No angle is reached.
        """
        if not self.reached.any():
            raise InputError("no redundancy angle is reached; move the cut nearer to the robot")
        return int(np.argmax(np.where(self.reached, self.values, -np.inf)))


def posture_map(
    robot: SpatialRobot,
    place: CutPlace,
    angles: Real,
    criterion: Callable[[ModalModel], float],
    *,
    redundancy: str = "table",
    branches: str = "best",
) -> PostureMap:
    """Evaluate a criterion (a depth limit, a stiffness) over a redundancy angle.

    ``tool``: the robot turns about the tool's axis, the cut stays (first redundancy of Mousavi et al., Fig. 9).
    ``table``: tool, workpiece and cut turn together about the feed direction while the tip stays, a rotary table
    carrying the workpiece along (second redundancy, Fig. 10: theta_X7 = theta_Xw).

    Parameters
    ----------
    robot
        Robot, an open chain.
    place
        Position and attitude of the tool, and axes of the cut.
    angles : (n_angles,), rad
        Redundancy angles to try.
    criterion
        Function that takes the modal model in the axes of the cut (feed, normal, axial) and gives a number; larger is
        better.
    branches
        ``best``: the branch with the largest value; ``near``: the first branch at the first angle, then that nearest
        to the last posture, as a robot would move.

    Raises
    ------
    InputError
        An unknown redundancy or rule for branches.
    """
    if redundancy not in REDUNDANCIES or branches not in ("best", "near"):
        raise InputError(f"redundancy {redundancy!r}, branches {branches!r}: use tool or table, best or near")
    n = len(angles)
    values, q, lowest = np.full(n, np.nan), np.full((n, len(robot.mechanism.moving)), np.nan), np.full(n, np.nan)
    last: Real | None = None
    for i, angle in enumerate(angles):
        turned = turned_place(place, float(angle), redundancy)
        solutions = tool_postures(robot.mechanism, target_of(turned), last)
        if branches == "near" and len(solutions):
            if last is not None:
                solutions = solutions[[np.argmin(np.abs(solutions - last).max(axis=1))]]
            solutions = solutions[:1]
        for posture in solutions:
            modes = modes_at(robot, posture)
            value = criterion(model_of_modes(modes, robot, axes=turned.axes))
            if np.isnan(values[i]) or value > values[i]:
                values[i], q[i], lowest[i] = value, posture, modes.frequencies[0]
        last = q[i] if len(solutions) else last
    return PostureMap(np.asarray(angles, dtype=float), values, q, lowest, ~np.isnan(values))


def turned_place(place: CutPlace, angle: float, redundancy: str) -> CutPlace:
    """The place after the redundancy turned by ``angle``, rad."""
    if redundancy == "tool":
        about_tool = scipy.spatial.transform.Rotation.from_rotvec(angle * place.attitude[:, 2]).as_matrix()
        return CutPlace(place.position, about_tool @ place.attitude, place.axes)
    about_feed = scipy.spatial.transform.Rotation.from_rotvec(angle * place.axes[:, 0]).as_matrix()
    return CutPlace(place.position, about_feed @ place.attitude, about_feed @ place.axes)


def target_of(place: CutPlace) -> Real:
    """Tool frame as a homogeneous matrix, shape (4, 4)."""
    target = np.eye(4)
    target[:3, :3], target[:3, 3] = place.attitude, place.position
    return target


def tool_down(position: Sequence[float], feed: float = 0.0) -> CutPlace:
    """A vertical tool, its z downwards, that feeds in the horizontal direction ``feed`` (rad from the base's x)."""
    cosine, sine = np.cos(feed), np.sin(feed)
    axes = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    attitude = axes @ np.diag([1.0, -1.0, -1.0])
    return CutPlace(np.asarray(position, dtype=float), attitude, axes)


def frequencies_over(
    robot: SpatialRobot, places: Sequence[CutPlace], n_modes: int = 6
) -> tuple[Real, NDArray[np.bool_]]:
    """Lowest natural frequencies along places, Hz, (n_places, n_modes), and which are reached, (n_places,).

    The branch is the one nearest to the place before; NaN where not reached.
    """
    table, reached = np.full((len(places), n_modes), np.nan), np.zeros(len(places), dtype=bool)
    last: Real | None = None
    for i, place in enumerate(places):
        solutions = tool_postures(robot.mechanism, target_of(place), last)
        if not len(solutions):
            continue
        last = solutions[0] if last is None else solutions[np.argmin(np.abs(solutions - last).max(axis=1))]
        table[i], reached[i] = modes_at(robot, last).frequencies[:n_modes], True
    return table, reached
