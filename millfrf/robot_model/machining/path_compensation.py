"""Off-line compensation of tool paths for the deflection that predicted forces cause."""

import csv
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy

from millfrf.core import FileFormatError, InputError, Real, apart, warning_lines, writing_whole_file

from ..kinematics.inverse import inverse_kinematics
from ..kinematics.mechanism import posture_warnings
from ..spatial.spatial_robot import SpatialRobot, structure_at
from ..spatial.weight import NO_MASSES, Payload, counted_weight, sag_at, static_response

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
    (:func:`millfrf.robot_model.spatial.weight.static_response`). Forces are taken as given: those of a stiff machine,
    as the part should take
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
        Part of the weight that is corrected, ``all``, ``change`` or ``none``: see
        :func:`millfrf.robot_model.counted_weight`.
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
    whole[:3, :3] = scipy.spatial.transform.Rotation.from_rotvec(place[3:]).as_matrix()
    whole[:3, 3] = place[:3]
    return whole


def _sum(place: Real, small: Real) -> Real:
    """Place (position, rotation vector) after a small displacement and rotation in the base frame."""
    turned = (
        scipy.spatial.transform.Rotation.from_rotvec(small[3:])
        * scipy.spatial.transform.Rotation.from_rotvec(place[3:])
    ).as_rotvec()
    near = turned - 2 * np.pi * np.round((turned - place[3:]) @ _unit(turned) / (2 * np.pi)) * _unit(turned)
    return np.concatenate([place[:3] + small[:3], near])


def _unit(vector: Real) -> Real:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0 else np.zeros(3)


COLUMNS = ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad", "fx_n", "fy_n", "fz_n")
MOMENTS = ("mx_nm", "my_nm", "mz_nm")
"""Optional; taken as zero where they are not given."""


def read_tool_path(path: str | os.PathLike[str]) -> ToolPath:
    """Read a path: columns ``x_m`` to ``fz_n`` and, where there are moments, ``mx_nm my_nm mz_nm``.

    Lines that begin with ``#`` are passed over.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        A column missing, an entry that is not a finite number, places that look like mm or rotations like degrees.
    """
    if not Path(path).is_file():
        raise InputError(f"no file {path}; check the name")
    try:
        with Path(path).open(newline="", encoding="utf-8") as stream:
            lines = stream.readlines()
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path} is not UTF-8 text; save the path as CSV in UTF-8") from error
    notes = len(lines) - len(apart(lines)[1])
    rows = list(csv.DictReader(apart(lines)[1]))
    missing = [name for name in COLUMNS if not rows or name not in rows[0]]
    if missing:
        raise FileFormatError(f"{path} lacks the columns {', '.join(missing)}; a path has {', '.join(COLUMNS)}")
    table = np.array([_numbers(row, number, path) for number, row in enumerate(rows, notes + 2)])
    if not np.isfinite(table).all():
        raise FileFormatError(f"{path}: row {int(np.argmin(np.isfinite(table).all(axis=1))) + notes + 2} is not finite")
    large = np.abs(table).max(axis=0)
    if (large[:3] > 20).any():
        raise FileFormatError(
            f"{path}: places up to {large[:3].max():g} m; give x_m, y_m and z_m in metres, at most 20"
        )
    if (large[3:6] > 6.5).any():
        raise FileFormatError(
            f"{path}: rotations up to {large[3:6].max():g}; give rx_rad, ry_rad and rz_rad as a rotation vector in rad"
        )
    if (large[6:] > 1e6).any():
        raise FileFormatError(f"{path}: forces up to {large[6:].max():g}; give newtons and newton metres, at most 1e6")
    return ToolPath(table[:, :3], table[:, 3:6], table[:, 6:])


def _numbers(row: dict[str, str], line: int, path: object) -> list[float]:
    """One row; an empty entry is zero."""
    values = []
    for name in (*COLUMNS, *MOMENTS):
        try:
            values.append(float(row.get(name) or 0.0))
        except ValueError as error:
            raise FileFormatError(
                f"{path}: {name} = {row[name]!r} in line {line} is no number; a path holds numbers only"
            ) from error
    return values


def write_compensated_path(path: str | os.PathLike[str], result: CompensatedPath) -> None:
    """Write the corrected path, the forces, and the deviations (m) that were predicted without correction.

    ``deviation_*`` is what was corrected, ``weight_*`` the whole deflection under own weight and payload.
    Warnings stand above the headings, one ``# warning: ...`` a line.
    """
    moved = result.path
    parts = (moved.positions, moved.attitudes, moved.wrenches, result.deviations[:, :3], result.weight[:, :3])
    table = np.hstack(parts)
    names = (*COLUMNS, *MOMENTS, *(f"{what}_{axis}_m" for what in ("deviation", "weight") for axis in "xyz"))
    with writing_whole_file(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        stream.writelines(warning_lines(result.warnings))
        writer = csv.writer(stream)
        writer.writerow(names)
        writer.writerows([[f"{value:.9g}" for value in row] for row in table])
