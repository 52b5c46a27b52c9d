"""Tool paths as CSV: place, attitude and force in, corrected path out."""

import csv
import os
from pathlib import Path

import numpy as np

from foundation import FileFormatError, InputError, writing_whole_file

from .path_compensation import CompensatedPath, ToolPath

COLUMNS = ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad", "fx_n", "fy_n", "fz_n")
MOMENTS = ("mx_nm", "my_nm", "mz_nm")
"""Optional; taken as zero where they are not given."""


def read_tool_path(path: str | os.PathLike[str]) -> ToolPath:
    """Read a path with the columns ``x_m ... fz_n`` and, optionally, ``mx_nm my_nm mz_nm``.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        A column missing, or an entry that is not a finite number.
    """
    if not Path(path).is_file():
        raise InputError(f"no file {path}; check the name")
    with Path(path).open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    missing = [name for name in COLUMNS if not rows or name not in rows[0]]
    if missing:
        raise FileFormatError(f"{path} lacks the columns {', '.join(missing)}; a path has {', '.join(COLUMNS)}")
    try:
        table = np.array([[float(row.get(name) or 0.0) for name in (*COLUMNS, *MOMENTS)] for row in rows])
    except ValueError as error:
        raise FileFormatError(f"{path}: {error}; a path holds numbers only") from error
    if not np.isfinite(table).all():
        raise FileFormatError(f"{path}: row {int(np.argmin(np.isfinite(table).all(axis=1))) + 2} is not finite")
    return ToolPath(table[:, :3], table[:, 3:6], table[:, 6:])


def write_compensated_path(path: str | os.PathLike[str], result: CompensatedPath) -> None:
    """Write the corrected path, the forces, and the deviation (m) that was predicted without correction."""
    moved = result.path
    table = np.hstack([moved.positions, moved.attitudes, moved.wrenches, result.deviations[:, :3]])
    names = (*COLUMNS, *MOMENTS, "deviation_x_m", "deviation_y_m", "deviation_z_m")
    with writing_whole_file(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(names)
        writer.writerows([[f"{value:.9g}" for value in row] for row in table])
