"""Off-line compensation: a path moved against the deflection that predicted forces cause."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from foundation import InputError

from ..kinematics.damped_least_squares import inverse_kinematics
from ..kinematics.loop_closure import posture_warnings
from ..spatial.spatial_robot import SpatialRobot, structure_at
from ..spatial.weight import NO_MASSES, Payload, counted_weight, sag_at, static_response

Real = NDArray[np.float64]

NO_PAYLOAD = Payload()

_SHOWN = 5
"""Warnings that are told one by one."""

_SETTLED = 1e-9
"""Change of the corrected place at which the correction has settled, m and rad."""


@dataclass(frozen=True)
class ToolPath:
    """Places of the tool on a path, with the forces expected there.

    Parameters
    ----------
    positions : (n, 3), m
        Positions of the tool in the base frame.
    attitudes : (n, 3), rad
        Rotation vectors of the tool frame.
    wrenches : (n, 6), N and N m
        Forces and moments on the tool, in the base frame.
    """

    positions: Real
    attitudes: Real
    wrenches: Real


@dataclass(frozen=True)
class CompensatedPath:
    """A corrected path, and the deviations predicted with and without the correction.

    Parameters
    ----------
    path
        The corrected path, to be sent to the controller.
    deviations : (n, 6), m and rad
        Deviation of the tool on the uncorrected path.
    weight : (n, 6), m and rad
        Whole deflection under own weight (where it is known) and payload on the uncorrected path; ``deviations`` holds
        the part of it that was asked for.
    left : (n, 6), m and rad
        Predicted deviation from the nominal path after correction.
    q : (n, n_moving), rad or m
        Joint values on the corrected path.
    warnings
        Doubts about limits, singularities and missing data of the robot's file: one sentence each.
    """

    path: ToolPath
    deviations: Real
    weight: Real
    left: Real
    q: Real
    warnings: tuple[str, ...] = ()


def compensate_path(
    robot: SpatialRobot,
    path: ToolPath,
    start: Real,
    *,
    rounds: int = 4,
    payload: Payload = NO_PAYLOAD,
    weight: str = "all",
) -> CompensatedPath:
    """Correct a path by ``x_c = x - delta(x_c)``, found by repetition (Belchior et al. 2013, section 5, one round).

    ``delta = C (F + F_payload) + sag``: the forces of the path, the weight of the payload and the robot's own weight
    (:func:`robot_model.static_response`). Forces are taken as given: those of a stiff machine, as the part should take
    them when it is formed rightly.

    Parameters
    ----------
    robot
        Robot with its structure and masses.
    path
        Nominal path with the forces on it.
    start : (n_active,), rad or m
        Driven joint values near the first place.
    rounds
        Largest number of repetitions; compliance changes slowly, so two or three settle.
    payload
        Load that the robot carries besides the bodies of its file.
    weight
        Part of the weight that is corrected, ``all``, ``change`` or ``none``: see :func:`robot_model.counted_weight`.
        With ``change`` the correction of the first place is that of its force alone.

    Raises
    ------
    InputError
        Columns of unequal length, a place that is not reached, or another word for the weight.
    """
    counted_weight(np.zeros((0, 6)), weight)
    n = len(path.positions)
    if path.positions.shape != (n, 3) or path.attitudes.shape != (n, 3) or path.wrenches.shape != (n, 6):
        raise InputError(
            f"path: positions {path.positions.shape}, attitudes {path.attitudes.shape} and wrenches "
            f"{path.wrenches.shape} must be (n, 3), (n, 3) and (n, 6)"
        )
    active = robot.mechanism.active
    nominal = np.hstack([path.positions, path.attitudes])
    corrected, first, left, postures = nominal.copy(), np.zeros((n, 6)), np.zeros((n, 6)), []
    sags = np.zeros((n, 6))
    doubts: dict[str, int] = {} if robot.bodies or weight == "none" else {NO_MASSES: 0}
    for i in range(n):
        driven = start
        for turn in range(rounds):
            q = inverse_kinematics(robot.mechanism, _matrix(corrected[i]), driven)
            driven = q[active]
            static = static_response(robot, structure_at(robot, q))
            sag = sag_at(robot, q, static, payload)
            if turn == 0:
                sags[i] = sag
                for doubt in posture_warnings(robot.mechanism, q):
                    doubts.setdefault(f"row {i + 2} of the path: {doubt}", i)
            reference = sags[0] if weight == "change" else np.zeros(6)
            deflection = static.compliance @ path.wrenches[i] + (0 if weight == "none" else sag - reference)
            if turn == 0:
                first[i] = deflection
            left[i] = _sum(corrected[i], deflection) - nominal[i]
            if np.abs(left[i]).max() < _SETTLED or turn == rounds - 1:
                break
            corrected[i] = _sum(nominal[i], -deflection)
        start = driven
        postures.append(q)
    moved = ToolPath(corrected[:, :3], corrected[:, 3:], path.wrenches)
    return CompensatedPath(moved, first, sags, left, np.array(postures).reshape(n, len(active)), _few(doubts))


def _few(doubts: dict[str, int]) -> tuple[str, ...]:
    """The first sentences, and how many more there are."""
    lines = tuple(doubts)
    return lines if len(lines) <= _SHOWN else (*lines[:_SHOWN], f"and {len(lines) - _SHOWN} more warnings like these")


def _matrix(place: Real) -> Real:
    whole = np.eye(4)
    whole[:3, :3] = Rotation.from_rotvec(place[3:]).as_matrix()
    whole[:3, 3] = place[:3]
    return whole


def _sum(place: Real, small: Real) -> Real:
    """Place (position, rotation vector) after a small displacement and rotation in the base frame."""
    turned = (Rotation.from_rotvec(small[3:]) * Rotation.from_rotvec(place[3:])).as_rotvec()
    near = turned - 2 * np.pi * np.round((turned - place[3:]) @ _unit(turned) / (2 * np.pi)) * _unit(turned)
    return np.concatenate([place[:3] + small[:3], near])


def _unit(vector: Real) -> Real:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0 else np.zeros(3)
