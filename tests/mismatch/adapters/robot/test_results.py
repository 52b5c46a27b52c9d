"""What is told of fitted numbers: each under its name, with its own error, beside its companions."""

import json

import numpy as np
import pytest
from milled_robots import ROBOT, small_case

from millfrf.mismatch import CompanionNumber, companions_of, number_of, standard_error_of
from millfrf.mismatch.inference.search import Proposal
from millfrf.mismatch.robot.fit import FreeFit, RobotFit
from millfrf.mismatch.robot.results import (
    NumberErrors,
    RobotDetails,
    accepted_cause,
    candidate_of,
    content_of,
    location_of,
)
from millfrf.robot_model import modes_at, possible_changes, with_joint_factor

CHANGES = {change.name: change for change in possible_changes(ROBOT)}
JOINT, PAYLOAD = CHANGES["joint 3 stiffness"], CHANGES["payload"]
PLACE = [one.name for one in PAYLOAD.companions]
NUMBERS = ((PAYLOAD, 8.0), *((one, 0.1 * k) for k, one in enumerate(PAYLOAD.companions)), (JOINT, 0.7))
ERRORS = np.array([1.0, 0.01, 0.02, 0.03, 0.05])
FITTED = RobotFit(NUMBERS, (), 500.0, 0.0, 0.0, 10.0, ERRORS, (), 30.0)


def test_a_change_with_companions_is_told_with_them() -> None:
    parts = NumberErrors(ERRORS, 2 * ERRORS, 2 * ERRORS)
    cause = accepted_cause(Proposal("payload", location_of(PAYLOAD), FITTED, 40.0), FITTED, parts)
    assert number_of(cause) == 8.0
    assert standard_error_of(cause) == pytest.approx(3.0)
    assert cause.parameters == {"payload": 8.0} | {name: 0.1 * k for k, name in enumerate(PLACE)}
    assert cause.error_parts["payload"] == {"fit": 1.0, "spread": 2.0, "form": 2.0}
    assert list(cause.parameters) == list(cause.standard_errors) == list(cause.error_parts)
    beside = companions_of(cause)
    assert [(each.name, each.number) for each in beside] == [(name, 0.1 * k) for k, name in enumerate(PLACE)]
    assert [each.standard_error for each in beside] == pytest.approx([0.03, 0.06, 0.09])
    assert [(each.unit, each.spread) for each in beside] == [(each.unit, each.spread) for each in PAYLOAD.companions]


def test_a_change_alone_has_no_companions_and_a_candidate_the_error_of_its_fit() -> None:
    single = candidate_of(Proposal("joint 3 stiffness", location_of(JOINT), FITTED, 25.0), "fitted")
    assert (single.evidence, single.stage, single.location) == (25.0, "fitted", {"kind": "stiffness", "unit": ""})
    assert single.parameters == {"joint 3 stiffness": 0.7}
    assert standard_error_of(single) == 0.05
    assert companions_of(single) == ()


@pytest.mark.parametrize(("error", "determined"), [(0.04, True), (0.06, False), (0.1, False)])
def test_a_companion_is_determined_if_its_error_is_below_half_of_the_prior(error: float, determined: bool) -> None:
    assert CompanionNumber("x", "m", 0.0, error, 0.1).determined is determined


def test_the_file_says_what_was_compared() -> None:
    case = small_case(count=2)
    content = json.loads(json.dumps(content_of(case)))
    assert content["model_error"] == {"frequency": 0.01, "damping": 0.15, "shape": 0.05}
    assert content["rigid_links"] is False
    assert [each["name"] for each in content["recordings"]] == ["posture 1", "posture 2"]
    assert content["recordings"][1]["joints_rad"] == case.recordings[1].q.tolist()
    low, high = content["recordings"][0]["band_hz"]
    assert 5.0 <= low < high <= 45.0


def test_the_improved_robot_has_the_final_fits_changes() -> None:
    final = RobotFit(((JOINT, 0.7),), (), 0.0, 0.0, 0.0, 0.0, ERRORS[:1], (), 1.0)
    case = small_case()
    improved, offset = RobotDetails(case, FITTED, final, FreeFit(final, ())).improved_robot()
    truth = modes_at(with_joint_factor(ROBOT, "3", 0.7), case.recordings[0].q).frequencies
    assert modes_at(improved, case.recordings[0].q).frequencies == pytest.approx(truth)
    assert not offset.any()
