"""What a cut makes of a posture: depth limit, chatter frequency, deflection; of many postures on several processes."""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.cutting import MillingProcess
from millfrf.robot_model import Payload, SpatialRobot, model_of_modes, modes_at, tool_deflection
from millfrf.stability import certified_lobes
from modal_fit import ModalModel

Real = NDArray[np.float64]

_SAME = 1e-7
"""Relative difference of poles and residues below which two postures have one limit."""

_CHUNK = 24
"""Postures that one process takes at a time, at most: those of one point stand together."""

ValueRow = tuple[float, float, str, str, float, Real, Real]
"""Values of one posture, in the order of the fields of :class:`PostureValues`."""


@dataclass(frozen=True)
class PathCut:
    """Robot and cut of a path.

    Parameters
    ----------
    robot
        Robot with structure and masses.
    process
        Cutter and engagement.
    speed : rad/s
        Spindle speed of the cut.
    max_depth : m
        Largest depth that is searched.
    payload
        Load besides the bodies of the robot's file.
    highest_frequency : Hz
        Natural frequency up to which modes are kept; higher ones are left as their static flexibility.
    """

    robot: SpatialRobot
    process: MillingProcess
    speed: float
    max_depth: float
    payload: Payload
    highest_frequency: float = np.inf


@dataclass(frozen=True)
class Request:
    """A posture q (n_moving,), axes of the cut (3, 3) as columns and the wrench (6,) on the tool, base frame."""

    q: Real
    axes: Real
    wrench: Real


@dataclass(frozen=True)
class PostureValues:
    """Values of n postures.

    Parameters
    ----------
    depth : (n,), m
        Depth limit; infinite above the largest depth, NaN where it is not known.
    frequency : (n,), Hz
        Chatter frequency; NaN where there is no limit.
    kind, status
        Bifurcation and worth of the limit, as in ``StabilityLobes``.
    lowest : (n,), Hz
        Lowest natural frequency.
    cut, weight : (n, 6), m and rad
        Deflection under the cut, and under own weight and payload, base frame.
    """

    depth: Real
    frequency: Real
    kind: tuple[str, ...]
    status: tuple[str, ...]
    lowest: Real
    cut: Real
    weight: Real

    def rows(self) -> list[ValueRow]:
        """One row a posture, in the order of the fields."""
        columns = (self.depth, self.frequency, self.kind, self.status, self.lowest, self.cut, self.weight)
        return list(zip(*columns, strict=True))

    def over(self, reached: NDArray[np.bool_]) -> "PostureValues":
        """The values over all places of which these were ``reached``: NaN and ``not reached`` at the others."""
        if reached.all():
            return self
        missing: ValueRow = (np.nan, np.nan, "none", "not reached", np.nan, np.full(6, np.nan), np.full(6, np.nan))
        rows = iter(self.rows())
        return of_rows([next(rows) if here else missing for here in reached])

    def known_depth(self, max_depth: float) -> Real:
        """Depth that is proven, m, (n,): at most ``max_depth``, zero where nothing is known."""
        return np.minimum(np.where(np.isnan(self.depth), 0.0, self.depth), max_depth)


def values_of(cut: PathCut, requests: Sequence[Request], pool: Executor | None = None) -> PostureValues:
    """Evaluate postures: certified limit at the path's speed, lowest frequency, deflections.

    :func:`millfrf.stability.certified_lobes` of the modal model in the axes of the cut. Postures whose poles and
    residues agree
    share one solution: on a spindle in line with the last joint, all turns about the tool.
    """
    size = max(1, min(_CHUNK, len(requests) // 4))
    parts = [list(requests[i : i + size]) for i in range(0, len(requests), size)]
    found = list((map if pool is None else pool.map)(_rows, [cut] * len(parts), parts))
    return of_rows([row for part in found for row in part])


def of_rows(rows: Sequence[ValueRow]) -> PostureValues:
    """Values from one row a posture, in the order of the fields."""
    depth, frequency, lowest = (np.array([row[i] for row in rows], dtype=float) for i in (0, 1, 4))
    moved, sag = (np.array([row[i] for row in rows]).reshape(len(rows), 6) for i in (5, 6))
    kind, status = (tuple(str(row[i]) for row in rows) for i in (2, 3))
    return PostureValues(depth, frequency, kind, status, lowest, moved, sag)


def _rows(cut: PathCut, requests: Sequence[Request]) -> list[ValueRow]:
    known: list[tuple[ModalModel, tuple[float, float, str, str]]] = []
    rows: list[ValueRow] = []
    for one in requests:
        modes = modes_at(cut.robot, one.q)
        model = model_of_modes(modes, cut.robot, axes=one.axes, highest_frequency=cut.highest_frequency)
        limit = next((limit for other, limit in known if _alike(model, other)), None)
        if limit is None:
            limit = _limit(cut, model)
            known.append((model, limit))
        moved, sag = tool_deflection(cut.robot, one.q, one.wrench, cut.payload)
        rows.append((*limit, float(modes.frequencies[0]), moved, sag))
    return rows


def _limit(cut: PathCut, model: ModalModel) -> tuple[float, float, str, str]:
    found = certified_lobes(model, cut.process, np.array([cut.speed]), cut.max_depth)
    return float(found.depth_limits[0]), float(found.chatter_frequencies[0]), found.bifurcations[0], found.status[0]


def _alike(one: ModalModel, other: ModalModel) -> bool:
    """Whether two models have the same poles and residues."""
    if len(one.poles) != len(other.poles) or not np.allclose(one.poles, other.poles, rtol=_SAME, atol=0):
        return False
    first, second = (np.einsum("rp,rq->rpq", model.right, model.left) for model in (one, other))
    return bool(np.abs(first - second).max() <= _SAME * np.abs(first).max())
