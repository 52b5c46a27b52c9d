"""Search of a sequence of postures with certified values, and its refinement."""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.linalg import solveh_banded

from millfrf.core import Index, Real
from millfrf.robot_model import (
    CutPath,
    PointPostures,
    Redundancy,
    counted_weight,
    limit_margin,
    point_postures,
    reached_near,
    singular_values,
)

from .state import (
    Costs,
    FrontPoint,
    Loading,
    Memory,
    Objective,
    PathState,
    Screened,
    chosen_sequence,
    distinct,
    request_at,
    screened,
    state_of,
)
from .values import PathCut, values_of

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

    objective: Objective
    balance: float
    joint_step: float
    table_step: float


@dataclass(frozen=True)
class PathJob:
    """Robot and cut, path, forces and objective, with the values certified so far.

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
        """Certify one posture for each point."""
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
class Searched:
    """Sequence that a search chose.

    Parameters
    ----------
    postures
        One posture for each point.
    depth, deviation : (n,), m
        Values of the search at each point, certified at some.
    front
        Depth against deviation where both count.
    note
        Sentence on the search.
    evaluated
        Number of postures that were screened.
    """

    postures: list[Posture]
    depth: Real
    deviation: Real
    front: tuple[FrontPoint, ...]
    note: str
    evaluated: int


def searched(job: PathJob, free: Sequence[Redundancy], postures: Sequence[PointPostures]) -> Searched:
    """Screen, search, and certify every fourth point until the values that the search promises there hold.

    Screening takes straight edges at equal pitch, which have the same mean force, and perhaps fewer modes; what is
    certified has the whole process.
    """
    process = replace(job.cut.process, helix_angle=0.0, pitch_angles=(), process_damping=0.0)
    plain = replace(job.cut, process=process, highest_frequency=job.screening_frequency)
    values, count = screened(plain, job.path, free, postures, job.loading, job.pool)
    which = [distinct(point) for point in postures]
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
    note = f"{count} postures screened, {searches} {'search' if searches == 1 else 'searches'}"
    return Searched(chosen, depth, moved, front, note, count)


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
    """Certify the chosen postures of some points and put their values in; whether they keep the smallest depth."""
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
    for point in values:
        counts = counted_weight(point.weight, "none" if job.loading.weight == "none" else "all")
        moved.append(np.linalg.norm((point.cut + counts - reference)[:, :3], axis=1))
    wanted = job.wanted
    return Costs(
        [point.depth[at] for point, at in zip(values, which, strict=True)],
        [size[at] for size, at in zip(moved, which, strict=True)],
        [np.column_stack([point.q / wanted.joint_step, point.table / wanted.table_step]) for point in postures],
        [_TURNED * (point.tool**2 + point.table**2) for point in postures],
    )


_OFFSETS = np.array([-0.5, -0.25, 0.0, 0.25, 0.5])


def finer_postures(
    job: PathJob, free: Redundancy, chosen: list[Posture]
) -> tuple[list[Redundancy], list[PointPostures]]:
    """Angles at quarters of a step about the sequence, and the postures of its own branch there.

    Parameters
    ----------
    free
        Angles that the sequence was chosen from.
    chosen
        One posture for each point.
    """
    steps = [float(np.diff(axis)[0]) if len(axis) > 1 else 0.0 for axis in (free.tool, free.table)]
    reach = max(job.wanted.joint_step, 1.5 * max(steps))
    robot, finer, postures = job.cut.robot, [], []
    for place, (q, tool, table) in zip(job.path.places, chosen, strict=True):
        angles = (_in_range(tool + steps[0] * _OFFSETS, free.tool), _in_range(table + steps[1] * _OFFSETS, free.table))
        here = replace(free, tool=np.unique(angles[0]), table=np.unique(angles[1]))
        every = point_postures(robot, place, here, [q[robot.mechanism.active]])
        near = np.abs(every.q - q).max(axis=1) < reach if len(every) else np.zeros(0, dtype=bool)
        finer.append(here)
        postures.append(PointPostures(*(getattr(every, field.name)[near] for field in fields(every))))
    return finer, postures


def smoothed(job: PathJob, free: Redundancy, chosen: list[Posture]) -> list[Posture] | None:
    """The sequence with smooth angles, at most half a step away; None where a step or a margin is violated."""
    angles = []
    for axis, column in ((free.tool, 1), (free.table, 2)):
        half = 0.5 * float(np.diff(axis)[0]) if len(axis) > 1 else 0.0
        given = np.unwrap(np.array([posture[column] for posture in chosen], dtype=float))
        angles.append(_in_range(np.clip(whittaker(given), given - half, given + half), axis))
    postures: list[Posture] = []
    robot = job.cut.robot
    for k, place in enumerate(job.path.places):
        tool, table = float(angles[0][k]), float(angles[1][k])
        q = reached_near(robot, free.place(place, tool, table), chosen[k][0])
        if q is None or limit_margin(robot.mechanism, q) < free.limit_margin:
            return None
        if singular_values(robot.mechanism, q)[0] < free.least_singular_value:
            return None
        if k and np.abs(q - postures[-1][0]).max() > job.wanted.joint_step:
            return None
        if k and abs(table - postures[-1][2]) > job.wanted.table_step:
            return None
        postures.append((q, tool, table))
    return postures


def _in_range(angles: Real, axis: Real) -> Real:
    """Angles inside the range that was sampled; all of them where the samples close the full circle.

    Examples
    --------
    >>> np.degrees(_in_range(np.radians([-100.0, -70.0]), np.radians([-90.0, -60.0, -30.0]))).round()
    array([-90., -70.])
    """
    step = float(np.diff(axis)[0]) if len(axis) > 1 else 0.0
    if step and np.ptp(axis) + step > 2 * np.pi - 1e-9:
        return angles
    return np.asarray(np.clip(angles, axis.min(), axis.max()))


def whittaker(values: Real, weight: float = 30.0) -> Real:
    """Smooth a sequence: ``min sum (z - y)^2 + weight sum (second difference of z)^2`` (Whittaker 1923; Eilers 2003).

    Examples
    --------
    >>> np.allclose(whittaker(np.arange(6.0)), np.arange(6.0))
    True
    """
    n = len(values)
    if n < 5:
        return np.asarray(values, dtype=float)
    rows = np.zeros((3, n))
    for offset, parts in enumerate(((1.0, 4.0, 1.0), (-2.0, -2.0), (1.0,))):
        for place, part in enumerate(parts):
            rows[offset, place : place + n - 2] += weight * part
    rows[0] += 1.0
    return np.asarray(solveh_banded(rows, values, lower=True))
