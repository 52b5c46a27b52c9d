"""Lobes as CSV: speed in rpm, depth in m, chatter frequency in Hz, type of bifurcation, status of the limit."""

import csv
import os
from pathlib import Path

import numpy as np

from foundation import FileFormatError, InputError, writing_whole_file

from .stability_lobes import StabilityLobes

COLUMNS = ("spindle_speed_rpm", "depth_limit_m", "chatter_frequency_hz", "bifurcation", "status")
OLDER_COLUMNS = COLUMNS[:4]
"""Of files written before limits had a status; it is ``not-verified`` there."""


def write_lobes(path: str | os.PathLike[str], lobes: StabilityLobes) -> None:
    """Write one line a speed; a depth without limit is ``inf`` and its frequency empty.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    with writing_whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        rows = zip(
            lobes.spindle_speeds_rpm,
            lobes.depth_limits,
            lobes.chatter_frequencies,
            lobes.bifurcations,
            lobes.status,
            strict=True,
        )
        for rpm, depth, frequency, kind, status in rows:
            line = "" if np.isnan(frequency) else f"{frequency:.8g}"
            writer.writerow([f"{rpm:.10g}", f"{depth:.8g}", line, kind, status])


def read_lobes(path: str | os.PathLike[str]) -> StabilityLobes:
    """Read what :func:`write_lobes` wrote.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        Other columns, or a value that is no number.
    """
    if not Path(path).is_file():
        raise InputError(f"no file {path}; check the name")
    try:
        with Path(path).open(encoding="utf-8", newline="") as file:
            rows = list(csv.reader(file))
        if not rows or tuple(rows[0]) not in (COLUMNS, OLDER_COLUMNS):
            raise FileFormatError(f"{path} has columns {rows[:1]}, lobes have {', '.join(COLUMNS)}")
        columns = list(zip(*rows[1:], strict=True)) or [()] * len(COLUMNS)
        speeds = np.array([float(value) for value in columns[0]]) * 2 * np.pi / 60
        depths = np.array([float(value) for value in columns[1]])
        frequencies = np.array([float(value) if value else np.nan for value in columns[2]])
        status = tuple(columns[4]) if len(columns) > len(OLDER_COLUMNS) else ()
    except (ValueError, UnicodeDecodeError) as error:
        raise FileFormatError(f"{path} is not a table of lobes: {error}") from error
    return StabilityLobes(speeds, depths, frequencies, tuple(columns[3]), "file", status=status)
