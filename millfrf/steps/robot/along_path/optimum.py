"""Optimisation of the postures along a path, with certified limits."""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import InputError, Real
from millfrf.robot_model import CutPath, PointPostures, Redundancy, path_postures, reached_near

from .search import PathJob, Posture, Searched, Wanted, finer_postures, searched, smoothed
from .state import FrontPoint, Loading, PathState, request_at
from .values import SETTLED, KeptModes, PathCut, Request, change_with_more, kept_modes

_WORSE = 0.01
"""Share of the objective that may be given up for a smooth sequence."""

_SCREENED = 0.05
"""Change of a limit by missing modes up to which postures are still screened without them."""

_ENLARGED = 3
"""Times that the number of modes is chosen: again, where the chosen postures need more than the sampled ones."""


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
        Number of postures that were evaluated: screened, and certified.
    rounds
        Searches that were made, one sentence each.
    """

    before: PathState
    after: PathState
    front: tuple[FrontPoint, ...]
    kept: KeptModes
    evaluated: tuple[int, int]
    rounds: tuple[str, ...]


def optimised(
    cut: PathCut, path: CutPath, free: Redundancy, loading: Loading, wanted: Wanted, start: Real, pool: Executor | None
) -> PathOptimum:
    """Choose the postures of a path.

    All postures over the sampled redundancy are screened at some points and interpolated between; dynamic programming
    finds the sequence; certified values replace interpolated ones, and the search is repeated until its values hold.
    The angles are refined about the sequence and smoothed. Every value of the result is certified.

    Parameters
    ----------
    cut, path, free, loading, wanted
        Robot and cut, path, sampled angles, forces, objective.
    start : (n_moving,), rad and m
        Joint values from which the unturned sequence begins.
    pool
        Processes that evaluate; None: this one.

    Raises
    ------
    InputError
        A point that no posture reaches within the margins, or no continuous sequence.
    """
    postures = path_postures(cut.robot, path, free, start[cut.robot.mechanism.active])
    _refuse_unreached(postures)
    samples, change, screening = _samples(path, free, postures, loading), np.inf, np.inf
    for turn in range(_ENLARGED):
        kept = kept_modes(cut, samples, pool)
        if change > _SCREENED:
            screening = kept.highest_frequency
        certified = replace(cut, highest_frequency=kept.highest_frequency)
        job = PathJob(certified, path, loading, wanted, pool, {}, screening)
        optimum = _chosen(job, free, postures, start, kept)
        critical = [request for state in (optimum.before, optimum.after) for request in _critical(job, free, state)]
        change = change_with_more(job.cut, kept.reference, critical, pool)
        if change < 2 * SETTLED or turn == _ENLARGED - 1:
            break
        samples = [*samples, *critical]
    kept = replace(kept, change=max(kept.change, change), checked=kept.checked + len(critical))
    return replace(optimum, kept=kept)


def _chosen(
    job: PathJob, free: Redundancy, postures: Sequence[PointPostures], start: Real, kept: KeptModes
) -> PathOptimum:
    """Search, refine and certify with one number of modes."""
    before = job.state(free, unturned(job.cut, job.path, free, start))
    best = searched(job, [free] * len(postures), postures)
    front, screened, notes, rivals = best.front, best.evaluated, [best.note], [best]
    if len(free.tool) > 1 or len(free.table) > 1:
        finer, fine = finer_postures(job, free, best.postures)
        if all(len(point) for point in fine):
            best = searched(job, finer, fine)
            screened += best.evaluated
            notes.append(f"finer angles: {best.note}")
            rivals.append(best)
    after, words = _certified(job, free, rivals, best)
    return PathOptimum(before, after, front, kept, (screened, len(job.memory)), (*notes, words))


def _certified(job: PathJob, free: Redundancy, rivals: list[Searched], best: Searched) -> tuple[PathState, str]:
    """First sequence whose promised values hold at every point: smoothed, finer, coarse; otherwise the best."""
    against = float(best.depth.min()), float(best.deviation.max())
    promise = job.worth(best.depth, best.deviation, against)
    tried: list[tuple[float, PathState, str]] = []
    smooth = smoothed(job, free, best.postures)
    sequences = [(smooth, "smoothed")] + [(rival.postures, "as searched") for rival in reversed(rivals)]
    for postures, words in sequences:
        if postures is None:
            continue
        state = job.state(free, postures)
        worth = job.worth(state.values.known_depth(job.cut.max_depth), state.sizes, against)
        if worth >= (1 - _WORSE) * promise:
            return state, words
        tried.append((worth, state, words))
    _, state, words = max(tried, key=lambda attempt: attempt[0])
    return state, f"{words}; the search promised more than could be certified"


def unturned(cut: PathCut, path: CutPath, free: Redundancy, start: Real) -> list[Posture]:
    """Posture at each point with both redundancies at zero, nearest to the previous one; NaN where not reached."""
    postures: list[Posture] = []
    near = start
    for place in path.places:
        q = reached_near(cut.robot, free.place(place, 0.0, 0.0), near)
        near = near if q is None else q
        postures.append((np.full(len(start), np.nan) if q is None else q, 0.0, 0.0))
    return postures


def _refuse_unreached(postures: Sequence[PointPostures]) -> None:
    unreached = [k for k, point in enumerate(postures) if not len(point)]
    if unreached:
        raise InputError(
            f"point {unreached[0] + 1} of {len(postures)} is reached in no posture that keeps the margins "
            f"({len(unreached)} points in all): move the path, or allow less --limit-margin"
        )


def _critical(job: PathJob, free: Redundancy, state: PathState) -> list[Request]:
    """Requests that missing modes would affect: the shallowest point of a sequence, its ends and its middle."""
    depth = np.where(state.reached, state.values.known_depth(job.cut.max_depth), np.inf)
    n = len(depth)
    points = sorted({int(depth.argmin()), 0, n // 2, n - 1} & set(np.flatnonzero(state.reached).tolist()))
    rows = [(k, (state.q[k], float(state.tool[k]), float(state.table[k]))) for k in points]
    return [request_at(job.path, free, job.loading, k, posture) for k, posture in rows]


def _samples(path: CutPath, free: Redundancy, postures: Sequence[PointPostures], loading: Loading) -> list[Request]:
    """Four postures far from each other on the path and among the angles."""
    requests = []
    for share in (0.0, 0.33, 0.67, 1.0):
        k = round(share * (len(postures) - 1))
        s = round(share * 0.8 * (len(postures[k]) - 1))
        posture = (postures[k].q[s], float(postures[k].tool[s]), float(postures[k].table[s]))
        requests.append(request_at(path, free, loading, k, posture))
    return requests
