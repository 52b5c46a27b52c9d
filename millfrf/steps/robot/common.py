"""Types and bounds of the options that the robot steps share, and the writer of their tables."""

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le

from millfrf.core import warning_lines
from millfrf.core.steps import File, Reads, Typed, Writes

Robot = Annotated[File, Reads("ROBOT", str)]
Pose = Annotated[str | None, Typed("POSE")]
Joints = Annotated[str | Sequence[float] | None, Typed("V,V,...", str)]
At = Annotated[tuple[float, float, float] | None, Typed("X Y Z"), Ge(-20), Le(20)]
Degrees = Annotated[float, Typed("DEG"), Ge(-1080), Le(1080)]
Turning = Literal["tool", "table"]
Kilograms = Annotated[float, Typed("KG"), Ge(0), Le(10_000)]
NearTip = Annotated[tuple[float, float, float] | None, Typed("X Y Z"), Ge(-5), Le(5)]
Weight = Literal["all", "change", "none"]
Height = Annotated[float, Typed("M"), Ge(-20), Le(20)]
Depth = Annotated[float, Typed("M")]
Speed = Annotated[float, Typed("RPM"), Gt(0), Le(1_000_000)]
Poses = Annotated[str | Sequence[str], Typed("POSE", tuple[str, ...])]
Picture = Annotated[File | None, Writes(suffixes=(".png", ".pdf", ".svg"))]
TableFile = Annotated[File | None, Writes(suffixes=(".csv",))]


def write_csv(
    path: Path, columns: Sequence[str], rows: Iterable[Sequence[object]], warnings: Sequence[str] = ()
) -> None:
    """Write a table as CSV; warnings stand above the headings, ``# warning: ...`` on each line."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        stream.writelines(warning_lines(warnings))
        writer = csv.writer(stream)
        writer.writerow(columns)
        writer.writerows(rows)


def cell_text(value: object) -> str:
    """Cell of a CSV table: nine digits, empty if the number is not known."""
    if isinstance(value, float):
        return "" if np.isnan(value) else f"{value + 0.0:.9g}"
    return str(value)
