"""A search whose promise is checked: certified values take the place of interpolated ones until it chooses them."""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from millfrf.robot_model import CutPath, PointPostures, Redundancy, counted_weight

from .objectives import Costs, FrontPoint, chosen_sequence
from .path_state import Loading, Memory, PathState, request_at, state_of
from .posture_values import PathCut, values_of
from .screening import Screened, distinct, screened

Real = NDArray[np.float64]
Index = NDArray[np.int64]
Posture = tuple[Real, float, float]
"""Joint values, turn about the tool, turn of the table."""

_ROUNDS = 4
"""Searches with certified values put in place of interpolated ones."""

_EVERY = 4
"""Of so many points one is certified while the search goes on."""

_SETTLED = 0.02
"""Share of the promise that certified values may miss."""

_TURNED = 1e-3
"""Share of a node's cost that one radian squared of turning is worth: equals stay where the path puts them."""


@dataclass(frozen=True)
class Wanted:
    """What is optimised: objective, balance of ``both``, largest joint and table steps (rad, m) between points."""

    objective: str
    balance: float
    joint_step: float
    table_step: float


@dataclass(frozen=True)
class PathJob:
    """Robot and cut, path, forces and objective, with what was certified so far.

    Parameters
    ----------
    cut, path, loading, wanted
        Robot and cut, path, forces, and objective of the optimisation.
    pool
        Processes that evaluate; None: this one.
    memory
        Certified values by point and posture.
    screening_frequency : Hz
        Modes up to here are screened with; certified values have those of ``cut``.
    """

    cut: PathCut
    path: CutPath
    loading: Loading
    wanted: Wanted
    pool: Executor | None
    memory: Memory
    screening_frequency: float

    def state(self, free: Redundancy, postures: list[Posture]) -> PathState:
        """Certify one posture a point."""
        return state_of(self.cut, self.path, free, self.loading, postures, self.pool, self.memory)

    def worth(self, depth: Real, deviation: Real, against: tuple[float, float]) -> float:
        """Number that is larger for a better sequence, from depths and deviations (m) at points.

        For ``both``, depth and stiffness over those of ``against``: smallest depth and largest deviation, m.
        """
        deep, stiff = float(depth.min()), 1 / max(float(deviation.max()), 1e-12)
        if self.wanted.objective != "both":
            return deep if self.wanted.objective == "depth" else stiff
        balance = self.wanted.balance
        return balance * deep / max(against[0], 1e-9) + (1 - balance) * stiff * against[1]


@dataclass(frozen=True)
class Found:
    """Sequence that a search chose.

    Parameters
    ----------
    postures
        One posture a point.
    depth, deviation : (n,), m
        Values of the search at each point, certified at some.
    front
        Depth against deviation where both count.
    told
        One sentence on the search.
    evaluated
        Number of postures that were screened.
    """

    postures: list[Posture]
    depth: Real
    deviation: Real
    front: tuple[FrontPoint, ...]
    told: str
    evaluated: int


def searched(job: PathJob, free: Sequence[Redundancy], postures: Sequence[PointPostures]) -> Found:
    """Screen, search, and certify every fourth point until the search keeps what it promises there.

    Screening takes straight edges at equal pitch, which have the same mean force, and perhaps fewer modes; what is
    certified has the whole process.
    """
    process = replace(job.cut.process, helix_angle=0.0, pitch_angles=(), process_damping=0.0)
    plain = replace(job.cut, process=process, highest_frequency=job.screening_frequency)
    values, count = screened(plain, job.path, free, postures, job.loading, job.pool)
    which = [distinct(one) for one in postures]
    reference = values[0].weight.mean(axis=0) if job.loading.weight == "change" else np.zeros(6)
    searches, kept = 0, False
    while not kept and searches < _ROUNDS:
        searches += 1
        costs = _costs(job, values, which, postures, reference)
        sequence, front = chosen_sequence(costs, job.wanted.objective, job.wanted.balance)
        depth, moved = (
            np.array([float(column[i]) for column, i in zip(columns, sequence.chosen, strict=True)])
            for columns in (costs.depth, costs.deviation)
        )
        chosen = [(p.q[i], float(p.tool[i]), float(p.table[i])) for p, i in zip(postures, sequence.chosen, strict=True)]
        at = sorted({*range(0, len(chosen), _EVERY), len(chosen) - 1, int(depth.argmin()), int(moved.argmax())})
        kept = _corrected(job, free, values, which, sequence.chosen, chosen, at, depth)
        if job.loading.weight == "change":
            kept &= bool(np.abs(values[0].weight[which[0][sequence.chosen[0]]] - reference).max() < 1e-6)
            reference = values[0].weight[which[0][sequence.chosen[0]]].copy()
    told = f"{count} postures screened, {searches} {'search' if searches == 1 else 'searches'}"
    return Found(chosen, depth, moved, front, told, count)


def _corrected(
    job: PathJob,
    free: Sequence[Redundancy],
    values: Sequence[Screened],
    which: Sequence[Index],
    nodes: Index,
    chosen: list[Posture],
    at: list[int],
    depth: Real,
) -> bool:
    """Certify the chosen postures of some points, put them among the values; whether they keep the smallest depth."""
    keys = {k: (k, np.round(chosen[k][0], 9).tobytes()) for k in at}
    new = [k for k in at if keys[k] not in job.memory]
    requests = [request_at(job.path, free[k], job.loading, k, chosen[k]) for k in new]
    fresh = values_of(job.cut, requests, job.pool)
    job.memory.update({keys[k]: row for k, row in zip(new, fresh.rows(), strict=True)})
    kept = True
    for k in at:
        row = job.memory[keys[k]]
        proven = min(0.0 if np.isnan(row[0]) else row[0], job.cut.max_depth)
        place = which[k][nodes[k]]
        values[k].depth[place], values[k].cut[place], values[k].weight[place] = proven, row[5], row[6]
        kept &= proven >= (1 - _SETTLED) * float(depth.min())
    return kept


def _costs(
    job: PathJob,
    values: Sequence[Screened],
    which: Sequence[Index],
    postures: Sequence[PointPostures],
    reference: Real,
) -> Costs:
    moved = []
    for one in values:
        counts = counted_weight(one.weight, "none" if job.loading.weight == "none" else "all")
        moved.append(np.linalg.norm((one.cut + counts - reference)[:, :3], axis=1))
    wanted = job.wanted
    return Costs(
        [one.depth[at] for one, at in zip(values, which, strict=True)],
        [size[at] for size, at in zip(moved, which, strict=True)],
        [np.column_stack([one.q / wanted.joint_step, one.table / wanted.table_step]) for one in postures],
        [_TURNED * (one.tool**2 + one.table**2) for one in postures],
    )
