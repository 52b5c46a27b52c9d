"""What a recording in a posture must be, and its two halves."""

import numpy as np
import pytest
from milled_robots import BAND, NOTHING, POSTURES, ROBOT, TIP, milled

from millfrf.core import InputError
from millfrf.mismatch import diagnose_robot
from millfrf.mismatch.robot.receptance import halves, posed


def test_recordings_that_do_not_fit_are_refused() -> None:
    trial = milled(ROBOT, POSTURES[0], 0, seconds=4.0)
    with pytest.raises(InputError, match="50 are the least"):
        posed(trial, NOTHING, (17.0, 18.0))
    with pytest.raises(InputError, match="TABLE"):
        posed(trial, NOTHING, BAND, responses=("TABLE:+X", *TIP[1:]))
    with pytest.raises(InputError, match="no recording"):
        diagnose_robot(ROBOT, [])
    housing = posed(trial, np.radians(POSTURES[0]), BAND, responses=("HOUSING:+X", "HOUSING:+Y", "HOUSING:+Z"))
    with pytest.raises(InputError, match="say where the sensor is"):
        diagnose_robot(ROBOT, [housing])


def test_halves_are_the_recording_cut_in_two() -> None:
    recording = posed(milled(ROBOT, POSTURES[0], 0, seconds=12.0), np.radians(POSTURES[0]), BAND)
    parts = halves(recording)
    whole = recording.spectrum.recording
    assert [each.name for each in parts] == ["posture 1, first half", "posture 1, second half"]
    for name in ("force", "response"):
        cut = [getattr(each.spectrum.recording, name) for each in parts]
        assert (np.concatenate(cut) == getattr(whole, name)).all()
    for each in parts:
        assert (each.q == recording.q).all()
        assert each.responses == recording.responses == TIP
        assert recording.spectrum.frequencies[0] <= each.spectrum.frequencies[0]
        assert each.spectrum.frequencies[-1] <= recording.spectrum.frequencies[-1]
    with pytest.raises(InputError, match="50 are the least"):
        halves(posed(milled(ROBOT, POSTURES[0], 0, seconds=2.5), NOTHING, BAND))
