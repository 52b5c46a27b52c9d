"""Off-line compensation of tool paths for the deflection that predicted forces cause."""

import csv
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from millfrf.core import FileFormatError, InputError, Real, apart, write_csv

from ..kinematics.inverse import inverse_kinematics
from ..kinematics.mechanism import posture_warnings
from ..settings import ROBOT
from ..spatial.spatial_robot import SpatialRobot, structure_at
from ..spatial.weight import NO_MASSES, NO_PAYLOAD, Payload, counted_weight, static_response, weight_deflection


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
        Deflection under own weight (if it is known) and payload on the uncorrected path. ``deviations`` contains the
        part of it that is to be corrected.
    left : (n, 6), m and rad
        Predicted deviation from the nominal path after correction.
    q : (n, n_moving), rad or m
        Joint values on the corrected path.
    warnings
        Warnings about limits, singularities and missing data of the robot's file, one sentence each.
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
    """Correct a path by ``x_c = x - delta(x_c)``, solved by fixed-point iteration (Belchior et al. 2013, section 5).

    ``delta = C (F + F_payload) + d`` with the compliance C, the forces F of the path, the weight F_payload of the
    payload, and the deflection d under the robot's weight. F must be computed for a rigid machine, because the
    corrected tool cuts the nominal shape.

    Parameters
    ----------
    robot
        Robot with its structure and masses.
    path
        Nominal path with the forces on it.
    start : (n_active,), rad or m
        Driven joint values near the first place.
    rounds
        Largest number of iterations; two or three converge, because the compliance changes slowly (one in the paper).
    payload
        Load that the robot carries besides the bodies of its file.
    weight
        Part of the weight that is corrected, ``all``, ``change`` or ``none``: see
        :func:`millfrf.robot_model.counted_weight`. With ``change`` the first place is corrected for its force alone.

    Raises
    ------
    InputError
        Columns of unequal length, a place that is not reached, or an unknown part of the weight.
    """
    counted_weight(np.zeros((0, 6)), weight)  # only checks the word
    n = len(path.positions)
    if path.positions.shape != (n, 3) or path.attitudes.shape != (n, 3) or path.wrenches.shape != (n, 6):
        raise InputError(
            f"path: positions {path.positions.shape}, attitudes {path.attitudes.shape} and wrenches "
            f"{path.wrenches.shape} must be (n, 3), (n, 3) and (n, 6)"
        )
    active = robot.mechanism.active
    nominal = np.hstack([path.positions, path.attitudes])
    corrected, deviations, residual, sags = nominal.copy(), *(np.zeros((n, 6)) for _ in range(3))
    postures = np.zeros((n, len(active)))
    warnings = [] if robot.bodies or weight == "none" else [NO_MASSES]
    for i in range(n):
        driven = start
        for iteration in range(rounds):
            postures[i] = q = inverse_kinematics(robot.mechanism, _matrix(corrected[i]), driven)
            driven = q[active]
            static = static_response(robot, structure_at(robot, q))
            sag = weight_deflection(robot, q, static, payload)
            if iteration == 0:
                sags[i] = sag
                warnings += [f"row {i + 2} of the path: {text}" for text in posture_warnings(robot.mechanism, q)]
            reference = sags[0] if weight == "change" else np.zeros(6)
            deflection = static.compliance @ path.wrenches[i] + (0 if weight == "none" else sag - reference)
            if iteration == 0:
                deviations[i] = deflection
            residual[i] = _sum(corrected[i], deflection) - nominal[i]
            if np.abs(residual[i]).max() < ROBOT.corrected_error or iteration == rounds - 1:
                break
            corrected[i] = _sum(nominal[i], -deflection)
        start = driven
    corrected_path = ToolPath(corrected[:, :3], corrected[:, 3:], path.wrenches)
    return CompensatedPath(corrected_path, deviations, sags, residual, postures, _shortened(warnings))


def _shortened(warnings: list[str]) -> tuple[str, ...]:
    """Keep the first different warnings, and add the number of the warnings that were left out."""
    lines, most = tuple(dict.fromkeys(warnings)), ROBOT.path_warnings
    return lines if len(lines) <= most else (*lines[:most], f"and {len(lines) - most} more warnings like these")


def _matrix(place: Real) -> Real:
    """Convert a place (position, m, and rotation vector, rad) to a homogeneous matrix (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3] = scipy.spatial.transform.Rotation.from_rotvec(place[3:]).as_matrix()
    matrix[:3, 3] = place[:3]
    return matrix


def _sum(place: Real, small: Real) -> Real:
    """Add a small displacement and rotation in the base frame to a place (position, rotation vector)."""
    turned = (
        scipy.spatial.transform.Rotation.from_rotvec(small[3:])
        * scipy.spatial.transform.Rotation.from_rotvec(place[3:])
    ).as_rotvec()
    # whole turns are added or removed, so that the rotation vector stays near that of the place
    near = turned - 2 * np.pi * np.round((turned - place[3:]) @ _unit(turned) / (2 * np.pi)) * _unit(turned)
    return np.concatenate([place[:3] + small[:3], near])


def _unit(vector: Real) -> Real:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0 else np.zeros(3)


COLUMNS = ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad", "fx_n", "fy_n", "fz_n")
MOMENTS = ("mx_nm", "my_nm", "mz_nm")  # optional, zero by default


def read_tool_path(path: str | os.PathLike[str]) -> ToolPath:
    """Read a path with the columns ``x_m`` to ``fz_n``, and optional moments ``mx_nm my_nm mz_nm``.

    Lines that begin with ``#`` are comments. An empty cell is zero.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        A missing column, a cell that is not a finite number, places that look like mm or rotations like degrees.
    """
    rows, first = path_rows(path)
    missing = [name for name in COLUMNS if not rows or name not in rows[0]]
    if missing:
        raise FileFormatError(f"{path} lacks the columns {', '.join(missing)}; a path has {', '.join(COLUMNS)}")
    filled = [{name: row.get(name) or "0" for name in (*COLUMNS, *MOMENTS)} for row in rows]
    table = number_table(path, filled, first, (*COLUMNS, *MOMENTS))
    check_places(path, table[:, :3])
    large = np.abs(table).max(axis=0)
    if (large[3:6] > 6.5).any():  # a little more than one turn
        raise FileFormatError(
            f"{path}: rotations up to {large[3:6].max():g}; give rx_rad, ry_rad and rz_rad as a rotation vector in rad"
        )
    if (large[6:] > 1e6).any():
        raise FileFormatError(f"{path}: forces up to {large[6:].max():g}; give newtons and newton metres, at most 1e6")
    return ToolPath(table[:, :3], table[:, 3:6], table[:, 6:])


def path_rows(path: str | os.PathLike[str]) -> tuple[list[dict[str, str]], int]:
    """Read the rows of a path's CSV file; return them and the line number of the first row."""
    if not Path(path).is_file():
        raise InputError(f"no file {path}; check the name")
    try:
        with Path(path).open(newline="", encoding="utf-8") as stream:
            lines = stream.readlines()
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path} is not UTF-8 text; save the path as CSV in UTF-8") from error
    table = apart(lines)[1]
    return list(csv.DictReader(table)), len(lines) - len(table) + 2


def number_table(
    path: str | os.PathLike[str], rows: Sequence[dict[str, str]], first: int, columns: Sequence[str]
) -> Real:
    """Read the cells of some columns as finite numbers, (n_rows, n_columns); ``first`` is the line of the first row."""
    table = np.empty((len(rows), len(columns)))
    for i, row in enumerate(rows):
        for j, name in enumerate(columns):
            try:
                table[i, j] = float(row[name])
            except (TypeError, ValueError) as error:
                raise FileFormatError(
                    f"{path}: {name} = {row[name]!r} in line {first + i} is no number; a path holds numbers only"
                ) from error
            if not np.isfinite(table[i, j]):
                raise FileFormatError(
                    f"{path}: {name} = {row[name]!r} in line {first + i} is not finite; give a number"
                )
    return table


def check_places(path: str | os.PathLike[str], positions: Real) -> None:
    """Raise an error if positions (n, 3) are too large to be metres."""
    largest = np.abs(positions).max()
    if largest > ROBOT.largest_place:
        raise FileFormatError(
            f"{path}: places up to {largest:g} m; give metres in x_m, y_m and z_m, at most {ROBOT.largest_place:g}"
        )


def write_compensated_path(
    path: str | os.PathLike[str], result: CompensatedPath, provenance: Mapping[str, Any] | None = None
) -> None:
    """Write the corrected path, the forces, and the deviations (m) that are predicted without correction.

    The columns ``deviation_*`` contain the corrected part, ``weight_*`` all deflection under own weight and payload.
    """
    corrected = result.path
    parts = (corrected.positions, corrected.attitudes, corrected.wrenches)
    table = np.hstack((*parts, result.deviations[:, :3], result.weight[:, :3]))
    names = (*COLUMNS, *MOMENTS, *(f"{kind}_{axis}_m" for kind in ("deviation", "weight") for axis in "xyz"))
    write_csv(path, names, table, warnings=result.warnings, provenance=provenance)
