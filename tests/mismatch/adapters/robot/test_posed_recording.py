"""What a recording in a posture must be, and its two halves."""

import numpy as np
import pytest
from milled_robots import BAND, NOTHING, POSTURES, ROBOT, TIP, milled

from foundation import InputError
from mismatch.adapters.robot import diagnose_robot, posed


def test_recordings_that_do_not_fit_are_refused() -> None:
    trial = milled(ROBOT, POSTURES[0], 0, seconds=4.0)
    with pytest.raises(InputError, match="50 are the least"):
        posed(trial, NOTHING, (17.0, 18.0))
    with pytest.raises(InputError, match="TABLE"):
        posed(trial, NOTHING, BAND, responses=("TABLE:+X", *TIP[1:]))
    with pytest.raises(InputError, match="no recording"):
        diagnose_robot(ROBOT, [])
    housing = posed(trial, np.radians(POSTURES[0]), BAND, responses=("HOUSING:+X", "HOUSING:+Y", "HOUSING:+Z"))
    with pytest.raises(InputError, match="--sensor"):
        diagnose_robot(ROBOT, [housing])
