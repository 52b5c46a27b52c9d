"""The table of an optimised path: one row a point, before and after, in the units of a CAM engineer."""

import csv
import os
from collections.abc import Sequence

import numpy as np

from millfrf.core import warning_lines
from millfrf.robot_model import Mechanism, typed_values

from ..path_state import PathState

PLACE = ("point", "x_m", "y_m", "z_m", "i", "j", "k")
CUT = (
    "depth_limit_m",
    "status",
    "bifurcation",
    "chatter_frequency_hz",
    "lowest_frequency_hz",
    "deviation_along_m",
    "deviation_across_m",
    "deviation_axial_m",
)
POSTURE = ("limit_margin_deg", "smallest_singular_value", "jacobian_condition", "tool_turn_deg", "table_turn_deg")


def columns(n_joints: int) -> tuple[str, ...]:
    """Names of the columns: the chosen postures, then the same with ``before_`` for the path as it was given."""
    joints = tuple(f"q{i + 1}" for i in range(n_joints))
    return (*PLACE, *joints, *CUT, *POSTURE, *(f"before_{name}" for name in (*joints, *CUT, *POSTURE[:3])))


def write_path_table(
    path: str | os.PathLike[str],
    mechanism: Mechanism,
    before: PathState,
    after: PathState,
    max_depth: float,
    warnings: Sequence[str],
) -> None:
    """Write the table as CSV; warnings stand above the headings.

    ``i j k`` points from the tip to the spindle. Joint values are in degrees, prismatic ones in metres. A depth limit
    above the largest depth searched is written as that depth with the status it has and the bifurcation ``none``; an
    empty cell is a point that is not reached, or a limit that is not known.
    """
    n_joints = int(mechanism.active.sum())
    with open(path, "w", newline="", encoding="utf-8") as stream:  # noqa: PTH123
        stream.writelines(warning_lines(warnings))
        writer = csv.writer(stream)
        writer.writerow(columns(n_joints))
        for k in range(len(after.q)):
            place = [k + 1, *after.positions[k], *-after.attitudes[k][:, 2]]
            now = [*_joints(mechanism, after, k), *_cut(after, k, max_depth), *_posture(after, k)]
            then = [*_joints(mechanism, before, k), *_cut(before, k, max_depth), *_posture(before, k)[:3]]
            writer.writerow([_cell(value) for value in (*place, *now, *then)])


def _joints(mechanism: Mechanism, state: PathState, k: int) -> list[float]:
    return [float(value) for value in typed_values(mechanism, state.q[k][mechanism.active])]


def _cut(state: PathState, k: int, max_depth: float) -> list[object]:
    values = state.values
    depth = float(np.minimum(values.depth[k], max_depth))
    return [depth, values.status[k], values.kind[k], values.frequency[k], values.lowest[k], *state.deviation[k]]


def _posture(state: PathState, k: int) -> list[float]:
    angles = np.degrees([state.tool[k], state.table[k]])
    return [float(np.degrees(state.margin[k])), float(state.smallest[k]), float(state.condition[k]), *angles]


def _cell(value: object) -> str:
    if isinstance(value, float):
        return "" if np.isnan(value) else f"{value + 0.0:.9g}"
    return str(value)
