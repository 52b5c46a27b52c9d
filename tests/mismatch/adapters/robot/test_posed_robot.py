"""A robot in the postures of its recordings: modes against the robot model's own, and which of them may deviate."""

from dataclasses import replace

import numpy as np
import pytest
from milled_robots import BAND, POSTURES, ROBOT, in_postures, small_case

from millfrf.core import InputError
from millfrf.mismatch import ROBOT as SETTINGS
from millfrf.mismatch.robot.posed import posed_robot
from millfrf.mismatch.robot.receptance import posed
from millfrf.robot_model import modes_at, possible_changes, with_joint_factor

CHANGES = {change.name: change for change in possible_changes(ROBOT)}


def test_modes_up_to_three_times_the_band_may_deviate() -> None:
    result = posed_robot(ROBOT, in_postures(ROBOT, 2, seconds=6.0), SETTINGS.lab)
    for count, recording in zip(result.counts, result.recordings, strict=True):
        top = 3 * recording.spectrum.frequencies[-1]
        assert count == sum(1 for each in modes_at(ROBOT, recording.q).frequencies if each < top)


def test_rigid_links_leave_no_more_modes_than_there_are() -> None:
    result = posed_robot(ROBOT, in_postures(ROBOT, 1, seconds=6.0), SETTINGS.lab, rigid_links=True)
    assert result.counts[0] == len(result.modes(())[0].natural)


def test_modes_are_those_of_the_changed_robot() -> None:
    case = small_case(count=2)
    assert case.several_postures
    changed = case.modes(((CHANGES["joint 3 stiffness"], 0.7),))
    for modes, posture in zip(changed, POSTURES, strict=False):
        truth = modes_at(with_joint_factor(ROBOT, "3", 0.7), np.radians(posture)).frequencies
        assert modes.natural / (2 * np.pi) == pytest.approx(truth, rel=1e-9)
        assert modes.count == 4


def test_a_part_has_the_chosen_recordings_and_their_counts() -> None:
    case = replace(small_case(count=2), counts=(4, 5))
    part = case.only([1])
    assert part.recordings == (case.recordings[1],)
    assert part.counts == (5,)
    assert not part.several_postures
    assert case.values == 2 * sum(each.spectrum.measured.size for each in case.recordings) == 2 * part.values


def test_a_band_below_all_modes_is_refused() -> None:
    recording = in_postures(ROBOT, 1, seconds=60.0)[0]
    low = posed(recording.spectrum.recording, recording.q, (0.3, 1.5))
    with pytest.raises(InputError, match="above the band; raise the band"):
        posed_robot(ROBOT, [low], SETTINGS.lab)
    assert posed_robot(ROBOT, [recording], SETTINGS.lab).recordings[0].spectrum.frequencies[-1] < BAND[1]
