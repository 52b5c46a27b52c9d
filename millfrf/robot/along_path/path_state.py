"""`PathState`: one posture at each point of a path and what the cut makes of it."""

from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.robot_model import CutPath, Redundancy, SpatialRobot, counted_weight, limit_margin, singular_values

from .posture_values import PathCut, PostureValues, Request, ValueRow, of_rows, values_of

Real = NDArray[np.float64]

Memory = dict[tuple[int, bytes], ValueRow]
"""Values by point and joint values."""


@dataclass(frozen=True)
class Loading:
    """Force and moment of the cut in the axes of the cut at each point, (n, 6), and which weight counts."""

    wrenches: Real
    weight: str


@dataclass(frozen=True)
class PathState:
    """A sequence of postures along a path.

    Parameters
    ----------
    tool, table : (n,), rad
        Turn of the robot about the tool and turn of the rotary table.
    q : (n, n_moving), rad and m
        Joint values; NaN where the point is not reached.
    positions : (n, 3), m
        Tip of the tool in the base frame, after the table turned.
    attitudes, axes : (n, 3, 3)
        Tool frame and axes of the cut as columns, likewise.
    values
        Depth limits and deflections; NaN where the point is not reached.
    deviation : (n, 3), m
        Deviation that the part sees: along the feed, across it (in the surface), along the tool.
    margin : (n,), rad
        Distance to the nearest joint limit.
    smallest, condition : (n,)
        Smallest singular value and condition number of the tool Jacobian.
    """

    tool: Real
    table: Real
    q: Real
    positions: Real
    attitudes: Real
    axes: Real
    values: PostureValues
    deviation: Real
    margin: Real
    smallest: Real
    condition: Real

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Whether each point is reached."""
        return np.asarray(~np.isnan(self.q).any(axis=1))

    @property
    def sizes(self) -> Real:
        """Length of the deviation, m, (n,)."""
        return np.asarray(np.linalg.norm(self.deviation, axis=1))


def request_at(
    path: CutPath, free: Redundancy, loading: Loading, point: int, posture: tuple[Real, float, float]
) -> Request:
    """What is to be evaluated at one point in one posture: joint values, tool angle, table angle."""
    q, tool, table = posture
    axes = free.place(path.places[point], tool, table).axes
    return Request(q, axes, np.kron(np.eye(2), axes) @ loading.wrenches[point])


def state_of(
    cut: PathCut,
    path: CutPath,
    free: Redundancy,
    loading: Loading,
    postures: list[tuple[Real, float, float]],
    pool: Executor | None = None,
    memory: Memory | None = None,
) -> PathState:
    """Evaluate one posture a point; rows of NaN where it is not reached.

    What ``memory`` knows of the same cut is not computed again; what is new is put there.
    """
    memory = {} if memory is None else memory
    reached = np.array([not np.isnan(q).any() for q, _, _ in postures])
    keys = {int(i): (int(i), np.round(postures[i][0], 9).tobytes()) for i in np.flatnonzero(reached)}
    new = [i for i, key in keys.items() if key not in memory]
    fresh = values_of(cut, [request_at(path, free, loading, i, postures[i]) for i in new], pool)
    memory.update({keys[i]: row for i, row in zip(new, fresh.rows(), strict=True)})
    values = of_rows([memory[key] for key in keys.values()]).over(reached)
    places = [free.place(p, tool, table) for p, (_, tool, table) in zip(path.places, postures, strict=True)]
    axes = np.array([place.axes for place in places])
    moved = values.cut + counted_weight(values.weight, loading.weight)
    deviation = np.einsum("kji,kj->ki", axes, moved[:, :3])
    q = np.array([posture[0] for posture in postures])
    margins = np.array([_margins(cut.robot, one) for one in q])
    return PathState(
        np.array([posture[1] for posture in postures]),
        np.array([posture[2] for posture in postures]),
        q,
        np.array([place.position for place in places]),
        np.array([place.attitude for place in places]),
        axes,
        values,
        deviation,
        *margins.T,
    )


def _margins(robot: SpatialRobot, q: Real) -> tuple[float, float, float]:
    if np.isnan(q).any():
        return np.nan, np.nan, np.nan
    return limit_margin(robot.mechanism, q), *singular_values(robot.mechanism, q)
