"""`identify_modes`: the name of every mode of every set, and the tracks of modes through the sets of each pose."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..read_set import SetResults
from ..table import ModeName
from .across_poses import families
from .one_mode import SeenMode, mean_mode, seen_modes
from .within_pose import Track, tracks_of_pose


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
