"""The optimisation: sample, screen, search, certify what was chosen, refine, and keep the best that is certified."""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from foundation import InputError
from robot_model import CutPath, PointPostures, Redundancy, counted_weight, path_postures, point_postures, reached_near

from .number_of_modes import KeptModes, kept_modes
from .objectives import Costs, FrontPoint, chosen_sequence
from .path_state import Loading, PathState, request_at, state_of
from .posture_values import PathCut, Request
from .screening import Screened, distinct, screened

Real = NDArray[np.float64]
Index = NDArray[np.int64]

_ROUNDS = 4
"""Searches with certified values put in place of interpolated ones."""

_TURNED = 1e-3
"""Share of a node's cost that one radian squared of turning is worth: equals stay where the path puts them."""

_WORSE = 0.01
"""Share of the objective that may be given up for a smooth sequence."""


@dataclass(frozen=True)
class Wanted:
    """What is optimised: objective, balance of ``both``, largest joint and table steps (rad, m) between points."""

    objective: str
    balance: float
    joint_step: float
    table_step: float


@dataclass(frozen=True)
class PathOptimum:
    """Result of the optimisation.

    Parameters
    ----------
    before, after
        Postures without turning the redundancy, and those chosen.
    front
        Depth against deviation where both count.
    kept
        Modes that were kept.
    evaluated
        Number of postures whose limit was asked for.
    rounds
        What was done, one sentence each.
    """

    before: PathState
    after: PathState
    front: tuple[FrontPoint, ...]
    kept: KeptModes
    evaluated: int
    rounds: tuple[str, ...]


def optimised(
    cut: PathCut, path: CutPath, free: Redundancy, loading: Loading, wanted: Wanted, start: Real, pool: Executor | None
) -> PathOptimum:
    """Choose the postures of a path.

    All postures over the sampled redundancy are screened with straight edges at equal pitch; dynamic programming finds
    the sequence; its limits are certified with the whole process and replace the screened ones, and the search is
    repeated until it chooses what is certified. Then the angles are refined about the sequence and smoothed. What is
    returned is certified at every point.

    Parameters
    ----------
    cut, path, free, loading, wanted
        Robot and cut, path, sampled angles, forces, objective.
    start : (n_moving,), rad and m
        Joint values from which the unturned sequence begins.
    """
    postures = path_postures(cut.robot, path, free, start[cut.robot.mechanism.active])
    unreached = [k for k, one in enumerate(postures) if not len(one)]
    if unreached:
        raise InputError(
            f"point {unreached[0] + 1} of {len(postures)} is reached in no posture that keeps the margins "
            f"({len(unreached)} points in all): move the path, or allow less --limit-margin"
        )
    kept = kept_modes(cut, _samples(path, free, postures, loading))
    cut = replace(cut, highest_frequency=kept.highest_frequency)
    before = state_of(cut, path, free, loading, unturned(cut, path, free, start), pool)
    coarse, front, count, note = _searched(cut, path, [free] * len(postures), postures, loading, wanted, pool)
    notes, best, total = [note], coarse, count
    if len(free.tool) > 1 or len(free.table) > 1:
        finer, fine = _finer(cut, path, free, coarse, wanted)
        if all(len(one) for one in fine):
            refined, _, count, note = _searched(cut, path, finer, fine, loading, wanted, pool)
            total += count
            best, kept_it = _better(best, refined, cut, wanted)
            notes.append(f"finer angles: {note}{'' if kept_it else '; not better, left'}")
        smooth = _smoothed(cut, path, free, best, wanted)
        if smooth is not None:
            state = state_of(cut, path, free, loading, smooth, pool)
            if _worth(state, cut, wanted, best) >= (1 - _WORSE) * _worth(best, cut, wanted, best):
                best, text = state, "smoothed angles kept"
            else:
                text = "smoothed angles were worse, left"
            notes.append(text)
    return PathOptimum(before, best, front, kept, total, tuple(notes))


def unturned(cut: PathCut, path: CutPath, free: Redundancy, start: Real) -> list[tuple[Real, float, float]]:
    """Posture at each point with both redundancies at zero, each nearest to the one before; NaN where not reached."""
    found, near = [], start
    for place in path.places:
        q = reached_near(cut.robot, free.place(place, 0.0, 0.0), near)
        near = near if q is None else q
        found.append((np.full(len(start), np.nan) if q is None else q, 0.0, 0.0))
    return found


def _samples(path: CutPath, free: Redundancy, postures: Sequence[PointPostures], loading: Loading) -> list[Request]:
    """Three postures far from each other on the path and among the angles."""
    found = []
    for share in (0.0, 0.5, 1.0):
        k = round(share * (len(postures) - 1))
        s = round(share * 0.8 * (len(postures[k]) - 1))
        posture = (postures[k].q[s], float(postures[k].tool[s]), float(postures[k].table[s]))
        found.append(request_at(path, free, loading, k, posture))
    return found


def _searched(
    cut: PathCut,
    path: CutPath,
    free: Sequence[Redundancy],
    postures: Sequence[PointPostures],
    loading: Loading,
    wanted: Wanted,
    pool: Executor | None,
) -> tuple[PathState, tuple[FrontPoint, ...], int, str]:
    """Screen, search and certify until the search chooses what is certified."""
    plain = replace(cut, process=replace(cut.process, helix_angle=0.0, pitch_angles=(), process_damping=0.0))
    values, count = screened(plain, path, free, postures, loading, pool)
    which = [distinct(one) for one in postures]
    nodes = [_nodes(one, wanted) for one in postures]
    reference = np.zeros(6)
    best: PathState | None = None
    front: tuple[FrontPoint, ...] = ()
    promised = 0.0
    searches = 0
    while searches < _ROUNDS:
        searches += 1
        costs = _costs(values, postures, which, nodes, loading, reference)
        sequence, front = chosen_sequence(costs, wanted.objective, wanted.balance)
        chosen = [(p.q[i], float(p.tool[i]), float(p.table[i])) for p, i in zip(postures, sequence.chosen, strict=True)]
        promised = promised or float(min(c[i] for c, i in zip(costs.depth, sequence.chosen, strict=True)))
        state = state_of(cut, path, free[0], loading, chosen, pool)
        count += len(chosen)
        best = state if best is None else _better(best, state, cut, wanted)[0]
        proven = state.values.known_depth(cut.max_depth)
        settled = True
        for k, i in enumerate(sequence.chosen):
            s = which[k][i]
            settled &= abs(values[k].depth[s] - proven[k]) <= 0.02 * max(proven[k], 1e-9)
            values[k].depth[s], values[k].cut[s], values[k].weight[s] = (
                proven[k],
                state.values.cut[k],
                state.values.weight[k],
            )
        if loading.weight == "change":
            settled &= bool(np.abs(state.values.weight[0] - reference).max() < 1e-6)
            reference = state.values.weight[0]
        if settled:
            break
    assert best is not None
    proven = best.values.known_depth(cut.max_depth)
    told = f"screening promised {1e3 * promised:.3g} mm, certified {1e3 * proven.min():.3g} mm, searches: {searches}"
    return best, front, count, told


def _nodes(postures: PointPostures, wanted: Wanted) -> Real:
    return np.column_stack([postures.q / wanted.joint_step, postures.table / wanted.table_step])


def _costs(
    values: Sequence[Screened],
    postures: Sequence[PointPostures],
    which: Sequence[Index],
    nodes: Sequence[Real],
    loading: Loading,
    reference: Real,
) -> Costs:
    moved = []
    for one in values:
        counts = counted_weight(one.weight, "all" if loading.weight == "change" else loading.weight)
        moved.append(np.linalg.norm((one.cut + counts - reference)[:, :3], axis=1))
    return Costs(
        [one.depth[at] for one, at in zip(values, which, strict=True)],
        [size[at] for size, at in zip(moved, which, strict=True)],
        nodes,
        [_TURNED * (one.tool**2 + one.table**2) for one in postures],
    )


def _worth(state: PathState, cut: PathCut, wanted: Wanted, against: PathState) -> float:
    """Number that is larger for a better sequence; positive."""
    depth = float(state.values.known_depth(cut.max_depth).min())
    stiff = 1 / max(float(state.sizes.max()), 1e-12)
    if wanted.objective == "depth":
        return depth
    if wanted.objective == "deviation":
        return stiff
    first = max(float(against.values.known_depth(cut.max_depth).min()), 1e-9)
    return wanted.balance * depth / first + (1 - wanted.balance) * stiff * float(against.sizes.max())


def _better(first: PathState, second: PathState, cut: PathCut, wanted: Wanted) -> tuple[PathState, bool]:
    wins = _worth(second, cut, wanted, first) > _worth(first, cut, wanted, first)
    return (second, True) if wins else (first, False)


def _finer(
    cut: PathCut, path: CutPath, free: Redundancy, state: PathState, wanted: Wanted
) -> tuple[list[Redundancy], list[PointPostures]]:
    """Angles at quarters of a step about the sequence, and the postures of its own branch there."""
    offsets = np.array([-0.5, -0.25, 0.0, 0.25, 0.5])
    steps = [float(np.diff(axis)[0]) if len(axis) > 1 else 0.0 for axis in (free.tool, free.table)]
    finer, found = [], []
    for k, place in enumerate(path.places):
        axes = []
        for step, axis, angle in zip(steps, (free.tool, free.table), (state.tool[k], state.table[k]), strict=True):
            bounded = axis is free.table
            near = angle + step * offsets if step else np.array([angle])
            axes.append(np.unique(np.clip(near, axis.min(), axis.max())) if bounded else near)
        here = replace(free, tool=axes[0], table=axes[1])
        every = point_postures(cut.robot, place, here, [state.q[k][cut.robot.mechanism.active]])
        near_it = np.abs(every.q - state.q[k]).max(axis=1) < max(
            wanted.joint_step, 1.5 * abs(steps[0]), 1.5 * abs(steps[1])
        )
        finer.append(here)
        found.append(PointPostures(*(getattr(every, name)[near_it] for name in PointPostures.__dataclass_fields__)))
    return finer, found


def _smoothed(
    cut: PathCut, path: CutPath, free: Redundancy, state: PathState, wanted: Wanted
) -> list[tuple[Real, float, float]] | None:
    """The sequence with angles that bend little, at most half a step away; None where a step or a margin breaks."""
    angles = []
    for axis, chosen in ((free.tool, state.tool), (free.table, state.table)):
        half = 0.5 * float(np.diff(axis)[0]) if len(axis) > 1 else 0.0
        angles.append(np.clip(whittaker(np.unwrap(chosen)), np.unwrap(chosen) - half, np.unwrap(chosen) + half))
    found, near = [], state.q[0]
    for k, place in enumerate(path.places):
        tool, table = float(angles[0][k]), float(angles[1][k])
        q = reached_near(cut.robot, free.place(place, tool, table), state.q[k])
        if q is None or (k and np.abs(q - near).max() > wanted.joint_step):
            return None
        found.append((q, tool, table))
        near = q
    return found


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
    difference = np.diff(np.eye(n), 2, axis=0)
    normal = np.eye(n) + weight * difference.T @ difference
    banded = np.array([np.append(np.diagonal(normal, i), np.zeros(i)) for i in range(3)])
    return np.asarray(solveh_banded(banded, values, lower=True))
