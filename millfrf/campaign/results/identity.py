"""Identification of modes across the sets of a pose and across poses, by pairs of frequency and shape."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import Complex, DegreeOfFreedom, Real

from .sets import ModeName, SetResults
from .settings import SETTINGS


@dataclass(frozen=True)
class SeenMode:
    """Frequency and shape of one mode, or the mean of several estimates of one mode."""

    source: tuple[str, int]  # set, and number in its model from 0 (of a mean: the first)
    log_frequency: float  # natural logarithm of the frequency in Hz
    points: tuple[str, ...]  # points with axes, without sign
    shape: Complex  # (n_points,); see :func:`normalised`


def seen_modes(results: SetResults) -> list[SeenMode]:
    if results.model is None:
        return []
    parsed = [DegreeOfFreedom.parse(label) for label in results.model.responses]
    points = tuple(f"{dof.node}:{dof.direction[1:]}" for dof in parsed)
    signs = np.array([dof.sign for dof in parsed])
    return [
        SeenMode((results.name, i), float(np.log(frequency)), points, normalised(results.model.right[i] * signs))
        for i, frequency in enumerate(results.model.natural_frequencies)
    ]


def normalised(shape: Complex) -> Complex:
    """Scale a shape to length one and rotate it so that the sum of its squares is real and positive."""
    size = float(np.linalg.norm(shape))
    if size == 0:
        return shape
    turned = shape * np.exp(-0.5j * np.angle(np.sum(shape**2)))
    return np.asarray(turned / size)


def likeness(first: SeenMode, second: SeenMode) -> float:
    """Return the modal assurance criterion over common points; NaN with fewer than two."""
    shared = [name for name in first.points if name in second.points]
    if len(shared) < 2:
        return float("nan")
    a = first.shape[[first.points.index(name) for name in shared]]
    b = second.shape[[second.points.index(name) for name in shared]]
    size = float(np.sum(np.abs(a) ** 2) * np.sum(np.abs(b) ** 2))
    return float(abs(np.vdot(a, b)) ** 2 / size) if size else float("nan")


def mean_mode(modes: Sequence[SeenMode]) -> SeenMode:
    """Return the mean frequency and the mean shape over the common points."""
    points = tuple(name for name in modes[0].points if all(name in mode.points for mode in modes))
    total = np.zeros(len(points), dtype=complex)
    for mode in modes:
        shape = mode.shape[[mode.points.index(name) for name in points]]
        # the sign of a mode shape is arbitrary
        total = total + (shape if np.vdot(total, shape).real >= 0 else -shape)
    frequency = float(np.mean([mode.log_frequency for mode in modes]))
    return SeenMode(modes[0].source, frequency, points, normalised(total))


@dataclass(frozen=True)
class Pairing:
    """Two modes that are identified as the same mode."""

    first: int  # number in the first list
    second: int  # number in the second list
    likeness: float  # MAC; NaN: fewer than two common points
    margin: float  # increase of the total squared distance if these two are not paired

    @property
    def doubt(self) -> str:
        """Return the reason why the two modes may be different; an empty text if the pair is certain.

        Examples
        --------
        >>> Pairing(0, 1, 0.1, 9.0).doubt
        'shapes are unlike (MAC 0.10)'
        """
        if self.likeness < SETTINGS.least_mac:
            return f"shapes are unlike (MAC {self.likeness:.2f})"
        return "another mode is as near in frequency and shape" if self.margin < SETTINGS.least_margin else ""


def pair_modes(first: Sequence[SeenMode], second: Sequence[SeenMode], frequency_scale: float) -> list[Pairing]:
    """Pair two lists of modes with the least total of ``(log(f/g) / a)^2 + (1 - MAC) / b^2``.

    The modes of a pair have the frequencies f and g (Hz); a is ``frequency_scale``, b ``shape_scale``. Leaving two
    modes unpaired costs ``unpaired_cost``, so two modes whose pair would cost more stay unpaired.
    """
    if not first or not second:
        return []
    mac = np.array([[likeness(a, b) for b in second] for a in first])
    ratio = np.subtract.outer([a.log_frequency for a in first], [b.log_frequency for b in second])
    distance = (ratio / frequency_scale) ** 2 + np.nan_to_num(1 - mac) / SETTINGS.shape_scale**2
    best, chosen = _least(distance)
    pairs = []
    for i, j in chosen:
        without = distance.copy()
        without[i, j] = np.inf
        pairs.append(Pairing(i, j, float(mac[i, j]), float(_least(without)[0] - best)))
    return pairs


def _least(distance: Real) -> tuple[float, list[tuple[int, int]]]:
    """Solve the assignment problem; return the total cost minus the cost without any pair, and the pairs."""
    gain = np.minimum(distance, SETTINGS.unpaired_cost) - SETTINGS.unpaired_cost
    rows, columns = scipy.optimize.linear_sum_assignment(gain)
    pairs = [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if distance[i, j] < SETTINGS.unpaired_cost]
    return float(sum(gain[i, j] for i, j in pairs)), pairs


Node = tuple[int, int]  # number of a pose, number of a mode in it


def families(
    poses: Sequence[Sequence[SeenMode]], postures: Sequence[tuple[float, ...] | None]
) -> tuple[list[list[Node]], dict[Node, str]]:
    """Group the modes of all poses into families of the same mode; also return the reasons of uncertain assignments.

    Modes are paired along the minimum spanning tree of the poses, then checked between nearest poses.

    Parameters
    ----------
    postures : (n_active,), rad or m
        Joint values of each pose, or None. If they are known, neighbours are the nearest poses, else the poses with
        the most similar modes.
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
    """Return the distances between poses (all above zero), and the scale of log frequency for each pair of poses."""
    n = len(poses)
    distance, scales = np.zeros((n, n)), np.full((n, n), SETTINGS.unknown_frequency_scale)
    for p in range(n):
        for q in range(p):
            a, b = postures[p], postures[q]
            if a is not None and b is not None and len(a) == len(b):
                separation = float(np.linalg.norm(np.subtract(a, b)))
                scales[p, q] = scales[q, p] = SETTINGS.pose_frequency_scale + SETTINGS.posture_frequency_scale * min(
                    separation, 1.0
                )
                # the spanning tree takes zeros for missing edges
                distance[p, q] = distance[q, p] = 1e-6 + separation
            else:
                # 100: farther than any two known postures
                distance[p, q] = distance[q, p] = 100.0 + _dissimilarity(poses[p], poses[q])
    return distance, scales


def _dissimilarity(first: Sequence[SeenMode], second: Sequence[SeenMode]) -> float:
    """Return the dissimilarity of two poses, computed from unpaired modes and from frequency differences."""
    pairs = pair_modes(first, second, SETTINGS.unknown_frequency_scale)
    differences = [abs(first[pair.first].log_frequency - second[pair.second].log_frequency) for pair in pairs]
    n_modes = max(len(first), len(second), 1)
    return (
        float(sum(differences) + SETTINGS.unpaired_cost * SETTINGS.unknown_frequency_scale * (n_modes - len(pairs)))
        / n_modes
    )


def _checks(poses: Sequence[Sequence[SeenMode]], distance: Real, scales: Real) -> list[tuple[int, int, Pairing]]:
    """Return the pairs of each pose with its nearest poses."""
    checks = []
    for p in range(len(poses)):
        nearest = [int(q) for q in np.argsort(distance[p], kind="stable") if q != p][: SETTINGS.neighbours]
        for q in nearest:
            checks += [(p, q, pair) for pair in pair_modes(poses[p], poses[q], float(scales[p, q]))]
    return checks


def _root(parent: dict[Node, Node], node: Node) -> Node:
    while parent[node] != node:
        node = parent[node]
    return node


def _join(parent: dict[Node, Node], first: Node, second: Node) -> None:
    a, b = _root(parent, first), _root(parent, second)
    if a != b:
        parent[max(a, b)] = min(a, b)


Track = dict[int, tuple[int, Pairing]]  # number of the mode and pairing, by number of the set


def tracks_of_pose(sets: Sequence[Sequence[SeenMode]]) -> list[Track]:
    """Track modes through the sets of a pose; tracks are sorted by frequency.

    The set with the most modes starts the tracks. The other sets are paired with the means of the tracks; unpaired
    modes start new tracks.
    """
    order = sorted(range(len(sets)), key=lambda s: (-len(sets[s]), s))
    tracks: list[Track] = []
    for round_number in range(SETTINGS.rounds):
        new_tracks: list[Track] = [{} for _ in tracks]
        for s in order:
            means = _means(sets, tracks if round_number else new_tracks)
            _assign(s, sets[s], means, new_tracks)
        tracks = [track for track in new_tracks if track]
    frequency = [mean_mode(_modes(sets, track)).log_frequency for track in tracks]
    return [tracks[k] for k in sorted(range(len(tracks)), key=lambda k: frequency[k])]


def _assign(s: int, modes: Sequence[SeenMode], means: Sequence[SeenMode], tracks: list[Track]) -> None:
    """Add the modes of a set to the tracks; start a new track with each unpaired mode."""
    pairs = pair_modes(modes, means, SETTINGS.set_frequency_scale)
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
    """One mode of one pose in all its sets."""

    pose: str
    number: int  # in the campaign, from 1
    frequency: float  # Hz; geometric mean over the sets
    members: dict[str, int]  # number in the model, by name of the set
    doubted: tuple[str, ...]  # sets in which the identity is uncertain


@dataclass(frozen=True)
class IdentifiedModes:
    """Modes of a campaign."""

    names: dict[tuple[str, int], ModeName]  # by set and number in its model, from 0
    modes: tuple[ModeOfPose, ...]  # by pose and number
    frequencies: dict[int, float]  # Hz; mean over poses, by number of the mode


@dataclass(frozen=True)
class _Pose:
    name: str
    sets: list[SetResults]
    seen: list[list[SeenMode]]
    tracks: list[Track]
    means: list[SeenMode]


def identify_modes(sets: Sequence[SetResults]) -> IdentifiedModes:
    """Identify the same modes in the sets of each pose, then across poses.

    Modes in at least half of the poses get the first numbers, in order of frequency; then the remaining modes follow.
    """
    poses = [_pose(name, [item for item in sets if item.measured.pose == name]) for name in _poses(sets)]
    postures = [item.sets[0].measured.posture for item in poses]
    groups, doubts = families([item.means for item in poses], postures)
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
    return IdentifiedModes(names, tuple(sorted(modes, key=lambda item: (item.pose, item.number))), frequencies)


def _poses(sets: Sequence[SetResults]) -> list[str]:
    return sorted({results.measured.pose for results in sets if results.model is not None})


def _pose(name: str, sets: Sequence[SetResults]) -> _Pose:
    usable = [results for results in sets if results.model is not None]
    seen = [seen_modes(results) for results in usable]
    tracks = tracks_of_pose(seen)
    means = [mean_mode([seen[s][i] for s, (i, _) in sorted(track.items())]) for track in tracks]
    return _Pose(name, usable, seen, tracks, means)


def _mode(pose: _Pose, i: int, number: int, doubt: str, names: dict[tuple[str, int], ModeName]) -> ModeOfPose:
    """Convert a track to a mode of the pose; add the identities of its members to ``names``."""
    members, doubted = {}, []
    for s, (index, pair) in sorted(pose.tracks[i].items()):
        name = pose.sets[s].name
        members[name] = index
        names[name, index] = ModeName(number, pair.likeness, pair.doubt or doubt)
        doubted += [name] if pair.doubt else []
    return ModeOfPose(pose.name, number, float(np.exp(pose.means[i].log_frequency)), members, tuple(doubted))
