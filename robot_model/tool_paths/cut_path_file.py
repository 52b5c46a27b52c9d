"""Tool paths of a cut as CSV: positions with rotation vectors or with tool axes, forces where they are known."""

import csv
import os
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from foundation import FileFormatError, InputError, apart

from ..machining import MOMENTS, read_tool_path
from .places_of_cut import CutPath, attitudes_along, cut_path

POSITION, AXIS, VECTOR, FORCE = (
    ("x_m", "y_m", "z_m"),
    ("i", "j", "k"),
    ("rx_rad", "ry_rad", "rz_rad"),
    ("fx_n", "fy_n", "fz_n"),
)

MOST_POINTS = 20_000
"""Points of a path that are taken."""


def read_cut_path(path: str | os.PathLike[str]) -> CutPath:
    """Read a path with ``x_m y_m z_m`` and either ``i j k`` or ``rx_rad ry_rad rz_rad``; forces may follow.

    ``i j k`` is the tool axis of a CAM system (ISO 4343, GOTO): from the tip towards the spindle. The rotation vector
    is that of the tool frame, whose z points into the work. With ``fx_n fy_n fz_n`` the path tells its own forces.

    Raises
    ------
    InputError
        No such file, or a path without two points apart.
    FileFormatError
        A column missing or no number, units that cannot be meant, more than 20000 points.
    """
    names = _names(path)
    if all(name in names for name in (*VECTOR, *FORCE)):
        known = read_tool_path(path)
        return cut_path(known.positions, Rotation.from_rotvec(known.attitudes).as_matrix(), known.wrenches)
    tool = AXIS if all(name in names for name in AXIS) else VECTOR
    missing = [name for name in (*POSITION, *tool) if name not in names]
    if missing:
        raise FileFormatError(
            f"{path} lacks the columns {', '.join(missing)}; a path has x_m y_m z_m and i j k (tool axis, from the tip "
            "to the spindle) or rx_rad ry_rad rz_rad"
        )
    forces = FORCE if all(name in names for name in FORCE) else ()
    table = _table(path, (*POSITION, *tool, *forces, *(name for name in MOMENTS if forces and name in names)))
    if np.abs(table[:, :3]).max() > 20:
        raise FileFormatError(f"{path}: places up to {np.abs(table[:, :3]).max():g} m; give metres, at most 20")
    wrenches = None
    if forces:
        wrenches = np.zeros((len(table), 6))
        wrenches[:, : table.shape[1] - 6] = table[:, 6:]
    if tool == VECTOR:
        return cut_path(table[:, :3], Rotation.from_rotvec(table[:, 3:6]).as_matrix(), wrenches)
    sizes = np.linalg.norm(table[:, 3:6], axis=1)
    if np.abs(sizes - 1).max() > 0.01:
        raise FileFormatError(
            f"{path}: i j k has the length {sizes[np.abs(sizes - 1).argmax()]:.3g}; it is a unit vector"
        )
    return cut_path(table[:, :3], attitudes_along(-table[:, 3:6]), wrenches)


def _rows(path: str | os.PathLike[str]) -> tuple[list[dict[str, str]], int]:
    """Rows of the table, and the number of the first one's line."""
    if not Path(path).is_file():
        raise InputError(f"no file {path}; check the name")
    try:
        with Path(path).open(newline="", encoding="utf-8") as stream:
            lines = stream.readlines()
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path} is not UTF-8 text; save the path as CSV in UTF-8") from error
    kept = apart(lines)[1]
    return list(csv.DictReader(kept)), len(lines) - len(kept) + 2


def _names(path: str | os.PathLike[str]) -> tuple[str, ...]:
    rows, _ = _rows(path)
    if len(rows) < 2:
        raise FileFormatError(f"{path} has {len(rows)} rows; a path has two points or more")
    if len(rows) > MOST_POINTS:
        raise FileFormatError(f"{path} has {len(rows)} points; give at most {MOST_POINTS}, or every n-th of them")
    return tuple(name for name in rows[0] if name is not None)


def _table(path: str | os.PathLike[str], columns: tuple[str, ...]) -> np.ndarray:
    rows, first = _rows(path)
    table = np.empty((len(rows), len(columns)))
    for i, row in enumerate(rows):
        for j, name in enumerate(columns):
            try:
                table[i, j] = float(row[name])
            except (TypeError, ValueError) as error:
                raise FileFormatError(f"{path}: {name} = {row[name]!r} in line {first + i} is no number") from error
    if not np.isfinite(table).all():
        bad = int(np.argmin(np.isfinite(table).all(axis=1)))
        raise FileFormatError(f"{path}: line {first + bad} holds a number that is not finite")
    return table
