"""Lobes as CSV: speed in rpm, depth in m, chatter frequency in Hz, type of bifurcation, status of the limit.

Lines that begin with ``#`` stand above the headings: warnings, and where the lobes came from.
"""

import csv
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from foundation import FileFormatError, InputError, apart, warning_lines, writing_whole_file

from .stability_lobes import StabilityLobes

COLUMNS = ("spindle_speed_rpm", "depth_limit_m", "chatter_frequency_hz", "bifurcation", "status")
PROVENANCE = "# provenance: "
OLDER_COLUMNS = COLUMNS[:4]
"""Of files written before limits had a status; it is ``not-verified`` there."""


def write_lobes(path: str | os.PathLike[str], lobes: StabilityLobes, *, provenance: str = "") -> None:
    """Write one line a speed; a depth without limit is ``inf`` and its frequency empty.

    Parameters
    ----------
    path
        Lobes file to write, CSV.
    lobes
        Limits to write; their warnings are written above the headings, one ``# warning: ...`` a line.
    provenance
        Sources and versions as JSON without line breaks, written as ``# provenance: ...``; empty: none.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    with writing_whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        file.writelines(warning_lines(lobes.warnings))
        file.writelines([f"{PROVENANCE}{provenance}\n"] if provenance else [])
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
        Other columns, a value that is no number, or a speed or depth that is not positive.
    """
    if not Path(path).is_file():
        raise InputError(f"no file {path}; check the name")
    try:
        with Path(path).open(encoding="utf-8", newline="") as file:
            warnings, lines = apart(file)
        rows = list(csv.reader(lines))
        if not rows or tuple(rows[0]) not in (COLUMNS, OLDER_COLUMNS):
            raise FileFormatError(
                f"{path} has columns {rows[:1]}, lobes have {', '.join(COLUMNS)}; give a file that lobes wrote"
            )
    except (UnicodeDecodeError, csv.Error) as error:
        raise FileFormatError(f"{path} is not a table of lobes: it is no text; give a file that lobes wrote") from error
    try:
        return _lobes(rows, warnings)
    except InputError as error:
        raise FileFormatError(f"{path} is not a table of lobes: {error}") from error


def _lobes(rows: list[list[str]], warnings: tuple[str, ...]) -> StabilityLobes:
    for number, row in enumerate(rows[1:], 1):
        if len(row) != len(rows[0]):
            raise InputError(f"row {number} has {len(row)} entries, not {len(rows[0])}; write the lobes anew")
    columns = list(zip(*rows[1:], strict=True)) or [()] * len(COLUMNS)
    speeds, depths, frequencies = (_numbers(columns[i], COLUMNS[i]) for i in range(3))
    for name, values in zip(COLUMNS, (speeds, depths), strict=False):
        if (values <= 0).any():
            raise InputError(f"{name} = {values[values <= 0][0]:g} must be above 0; write the lobes anew")
    status = tuple(columns[4]) if len(columns) > len(OLDER_COLUMNS) else ()
    return StabilityLobes(
        speeds * 2 * np.pi / 60, depths, frequencies, tuple(columns[3]), "file", warnings, status=status
    )


def _numbers(texts: Sequence[str], name: str) -> NDArray[np.float64]:
    """A column; an empty entry is NaN."""
    values = np.full(len(texts), np.nan)
    for i, text in enumerate(texts):
        if text:
            try:
                values[i] = float(text)
            except ValueError as error:
                raise InputError(f"{name} = {text!r} in row {i + 1} is no number; write the lobes anew") from error
    return values
