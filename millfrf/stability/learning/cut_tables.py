"""Cuts in production read from a table, or from verdicts that ``chatter`` wrote."""

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from millfrf.core import FileFormatError, InputError, counted, read_csv

from ..chatter.verdict import read_cuts
from .production_cuts import ProductionCut

NEEDED = ("spindle_speed_rpm", "depth_m", "verdict")
OPTIONAL = ("cut", "chatter_frequency_hz", "frequency_error_hz", "start_angle_deg", "exit_angle_deg")


def read_cut_table(path: str | os.PathLike[str]) -> tuple[ProductionCut, ...]:
    """Read a table of cuts: speed, depth and verdict, and where known chatter frequency and immersion.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        Columns that are missing or not known, or a row that is no cut.
    """
    table, name = read_csv(path), Path(path).name
    missing = [column for column in NEEDED if column not in table.columns]
    unknown = [column for column in table.columns if column not in (*NEEDED, *OPTIONAL)]
    if missing or unknown:
        wrong = f"has no column {missing[0]}" if missing else f"has a column {unknown[0]!r}"
        raise FileFormatError(
            f"{name} {wrong}; a table of cuts has {', '.join(NEEDED)} and may have {', '.join(OPTIONAL)}"
        )
    cuts = []
    for number, cells in enumerate(table.rows, 1):
        row = dict(zip(table.columns, cells, strict=False))
        try:
            cuts.append(_cut(row, row.get("cut") or f"{name} row {number}"))
        except InputError as error:
            raise FileFormatError(f"{name} row {number}: {error}") from error
    return tuple(cuts)


def read_judged_cuts(path: str | os.PathLike[str], depths: Sequence[float]) -> tuple[ProductionCut, ...]:
    """Read the verdicts of ``chatter``; their depths (m) are the first of ``depths``, in their order.

    Raises
    ------
    InputError
        Fewer depths than cuts.
    FileFormatError
        No verdicts of ``chatter``.
    """
    kept = read_cuts(path)
    if len(depths) < len(kept):
        raise InputError(
            f"{Path(path).name} holds {counted(len(kept), 'cut')}, --depths {counted(len(depths), 'depth')} for it; "
            "give the depth of each in metres, in this order, such as --depths 0.001,0.002"
        )
    return tuple(ProductionCut.of(cut, float(depth)) for cut, depth in zip(kept, depths, strict=False))


def _cut(row: Mapping[str, str], name: str) -> ProductionCut:
    angles = [_number(row, column) for column in ("start_angle_deg", "exit_angle_deg")]
    if math.isnan(angles[0]) != math.isnan(angles[1]):
        raise InputError("give both start_angle_deg and exit_angle_deg, or neither")
    error = _number(row, "frequency_error_hz")
    return ProductionCut(
        name,
        _number(row, "spindle_speed_rpm") * math.pi / 30,
        _number(row, "depth_m"),
        row.get("verdict", "").strip(),
        _number(row, "chatter_frequency_hz"),
        0.0 if math.isnan(error) else error,
        None if math.isnan(angles[0]) else (math.radians(angles[0]), math.radians(angles[1])),
    )


def _number(row: Mapping[str, str], column: str) -> float:
    """Return a number of a row; NaN where the cell is empty or the column is missing."""
    text = row.get(column, "").strip()
    if not text:
        return math.nan
    try:
        return float(text)
    except ValueError as error:
        raise InputError(f"{column} = {text!r} is no number; write it with a point, such as 0.002") from error
