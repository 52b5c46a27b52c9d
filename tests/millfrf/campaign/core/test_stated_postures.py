"""Recordings whose notes are those of another pose."""

from pathlib import Path

from millfrf.campaign.labels import Labels
from millfrf.campaign.recordings import FileLook, FoundRecording, without_wrong_postures
from millfrf.campaign.tasks import grouped

RIGHT, NEAR, WRONG = (10.0, -20.0), (10.02, -20.03), (35.0, 5.0)


def _recordings(*postures: tuple[float, ...] | None, pose: str = "P1") -> list[FoundRecording]:
    return [
        FoundRecording(f"{pose}_{k}", Path(f"{pose}_{k}.h5"), Labels({"pose": pose}, q), FileLook(1, 1), None)
        for k, q in enumerate(postures)
    ]


def test_the_one_that_contradicts_the_others_of_its_pose_has_a_fault_that_names_both_postures() -> None:
    result = without_wrong_postures(_recordings(RIGHT, WRONG, NEAR))
    assert [bool(each.fault) for each in result] == [False, True, False]
    assert "P1_1.h5: it states posture_deg = [35, 5]" in result[1].fault
    assert "[10, -20]" in result[1].fault


def test_nobody_can_tell_which_of_two_is_right() -> None:
    faults = without_wrong_postures(_recordings(RIGHT, WRONG))
    assert all("it is unknown which" in posture.fault for posture in faults)


def test_postures_that_agree_or_are_of_other_poses_or_missing_are_no_fault() -> None:
    mixed = _recordings(RIGHT, NEAR, None) + _recordings(WRONG, pose="P2")
    assert not any(each.fault for each in without_wrong_postures(mixed))


def test_a_set_has_the_posture_on_which_its_recordings_agree() -> None:
    (each,), _ = grouped(_recordings(RIGHT, NEAR), ["pose"])
    assert each.posture_deg == RIGHT
    (other,), _ = grouped(_recordings(RIGHT, WRONG), ["pose"])
    assert other.posture_deg is None
