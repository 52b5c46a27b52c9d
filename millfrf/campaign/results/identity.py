"""Identity of modes through the sets of a pose and over poses."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import Real

from .pairing import ALONE, Pairing, SeenMode, mean_mode, pair_modes, seen_modes
from .sets import ModeName, SetResults

POSE_FREQUENCY_SCALE = (0.03, 0.1)
"""Difference of the logarithms of frequency that weighs one: in one posture, and what a radian (or metre) adds."""

UNKNOWN_SCALE = 0.1
"""The same where a posture is not known."""

NEIGHBOURS = 3
"""Nearest poses with which a pose's identities are checked."""

Node = tuple[int, int]
"""Number of a pose, and number of the mode in it."""


def families(
    poses: Sequence[Sequence[SeenMode]], postures: Sequence[tuple[float, ...] | None]
) -> tuple[list[list[Node]], dict[Node, str]]:
    """Modes of all poses that are the same, and doubts about single ones.

    Parameters
    ----------
    poses
        Mean modes of each pose.
    postures : (n_active,), rad or m
        Joint values of each pose, or None. Where they are known the nearest poses are neighbours; else the poses whose
        modes are most alike.

    Returns
    -------
    list of list of (int, int)
        Number of the pose and of its mode, a list for each mode of the campaign.
    dict
        Why a mode may belong to another family; what is not in it is not doubted.
    """
    distance, scales = _distances(poses, postures)
    parent = {(p, i): (p, i) for p, modes in enumerate(poses) for i in range(len(modes))}
    doubts: dict[Node, str] = {}
    tree = (
        np.argwhere(scipy.sparse.csgraph.minimum_spanning_tree(distance).toarray() > 0)
        if len(poses) > 1
        else np.zeros((0, 2), int)
    )
    for p, q in sorted((int(a), int(b)) for a, b in tree):
        for pair in pair_modes(poses[p], poses[q], float(scales[p, q])):
            _join(parent, (p, pair.first), (q, pair.second))
            if pair.doubt:
                doubts.setdefault((q, pair.second), f"towards the neighbouring pose: {pair.doubt}")
    for p, q, pair in _checks(poses, distance, scales):
        ends = (p, pair.first), (q, pair.second)
        if not pair.doubt and _root(parent, ends[0]) != _root(parent, ends[1]):
            for end in ends:
                doubts.setdefault(end, "two neighbouring poses disagree which mode it is")
    grouped: dict[Node, list[Node]] = {}
    for node in parent:
        grouped.setdefault(_root(parent, node), []).append(node)
    return [sorted(group) for group in grouped.values()], doubts


def _distances(poses: Sequence[Sequence[SeenMode]], postures: Sequence[tuple[float, ...] | None]) -> tuple[Real, Real]:
    """How far poses are from each other, never zero, and the scale of frequency between each two."""
    n = len(poses)
    distance, scales = np.zeros((n, n)), np.full((n, n), UNKNOWN_SCALE)
    for p in range(n):
        for q in range(p):
            a, b = postures[p], postures[q]
            if a is not None and b is not None and len(a) == len(b):
                far = float(np.linalg.norm(np.subtract(a, b)))
                scales[p, q] = scales[q, p] = POSE_FREQUENCY_SCALE[0] + POSE_FREQUENCY_SCALE[1] * min(far, 1.0)
                distance[p, q] = distance[q, p] = 1e-6 + far
            else:
                distance[p, q] = distance[q, p] = 100.0 + _unlike(poses[p], poses[q])
    return distance, scales


def _unlike(first: Sequence[SeenMode], second: Sequence[SeenMode]) -> float:
    """Share of the modes without a partner, and how far the pairs are apart in frequency."""
    pairs = pair_modes(first, second, UNKNOWN_SCALE)
    apart = [abs(first[one.first].log_frequency - second[one.second].log_frequency) for one in pairs]
    most = max(len(first), len(second), 1)
    return float(sum(apart) + ALONE * UNKNOWN_SCALE * (most - len(pairs))) / most


def _checks(poses: Sequence[Sequence[SeenMode]], distance: Real, scales: Real) -> list[tuple[int, int, Pairing]]:
    """Pairs between each pose and its nearest ones."""
    found = []
    for p in range(len(poses)):
        nearest = [int(q) for q in np.argsort(distance[p], kind="stable") if q != p][:NEIGHBOURS]
        for q in nearest:
            found += [(p, q, pair) for pair in pair_modes(poses[p], poses[q], float(scales[p, q]))]
    return found


def _root(parent: dict[Node, Node], node: Node) -> Node:
    while parent[node] != node:
        node = parent[node]
    return node


def _join(parent: dict[Node, Node], first: Node, second: Node) -> None:
    a, b = _root(parent, first), _root(parent, second)
    if a != b:
        parent[max(a, b)] = min(a, b)


SET_FREQUENCY_SCALE = 0.03
"""Difference of the logarithms of frequency in one posture that weighs one: drift and scatter are a few per cent."""

ROUNDS = 3
"""How often the means of tracks are taken anew and modes are paired with them again."""

Track = dict[int, tuple[int, Pairing]]
"""Mode number and pairing by the number of the set."""


def tracks_of_pose(sets: Sequence[Sequence[SeenMode]]) -> list[Track]:
    """Tracks of modes through the sets of a pose, in the order of their frequencies.

    The set with the most modes begins; the others are paired with the means of the tracks, and modes without a partner
    begin tracks of their own.

    Parameters
    ----------
    sets
        Modes of each set.
    """
    order = sorted(range(len(sets)), key=lambda s: (-len(sets[s]), s))
    tracks: list[Track] = []
    for turn in range(ROUNDS):
        fresh: list[Track] = [{} for _ in tracks]
        for s in order:
            means = _means(sets, tracks if turn else fresh)
            _assign(s, sets[s], means, fresh)
        tracks = [track for track in fresh if track]
    frequency = [mean_mode(_modes(sets, track)).log_frequency for track in tracks]
    return [tracks[k] for k in sorted(range(len(tracks)), key=lambda k: frequency[k])]


def _assign(s: int, modes: Sequence[SeenMode], means: Sequence[SeenMode], tracks: list[Track]) -> None:
    """Put the modes of one set into tracks; those without a partner begin new ones."""
    pairs = pair_modes(modes, means, SET_FREQUENCY_SCALE)
    for pair in pairs:
        tracks[pair.second][s] = (pair.first, pair)
    for i in sorted(set(range(len(modes))) - {pair.first for pair in pairs}):
        tracks.append({s: (i, Pairing(i, len(tracks), 1.0, float("inf")))})


def _means(sets: Sequence[Sequence[SeenMode]], tracks: Sequence[Track]) -> list[SeenMode]:
    return [mean_mode(_modes(sets, track)) for track in tracks]


def _modes(sets: Sequence[Sequence[SeenMode]], track: Track) -> list[SeenMode]:
    return [sets[s][i] for s, (i, _) in sorted(track.items())]


@dataclass(frozen=True)
class ModeOfPose:
    """One mode of one pose through its sets.

    Parameters
    ----------
    pose
        Name of the pose.
    number
        Number of the mode in the campaign, from 1.
    frequency : Hz
        Mean natural frequency over the sets (geometric).
    members
        Number of the mode in the model of each set that has it, by the set's name.
    doubted
        Names of the sets in which it may be another mode.
    """

    pose: str
    number: int
    frequency: float
    members: dict[str, int]
    doubted: tuple[str, ...]


@dataclass(frozen=True)
class IdentifiedModes:
    """Modes of a campaign.

    Parameters
    ----------
    names
        Name of each mode by its set and its number in the set's model, from 0.
    modes
        Modes of each pose, by pose and number.
    frequencies : Hz
        Mean natural frequency of each mode of the campaign, by its number.
    """

    names: dict[tuple[str, int], ModeName]
    modes: tuple[ModeOfPose, ...]
    frequencies: dict[int, float]


@dataclass(frozen=True)
class _Pose:
    name: str
    sets: list[SetResults]
    seen: list[list[SeenMode]]
    tracks: list[Track]
    means: list[SeenMode]


def identify_modes(sets: Sequence[SetResults]) -> IdentifiedModes:
    """Find which modes are the same: in each pose through its sets, then over poses.

    Modes that at least half of the poses have are numbered first, by frequency; then the rarer ones.

    Parameters
    ----------
    sets
        Sets of the campaign, as read.
    """
    poses = [_pose(name, [one for one in sets if one.measured.pose == name]) for name in _poses(sets)]
    postures = [one.sets[0].measured.posture for one in poses]
    groups, doubts = families([one.means for one in poses], postures)
    mean = [float(np.mean([poses[p].means[i].log_frequency for p, i in group])) for group in groups]
    order = sorted(range(len(groups)), key=lambda k: (2 * len(groups[k]) < len(poses), mean[k]))
    numbers = {node: rank + 1 for rank, k in enumerate(order) for node in groups[k]}
    names: dict[tuple[str, int], ModeName] = {}
    modes = [
        _mode(pose, i, numbers[p, i], doubts.get((p, i), ""), names)
        for p, pose in enumerate(poses)
        for i in range(len(pose.tracks))
    ]
    frequencies = {rank + 1: float(np.exp(mean[k])) for rank, k in enumerate(order)}
    return IdentifiedModes(names, tuple(sorted(modes, key=lambda one: (one.pose, one.number))), frequencies)


def _poses(sets: Sequence[SetResults]) -> list[str]:
    return sorted({one.measured.pose for one in sets if one.model is not None})


def _pose(name: str, sets: Sequence[SetResults]) -> _Pose:
    kept = [one for one in sets if one.model is not None]
    seen = [seen_modes(one) for one in kept]
    tracks = tracks_of_pose(seen)
    means = [mean_mode([seen[s][i] for s, (i, _) in sorted(track.items())]) for track in tracks]
    return _Pose(name, kept, seen, tracks, means)


def _mode(pose: _Pose, i: int, number: int, doubt: str, names: dict[tuple[str, int], ModeName]) -> ModeOfPose:
    """One track as a mode of the pose; its members get their names."""
    members, doubted = {}, []
    for s, (index, pair) in sorted(pose.tracks[i].items()):
        name = pose.sets[s].name
        members[name] = index
        names[name, index] = ModeName(number, pair.likeness, pair.doubt or doubt)
        doubted += [name] if pair.doubt else []
    return ModeOfPose(pose.name, number, float(np.exp(pose.means[i].log_frequency)), members, tuple(doubted))
