"""Types and bounds of the options that the robot steps share, and small helpers."""

from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le

from millfrf.core.steps import File, Reads, Typed, Writes

RPM = np.pi / 30
"""One revolution per minute in rad/s."""

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


def cell_text(value: object) -> str:
    """Cell of a CSV table: nine digits, empty where a number is not known."""
    if isinstance(value, float):
        return "" if np.isnan(value) else f"{value + 0.0:.9g}"
    return str(value)
