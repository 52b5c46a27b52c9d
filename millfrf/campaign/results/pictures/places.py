"""Where poses lie on a map: the place of the tool tip, or the two joints that move most, or a row of names."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError
from millfrf.robot_model import PlanarCase, close_loops, read_robot

from ..read_set import SetResults

Real = NDArray[np.float64]

LEAST_SPREAD = 1e-3
"""Range of positions (m) or joint values (rad, m) below which all poses lie on one line of a map."""


@dataclass(frozen=True)
class MapPlane:
    """Two coordinates of each pose.

    Parameters
    ----------
    places : (2,)
        Coordinates of each pose by its name.
    labels
        Labels of the two axes, with units.
    names
        Whether the axis is a row of names: no posture is known, or only one pose.
    """

    places: Mapping[str, Real]
    labels: tuple[str, str]
    names: bool = False


def tip_positions(robot: str | None, sets: Sequence[SetResults]) -> tuple[dict[str, Real], str]:
    """Position of the tool tip in the base frame of every set whose posture is known, m, (3,), by the set's name.

    Parameters
    ----------
    robot
        Name of a robot that ships, or its file, or None.
    sets
        Sets of the campaign, as read.

    Returns
    -------
    Positions, and one line that says why there are none where there should be some.
    """
    if robot is None:
        return {}, ""
    try:
        case = read_robot(robot)
        if isinstance(case, PlanarCase):
            return {}, ""
        mechanism = case.robot.mechanism
        tool = mechanism.index(mechanism.tool)
        found = {
            one.name: mechanism.transforms(close_loops(mechanism, np.array(one.measured.posture)))[tool, :3, 3]
            for one in sets
            if one.measured.posture is not None
        }
    except InputError as error:
        return {}, f"maps are not over places of the tool: {error}"
    return found, ""


def map_plane(sets: Sequence[SetResults], places: Mapping[str, Real]) -> MapPlane:
    """Choose the plane on which poses are shown.

    Parameters
    ----------
    sets
        Sets of the campaign, as read.
    places : (3,), m
        Position of the tool tip by the name of the set.
    """
    poses = sorted({one.measured.pose for one in sets})
    tips = {one.measured.pose: places[one.name] for one in sets if one.name in places}
    if len(tips) == len(poses):
        chosen = _widest(np.array([tips[pose] for pose in poses]))
        if chosen is not None:
            named = tuple(f"tool tip {'xyz'[k]} (m)" for k in chosen)
            return MapPlane({pose: tips[pose][list(chosen)] for pose in poses}, (named[0], named[1]))
    joints = {one.measured.pose: one.measured.posture for one in sets if one.measured.posture is not None}
    if len(joints) == len(poses) and len({len(one) for one in joints.values()}) == 1:
        chosen = _widest(np.array([joints[pose] for pose in poses]))
        if chosen is not None:
            values = {pose: np.array(joints[pose])[list(chosen)] for pose in poses}
            return MapPlane(values, (f"joint {chosen[0] + 1} (rad or m)", f"joint {chosen[1] + 1} (rad or m)"))
    row = {pose: np.array([float(k), 0.0]) for k, pose in enumerate(poses)}
    return MapPlane(row, ("pose", ""), names=True)


def _widest(positions: Real) -> tuple[int, int] | None:
    """Numbers of the two coordinates that vary most, in their order; None where fewer than one varies."""
    if positions.shape[1] < 2 or len(positions) < 2:
        return None
    spread = np.ptp(positions, axis=0)
    first, second = sorted(np.argsort(-spread, kind="stable")[:2].tolist())
    return (first, second) if spread.max() > LEAST_SPREAD else None
