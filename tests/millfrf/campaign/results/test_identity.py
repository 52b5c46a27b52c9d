"""Which mode is which: by shape where frequencies cross, by neighbours over poses, and not where nothing tells."""

from typing import Any

import numpy as np
import pytest

from millfrf.campaign.results.identity import SeenMode, families, identify_modes, pair_modes, tracks_of_pose
from millfrf.campaign.results.sets import read_set

POINTS = ("TCP:X", "TCP:Y", "TCP:Z")


def _seen(frequency: float, shape: tuple[float, ...], name: str = "") -> SeenMode:
    vector = np.array(shape, dtype=complex)
    return SeenMode((name, 0), float(np.log(frequency)), POINTS, vector / np.linalg.norm(vector))


X, Y, Z = (1.0, 0.1, 0.0), (0.1, 1.0, 0.1), (0.0, 0.1, 1.0)


def test_modes_that_cross_keep_their_shapes() -> None:
    sets = [[_seen(20.0 + 0.2 * k, X), _seen(21.0 - 0.2 * k, Y)] for k in range(6)]
    sets = [sorted(each, key=lambda mode: mode.log_frequency) for each in sets]
    tracks = tracks_of_pose(sets)
    assert len(tracks) == 2
    for track in tracks:
        shapes = [sets[s][i].shape for s, (i, _) in track.items()]
        assert len(shapes) == 6
        assert all(abs(np.vdot(shapes[0], shape)) > 0.99 for shape in shapes)


def test_a_mode_that_a_set_lacks_does_not_shift_the_others() -> None:
    whole = [_seen(10.0, X), _seen(16.0, Y), _seen(30.0, Z)]
    tracks = tracks_of_pose([whole, [whole[0], whole[2]], whole])
    assert [sorted(track) for track in tracks] == [[0, 1, 2], [0, 2], [0, 1, 2]]
    assert tracks[2][1][0] == 1


def test_a_mode_far_from_all_others_begins_its_own_track() -> None:
    tracks = tracks_of_pose([[_seen(10.0, X)], [_seen(10.1, X), _seen(55.0, X)]])
    assert [sorted(track) for track in tracks] == [[0, 1], [1]]


def test_two_modes_that_nothing_tells_apart_are_doubted() -> None:
    first = [_seen(20.0, X), _seen(20.4, X)]
    second = [_seen(20.2, X), _seen(20.5, X)]
    assert all(
        pair.doubt == "another mode is as near in frequency and shape" for pair in pair_modes(first, second, 0.03)
    )
    stated = pair_modes([_seen(20.0, X), _seen(20.4, Y)], [_seen(20.2, X), _seen(20.5, Y)], 0.03)
    assert [(pair.first, pair.second, pair.doubt) for pair in stated] == [(0, 0, ""), (1, 1, "")]


def test_one_frequency_with_another_shape_is_doubted() -> None:
    [pair] = pair_modes([_seen(20.0, X)], [_seen(20.0, Y)], 0.03)
    assert pair.doubt.startswith("shapes are unlike")


def test_modes_over_poses_follow_neighbours_through_a_crossing() -> None:
    angles = np.linspace(0, 1.5, 9)
    first, second = 20 + 6 * angles, 26 - 6 * angles
    poses = []
    for a, f, g in zip(angles, first, second, strict=True):
        turned = (float(np.cos(a)), float(np.sin(a)), 0.2), (float(-np.sin(a)), float(np.cos(a)), 0.2)
        poses.append(sorted([_seen(f, turned[0]), _seen(g, turned[1])], key=lambda mode: mode.log_frequency))
    groups, _ = families(poses, [(float(a),) for a in angles])
    assert sorted(len(group) for group in groups) == [9, 9]
    for group in groups:
        result = np.exp([poses[p][i].log_frequency for p, i in group])
        assert np.allclose(result, first) or np.allclose(result, second)


def test_the_order_of_poses_does_not_matter() -> None:
    poses = [[_seen(20 + p, X), _seen(30 - p, Y)] for p in range(4)]
    postures = [(0.1 * p,) for p in range(4)]
    forward, _ = families(poses, postures)
    backward, _ = families(poses[::-1], postures[::-1])
    assert sorted(forward) == sorted([sorted((3 - p, i) for p, i in group) for group in backward])


def test_modes_of_a_campaign_are_numbered_by_frequency_with_rare_ones_last(
    campaign: Any, modelled: Any, shapes: Any
) -> None:
    for k, pose in enumerate(("P01", "P02", "P03")):
        frequencies, own = [10.0 + k, 16.0 + k, 30.0], shapes
        if pose == "P02":
            frequencies, own = (
                [10.0 + k, 12.9, 16.0 + k, 30.0],
                np.vstack([shapes[:1], [[0.03, 0.03, -0.04]], shapes[1:]]),
            )
        campaign.add({"pose": pose}, modelled(frequencies, [0.03] * len(frequencies), own, None), posture=(0.2 * k,))
    result = identify_modes([read_set(each) for each in campaign.sets])
    assert [result.names["P02", i].number for i in range(4)] == [1, 4, 2, 3]
    assert result.frequencies[4] == pytest.approx(12.9)
