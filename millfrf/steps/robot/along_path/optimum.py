"""Optimisation of the postures along a path, with certified limits."""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import InputError, Real
from millfrf.robot_model import CutPath, PointPostures, Redundancy, SpatialRobot, path_postures, reached_near

from ...settings import PATH
from .search import FoundSequence, PathGoal, PathJob, Posture, finer_postures, search_sequence, smoothed_sequence
from .state import FrontPoint, Loading, PathState, request_at
from .values import KeptModes, PathCut, PostureRequest, change_with_more, kept_modes


@dataclass(frozen=True)
class PathOptimum:
    """Result of the optimisation."""

    before: PathState  # with the redundancy at zero
    after: PathState  # chosen postures
    front: tuple[FrontPoint, ...]  # for the objective ``both``
    kept: KeptModes
    evaluated: tuple[int, int]  # numbers of postures that were screened, and certified
    rounds: tuple[str, ...]  # one sentence on each search


def optimise_postures(
    cut: PathCut, path: CutPath, free: Redundancy, loading: Loading, goal: PathGoal, start: Real, pool: Executor | None
) -> PathOptimum:
    """Choose the postures of a path.

    All postures over the sampled redundancy are screened at some points and interpolated between them. Dynamic
    programming finds the sequence; certified values replace interpolated ones, and the search is repeated until they
    confirm it. The angles are then refined about the sequence and smoothed. Every value of the result is certified.

    The sequence without turning begins near ``start``, (n_moving,), rad and m. Without a ``pool`` postures are
    evaluated in this process.
    """
    postures = path_postures(cut.robot, path, free, start[cut.robot.mechanism.active])
    _refuse_unreached(postures)
    samples, change, screening = _samples(path, free, postures, loading), np.inf, np.inf
    for turn in range(PATH.mode_choices):
        kept = kept_modes(cut, samples, pool)
        if change > PATH.largest_screening_change:
            screening = kept.highest_frequency
        certified = replace(cut, highest_frequency=kept.highest_frequency)
        job = PathJob(certified, path, loading, goal, pool, {}, screening)
        optimum = _chosen(job, free, postures, start, kept)
        critical = [request for state in (optimum.before, optimum.after) for request in _critical(job, free, state)]
        change = change_with_more(job.cut, kept.reference, critical, pool)
        if change < 2 * PATH.negligible_change or turn == PATH.mode_choices - 1:
            break
        samples = [*samples, *critical]
    kept = replace(kept, change=max(kept.change, change), checked=kept.checked + len(critical))
    return replace(optimum, kept=kept)


def _chosen(
    job: PathJob, free: Redundancy, postures: Sequence[PointPostures], start: Real, kept: KeptModes
) -> PathOptimum:
    """Search a sequence of postures, refine it and certify its values, all with the same number of modes."""
    before = job.state(free, unturned_sequence(job.cut.robot, job.path, free, start))
    best = search_sequence(job, [free] * len(postures), postures)
    front, screened, notes, searches = best.front, best.evaluated, [best.note], [best]
    if len(free.tool) > 1 or len(free.table) > 1:
        finer, fine = finer_postures(job, free, best.postures)
        if all(len(point) for point in fine):
            best = search_sequence(job, finer, fine)
            screened += best.evaluated
            notes.append(f"finer angles: {best.note}")
            searches.append(best)
    after, words = _certified(job, free, searches, best)
    return PathOptimum(before, after, front, kept, (screened, len(job.memory)), (*notes, words))


def _certified(
    job: PathJob, free: Redundancy, searches: list[FoundSequence], best: FoundSequence
) -> tuple[PathState, str]:
    """Certify the smoothed, the finer and the coarse sequence in turn.

    Return the first sequence whose certified values confirm the search at every point, else the best sequence.
    """
    against = float(best.depth.min()), float(best.deviation.max())
    promise = job.worth(best.depth, best.deviation, against)
    tried: list[tuple[float, PathState, str]] = []
    smooth = smoothed_sequence(job, free, best.postures)
    sequences = [(smooth, "smoothed")] + [(search.postures, "as searched") for search in reversed(searches)]
    for postures, words in sequences:
        if postures is None:
            continue
        state = job.state(free, postures)
        worth = job.worth(state.values.known_depth(job.cut.max_depth), state.sizes, against)
        if worth >= (1 - PATH.smoothing_loss) * promise:
            return state, words
        tried.append((worth, state, words))
    _, state, words = max(tried, key=lambda attempt: attempt[0])
    return state, f"{words}; the search promised more than could be certified"


def unturned_sequence(robot: SpatialRobot, path: CutPath, free: Redundancy, start: Real) -> list[Posture]:
    """Posture at each point with the redundancy at zero, nearest to the previous one; NaN where not reached."""
    postures: list[Posture] = []
    near = start
    for place in path.places:
        q = reached_near(robot, free.place(place, 0.0, 0.0), near)
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


def _critical(job: PathJob, free: Redundancy, state: PathState) -> list[PostureRequest]:
    """Return the postures for a check of missing modes: at the smallest depth limit, at both ends and in the middle."""
    depth = np.where(state.reached, state.values.known_depth(job.cut.max_depth), np.inf)
    n = len(depth)
    points = sorted({int(depth.argmin()), 0, n // 2, n - 1} & set(np.flatnonzero(state.reached).tolist()))
    rows = [(k, (state.q[k], float(state.tool[k]), float(state.table[k]))) for k in points]
    return [request_at(job.path, free, job.loading, k, posture) for k, posture in rows]


def _samples(
    path: CutPath, free: Redundancy, postures: Sequence[PointPostures], loading: Loading
) -> list[PostureRequest]:
    """Return four postures that are far from each other along the path and among the redundancy angles."""
    requests = []
    for share in (0.0, 0.33, 0.67, 1.0):
        k = round(share * (len(postures) - 1))
        s = round(share * 0.8 * (len(postures[k]) - 1))
        posture = (postures[k].q[s], float(postures[k].tool[s]), float(postures[k].table[s]))
        requests.append(request_at(path, free, loading, k, posture))
    return requests
