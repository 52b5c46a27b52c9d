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

from ...settings import PATH
from .state import (
    Costs,
    FrontPoint,
    Loading,
    Memory,
    Objective,
    PathState,
    ScreenedValues,
    chosen_sequence,
    distinct,
    request_at,
    screen_postures,
    state_of,
)
from .values import PathCut, values_of

Posture = tuple[Real, float, float]  # joint values, turn about the tool, turn of the table


@dataclass(frozen=True)
class PathGoal:
    """Objective, balance of ``both``, and largest joint and table steps (rad, m) between points."""

    objective: Objective
    balance: float
    joint_step: float
    table_step: float


@dataclass(frozen=True)
class PathJob:
    """Robot and cut, path, forces and objective, with the values certified so far."""

    cut: PathCut
    path: CutPath
    loading: Loading
    goal: PathGoal
    pool: Executor | None  # None: this process
    memory: Memory  # certified values by point and posture
    screening_frequency: float  # Hz; highest mode while screening; certified values have the modes of ``cut``

    def state(self, free: Redundancy, postures: list[Posture]) -> PathState:
        """Certify one posture for each point."""
        return state_of(self.cut, self.path, free, self.loading, postures, self.pool, self.memory)

    def worth(self, depth: Real, deviation: Real, against: tuple[float, float]) -> float:
        """Merit of a sequence from depths and deviations (m) at points; larger is better.

        For ``both``, depth and stiffness relative to ``against``: smallest depth and largest deviation, m.
        """
        deep, stiff = float(depth.min()), 1 / max(float(deviation.max()), 1e-12)
        if self.goal.objective != "both":
            return deep if self.goal.objective == "depth" else stiff
        balance = self.goal.balance
        return balance * deep / max(against[0], 1e-9) + (1 - balance) * stiff * against[1]


@dataclass(frozen=True)
class FoundSequence:
    """Sequence that a search found."""

    postures: list[Posture]  # one for each point
    depth: Real  # (n,), m; certified at some points, interpolated at others
    deviation: Real  # (n,), m; as depth
    front: tuple[FrontPoint, ...]  # for the objective ``both``
    note: str  # sentence on the search
    evaluated: int  # number of postures that were screened


def search_sequence(job: PathJob, free: Sequence[Redundancy], postures: Sequence[PointPostures]) -> FoundSequence:
    """Screen, search, and certify every fourth point, until certified values confirm those of the search.

    Screening takes straight edges at equal pitch, which have the same mean force, and perhaps fewer modes; certified
    values are those of the whole process.
    """
    process = replace(job.cut.process, helix_angle=0.0, pitch_angles=(), process_damping=0.0)
    plain = replace(job.cut, process=process, highest_frequency=job.screening_frequency)
    values, count = screen_postures(plain, job.path, free, postures, job.loading, job.pool)
    which = [distinct(point) for point in postures]
    reference = values[0].weight.mean(axis=0) if job.loading.weight == "change" else np.zeros(6)
    searches, confirmed = 0, False
    while not confirmed and searches < PATH.searches:
        searches += 1
        costs = _costs(job, values, which, postures, reference)
        sequence, front = chosen_sequence(costs, job.goal.objective, job.goal.balance)
        depth, moved = (
            np.array([float(column[i]) for column, i in zip(columns, sequence.chosen, strict=True)])
            for columns in (costs.depth, costs.deviation)
        )
        chosen = [(p.q[i], float(p.tool[i]), float(p.table[i])) for p, i in zip(postures, sequence.chosen, strict=True)]
        at = sorted(
            {*range(0, len(chosen), PATH.certified_every), len(chosen) - 1, int(depth.argmin()), int(moved.argmax())}
        )
        confirmed = _corrected(job, free, values, which, sequence.chosen, chosen, at, depth)
        if job.loading.weight == "change":
            # the deviation is relative to the first posture: a new one there changes every deviation
            confirmed &= bool(np.abs(values[0].weight[which[0][sequence.chosen[0]]] - reference).max() < 1e-6)
            reference = values[0].weight[which[0][sequence.chosen[0]]].copy()
    note = f"{count} postures screened, {searches} {'search' if searches == 1 else 'searches'}"
    return FoundSequence(chosen, depth, moved, front, note, count)


def _corrected(
    job: PathJob,
    free: Sequence[Redundancy],
    values: Sequence[ScreenedValues],
    which: Sequence[Index],
    nodes: Index,
    chosen: list[Posture],
    at: list[int],
    depth: Real,
) -> bool:
    """Replace the values of the chosen postures at some points by certified values.

    Return whether the certified values confirm the depth.
    """
    keys = {k: (k, np.round(chosen[k][0], 9).tobytes()) for k in at}
    new = [k for k in at if keys[k] not in job.memory]
    requests = [request_at(job.path, free[k], job.loading, k, chosen[k]) for k in new]
    fresh = values_of(job.cut, requests, job.pool)
    job.memory.update({keys[k]: row for k, row in zip(new, fresh.rows(), strict=True)})
    confirmed = True
    for k in at:
        row = job.memory[keys[k]]
        proven = min(0.0 if np.isnan(row[0]) else row[0], job.cut.max_depth)
        place = which[k][nodes[k]]
        values[k].depth[place], values[k].cut[place], values[k].weight[place] = proven, row[5], row[6]
        confirmed &= proven >= (1 - PATH.largest_miss) * float(depth.min())
    return confirmed


def _costs(
    job: PathJob,
    values: Sequence[ScreenedValues],
    which: Sequence[Index],
    postures: Sequence[PointPostures],
    reference: Real,
) -> Costs:
    moved = []
    for point in values:
        counts = counted_weight(point.weight, "none" if job.loading.weight == "none" else "all")
        moved.append(np.linalg.norm((point.cut + counts - reference)[:, :3], axis=1))
    goal = job.goal
    return Costs(
        [point.depth[at] for point, at in zip(values, which, strict=True)],
        [size[at] for size, at in zip(moved, which, strict=True)],
        [np.column_stack([point.q / goal.joint_step, point.table / goal.table_step]) for point in postures],
        [PATH.turning_cost * (point.tool**2 + point.table**2) for point in postures],
    )


_OFFSETS = np.array([-0.5, -0.25, 0.0, 0.25, 0.5])


def finer_postures(
    job: PathJob, free: Redundancy, chosen: list[Posture]
) -> tuple[list[Redundancy], list[PointPostures]]:
    """Angles at quarters of a step about the chosen sequence, and the postures on its branch at these angles."""
    steps = [float(np.diff(axis)[0]) if len(axis) > 1 else 0.0 for axis in (free.tool, free.table)]
    reach = max(job.goal.joint_step, 1.5 * max(steps))
    robot, finer, postures = job.cut.robot, [], []
    for place, (q, tool, table) in zip(job.path.places, chosen, strict=True):
        angles = (_in_range(tool + steps[0] * _OFFSETS, free.tool), _in_range(table + steps[1] * _OFFSETS, free.table))
        near_angles = replace(free, tool=np.unique(angles[0]), table=np.unique(angles[1]))
        every = point_postures(robot, place, near_angles, [q[robot.mechanism.active]])
        near = np.abs(every.q - q).max(axis=1) < reach if len(every) else np.zeros(0, dtype=bool)
        finer.append(near_angles)
        postures.append(PointPostures(*(getattr(every, field.name)[near] for field in fields(every))))
    return finer, postures


def smoothed_sequence(job: PathJob, free: Redundancy, chosen: list[Posture]) -> list[Posture] | None:
    """The sequence with smooth angles, at most half a step away; None if a step or a margin is violated."""
    angles = []
    for axis, column in ((free.tool, 1), (free.table, 2)):
        half = 0.5 * float(np.diff(axis)[0]) if len(axis) > 1 else 0.0
        rough = np.unwrap(np.array([posture[column] for posture in chosen], dtype=float))
        angles.append(_in_range(np.clip(whittaker(rough), rough - half, rough + half), axis))
    postures: list[Posture] = []
    robot = job.cut.robot
    for k, place in enumerate(job.path.places):
        tool, table = float(angles[0][k]), float(angles[1][k])
        q = reached_near(robot, free.place(place, tool, table), chosen[k][0])
        if q is None or limit_margin(robot.mechanism, q) < free.limit_margin:
            return None
        if singular_values(robot.mechanism, q)[0] < free.least_singular_value:
            return None
        if k and np.abs(q - postures[-1][0]).max() > job.goal.joint_step:
            return None
        if k and abs(table - postures[-1][2]) > job.goal.table_step:
            return None
        postures.append((q, tool, table))
    return postures


def _in_range(angles: Real, axis: Real) -> Real:
    """Clip angles to the sampled range; return them unchanged if the samples cover the full circle.

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
