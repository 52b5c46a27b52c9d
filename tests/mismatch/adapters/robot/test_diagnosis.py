"""A small diagnosis from end to end: what it says, with which settings, and what its file holds."""

import math
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from milled_robots import ROBOT, in_postures

from millfrf.mismatch import ROBOT as SETTINGS
from millfrf.mismatch import (
    LabError,
    RobotDiagnosis,
    diagnose_robot,
    number_of,
    read_diagnosis,
    standard_error_of,
    write_diagnosis,
)
from millfrf.robot_model import with_joint_factor

FEW = replace(SETTINGS, causes={"joint 3 stiffness": None, "joint 5 stiffness": None})


@pytest.fixture(scope="module")
def found() -> RobotDiagnosis:
    recordings = in_postures(with_joint_factor(ROBOT, "3", 0.7), 2, seconds=10.0)
    return diagnose_robot(ROBOT, recordings, settings=FEW)


def test_a_softer_joint_is_explained_by_the_number_that_was_concealed(found: RobotDiagnosis) -> None:
    assert (found.compared, found.verdict, found.equivalents) == ("robot", "explained", ())
    assert [each.name for each in found.physics] == ["joint 3 stiffness"]
    cause = found.physics[0]
    assert number_of(cause) == pytest.approx(0.7, abs=3 * standard_error_of(cause))
    parts = cause.error_parts["joint 3 stiffness"]
    assert standard_error_of(cause) == pytest.approx(math.hypot(*parts.values()))
    assert [each.name for each in found.candidates] == ["joint 3 stiffness", "joint 5 stiffness"]


def test_it_is_complete_when_it_is_returned(found: RobotDiagnosis) -> None:
    details = found.details
    for fitted, left in ((details.nominal, found.before), (details.final, found.after)):
        assert left.share == left.size == (fitted.cost - details.free.fitted.misfit) / fitted.determined
    evidence = details.nominal.score - details.final.score
    assert found.physics[0].evidence == pytest.approx(evidence)
    assert found.improvement.before == pytest.approx(np.sqrt(np.mean([each.before**2 for each in found.held_out])))
    assert found.improvement.p_value < 0.01
    assert found.improvement.interval[0] <= found.improvement.interval[1] < 0.5
    assert details.final.changes[0][1] == number_of(found.physics[0])


def test_its_file_comes_back(found: RobotDiagnosis, tmp_path: Path) -> None:
    write_diagnosis(tmp_path / "robot_diagnosis.json", replace(found, doubts=("a rests.",)))
    back = read_diagnosis(tmp_path / "robot_diagnosis.json")
    assert back == replace(found, doubts=("a rests.",), details=None)
    assert [each["name"] for each in back.content["robot"]["recordings"]] == ["posture 1", "posture 2"]


def test_a_pickle_comes_back_with_its_fits(found: RobotDiagnosis) -> None:
    """The changes are partial functions, which Python itself compares by identity."""
    again = pickle.loads(pickle.dumps(found))
    assert again == found
    number = found.details.final.changes[0][1]
    shifted = replace(found.details.final, changes=((found.details.final.changes[0][0], number + 1e-9),))
    assert again != replace(found, details=replace(found.details, final=shifted))


def test_error_and_number_of_causes_stand_above_the_settings() -> None:
    """A model that may be off by ten per cent leaves nothing to explain; texts tell how far the work is."""
    stages: list[str] = []
    recordings = in_postures(with_joint_factor(ROBOT, "5", 0.97), 1, seconds=8.0)
    wide = LabError(0.1, 0.5, 0.5)
    quiet = diagnose_robot(ROBOT, recordings, error=wide, most_causes=1, settings=FEW, progress=stages.append)
    assert quiet.verdict == "none"
    assert quiet.details.robot.error == wide
    assert quiet.details.final is quiet.details.nominal
    assert quiet.physics == quiet.equivalents == ()
    assert all(each.before == each.after for each in quiet.held_out)
    assert quiet.improvement.p_value == 1.0
    assert stages == ["modes and noise", "causes, round 1", "redundant causes"]
