"""Tool paths as CSV: place, attitude and force in, corrected path out."""

import csv
import os
from pathlib import Path

import numpy as np

from foundation import FileFormatError, InputError, apart, warning_lines, writing_whole_file

from .path_compensation import CompensatedPath, ToolPath

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
