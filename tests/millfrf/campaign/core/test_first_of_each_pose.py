"""The posture model is learned from the first sets of each posture."""

from pathlib import Path

from millfrf.campaign.jobs import _first_of_each_pose


def test_of_each_posture_the_first_sets_are_taken_in_their_order() -> None:
    sets = [
        (Path(name), name, pose) for name, pose in (("a1", "A"), ("b1", "B"), ("a2", "A"), ("b2", "B"), ("a3", "A"))
    ]
    assert [name for _, name, _ in _first_of_each_pose(sets, 1)] == ["a1", "b1"]
    assert [name for _, name, _ in _first_of_each_pose(sets, 2)] == ["a1", "b1", "a2", "b2"]
