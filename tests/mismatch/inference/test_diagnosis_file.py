"""Diagnosis files: version 2 comes back as it was, older ones are read, later ones are refused."""

import json
import math
from pathlib import Path
from typing import Any

import pytest

from millfrf.core import FileFormatError
from millfrf.mismatch import AcceptedCause, Candidate, Diagnosis, read_diagnosis, write_diagnosis
from millfrf.mismatch.inference.diagnosis import HeldOutError, Improvement, Remainder
from millfrf.mismatch.inference.diagnosis_file import diagnosis_content


def made(**changed: Any) -> Diagnosis[None]:
    """A diagnosis in which every field says something."""
    numbers: dict[str, Any] = {
        "compared": "robot",
        "verdict": "class",
        "physics": (
            AcceptedCause(
                "payload",
                {"kind": "payload", "unit": "kg", "companions": {"x": {"unit": "m", "spread": 0.1}}},
                {"payload": 8.0, "x": 0.01},
                {"payload": 1.1, "x": 0.06},
                31.5,
                {"payload": {"fit": 0.9, "spread": 0.4, "form": 0.5}},
            ),
        ),
        "candidates": (
            Candidate("payload", 31.5, "fitted", {"kind": "payload"}, {"payload": 8.0}, {"payload": 0.9}),
            Candidate("gravity", -7.5, "screened"),
        ),
        "equivalents": ("links",),
        "improvement": Improvement("a, b", 0.5, 0.4, 0.1, 0.09, 1e-4, (0.1, 0.3), 12.0, "nominal"),
        "before": Remainder(16.0, 15.0),
        "after": Remainder(0.4, 0.3),
        "located": {"bands": [[10.0, 20.0]], "channel": None},
        "details": None,
        "held_out": (HeldOutError("a", 0.6, 0.1, 0.08), HeldOutError("b", 0.4, 0.1, 0.1)),
        "doubts": ("a rests.",),
        "content": {"robot": {"rigid_links": False}},
    }
    return Diagnosis(**numbers | changed)


def test_a_file_comes_back_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "diagnosis.json"
    write_diagnosis(path, made())
    assert read_diagnosis(path) == made()
    content = json.loads(path.read_text())
    assert (content["format"], content["format_version"]) == ("millfrf.diagnosis", 2)
    assert content["leftover_share"] == 0.4
    assert content["robot"] == {"rigid_links": False}


def test_what_is_not_finite_stands_as_null_and_comes_back_as_nan(tmp_path: Path) -> None:
    path = tmp_path / "diagnosis.json"
    cause = AcceptedCause("links", {"direction": None}, {"links": 1.1}, {"links": math.inf}, 30.0)
    gain = Improvement("a", 0.5, 0.5, 0.1, math.nan, 1.0, (math.nan, 0.3))
    write_diagnosis(path, made(physics=(cause,), improvement=gain, before=Remainder(math.nan, 15.0)))
    content = json.loads(path.read_text(), parse_constant=pytest.fail)
    assert content["physics"][0]["standard_errors"] == {"links": None}
    assert content["improvement"]["noise_floor"] is None
    assert content["remainder"]["before"] == {"share": None, "size": 15.0}
    back = read_diagnosis(path)
    assert math.isnan(back.physics[0].standard_errors["links"])
    assert back.physics[0].location == {"direction": None}  # there null is no number
    assert math.isnan(back.improvement.noise_floor)
    assert math.isnan(back.improvement.interval[0])
    assert back.improvement.interval[1] == 0.3
    assert math.isnan(back.before.share)
    assert diagnosis_content(back) | {"content_sha256": content["content_sha256"]} == content


OLD_STRUCTURE: dict[str, Any] = {
    "format": "millfrf.diagnosis",
    "format_version": 1,
    "verdict": "explained",
    "physics": [
        {
            "name": "cubic_stiffness",
            "location": {"direction": [1.0, 0.0]},
            "parameters": {"cubic_n_per_m3": 2e12},
            "standard_errors": {"cubic_n_per_m3": 1e11},
            "evidence": 812.0,
        }
    ],
    "candidates": [{"name": "cubic_stiffness", "evidence": 812.0, "stage": "fitted"}],
    "equivalents": ["play"],
    "located": {"bands": [[10.0, 20.0]]},
    "leftover_share": 0.02,
    "improvement": {
        "held_out": "mid",
        "before": 0.5,
        "refitted": 0.4,
        "after": 0.1,
        "noise_floor": 0.09,
        "p_value": 0.001,
        "interval": [0.1, 0.3],
        "evidence": 40.0,
        "against": "refitted",
    },
    "compared_band": {"low": 10.0, "high": 90.0, "why": "the band in which the model holds"},
    "warnings": ["fx rests."],
}


def written(folder: Path, content: Any) -> Path:
    path = folder / "old.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def test_version_1_is_read(tmp_path: Path) -> None:
    result = read_diagnosis(written(tmp_path, OLD_STRUCTURE))
    assert result.compared == "structure"
    assert result.physics[0].parameters == {"cubic_n_per_m3": 2e12}
    assert result.physics[0].error_parts == {}
    assert result.candidates == (Candidate("cubic_stiffness", 812.0, "fitted"),)
    assert result.leftover == 0.02
    assert math.isnan(result.before.share)  # the older format does not say
    assert result.improvement.interval == (0.1, 0.3)
    assert result.doubts == ("fx rests.",)
    assert result.content == {"compared_band": OLD_STRUCTURE["compared_band"]}
    cut = read_diagnosis(written(tmp_path, OLD_STRUCTURE | {"cut": {"compared": "cutting force"}}))
    assert cut.compared == "cut"
    assert cut.content["cut"] == {"compared": "cutting force"}


PAYLOAD = {
    "name": "payload",
    "kind": "payload",
    "unit": "kg",
    "number": 8.0,
    "standard_error": 1.3,
    "evidence": 31.5,
    "fitted_error": 1.2,
    "spread": 0.4,
    "form": 0.3,
    "beside": [{"name": "place x from the tip", "unit": "m", "number": 0.01, "standard_error": 0.06, "spread": 0.1}],
    "stage": "",
}
GRAVITY = PAYLOAD | {
    "name": "gravity",
    "kind": "gravity",
    "unit": "m/s^2",
    "number": 9.8,
    "standard_error": None,
    "evidence": -7.0,
    "beside": [],
}
OLD_ROBOT: dict[str, Any] = {
    "format": "millfrf.robot_diagnosis",
    "format_version": 1,
    "verdict": "class",
    "causes": [PAYLOAD],
    "equivalents": ["links"],
    "candidates": [PAYLOAD | {"stage": "beaten by links on what was held out"}, GRAVITY],
    "excess": {"before": 16.0, "after": 0.4},
    "p_value": 1e-5,
    "held_out": [
        {"name": "a", "before": 0.3, "after": 0.06, "free": 0.03},
        {"name": "b", "before": 0.4, "after": 0.08, "free": 0.04},
    ],
    "rigid_links": True,
    "model_error": {"frequency": 0.01, "damping": 0.15, "shape": 0.05},
    "recordings": [{"name": "a", "joints_rad": [0.0]}, {"name": "b", "joints_rad": [0.1]}],
    "warnings": ["a rests."],
}


def test_the_robots_older_format_is_read(tmp_path: Path) -> None:
    result = read_diagnosis(written(tmp_path, OLD_ROBOT))
    assert (result.compared, result.verdict, result.equivalents) == ("robot", "class", ("links",))
    cause = result.physics[0]
    assert cause.parameters == {"payload": 8.0, "place x from the tip": 0.01}
    assert cause.standard_errors == {"payload": 1.3, "place x from the tip": 0.06}
    assert cause.error_parts == {"payload": {"fit": 1.2, "spread": 0.4, "form": 0.3}}
    companions = {"place x from the tip": {"unit": "m", "spread": 0.1}}
    assert cause.location == {"kind": "payload", "unit": "kg", "companions": companions}
    assert [each.stage for each in result.candidates] == ["beaten by links on what was held out", "fitted"]
    assert math.isnan(result.candidates[1].standard_errors["gravity"])
    assert result.before == Remainder(16.0, 16.0)
    assert result.leftover == 0.4
    assert result.held_out == (HeldOutError("a", 0.3, 0.06, 0.03), HeldOutError("b", 0.4, 0.08, 0.04))
    gain = result.improvement
    root = math.sqrt(0.5)  # root mean square of 0.3 and 0.4 is 0.5 sqrt(1/2)
    assert (gain.before, gain.after, gain.noise_floor) == pytest.approx((0.5 * root, 0.1 * root, 0.05 * root))
    assert gain.p_value == 1e-5
    assert math.isnan(gain.interval[0])
    assert result.doubts == ("a rests.",)
    assert result.content["robot"]["rigid_links"] is True
    assert result.content["robot"]["recordings"] == OLD_ROBOT["recordings"]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (OLD_STRUCTURE | {"format_version": 3}, "version 3; expected is 'millfrf.diagnosis' up to version 2"),
        (OLD_STRUCTURE | {"format": "millfrf.frf"}, "'millfrf.frf'"),
        (OLD_STRUCTURE | {"format_version": ""}, "version ''"),
        (OLD_STRUCTURE | {"format": []}, "'[]'"),
        (OLD_STRUCTURE | {"physics": 3}, "lacks a part of a diagnosis"),
        ([1, 2], "old.json holds no JSON object; give a diagnosis made by diagnose"),
        ("{", "old.json is not JSON; give a diagnosis made by diagnose"),
        ({"format": "millfrf.diagnosis", "format_version": 2, "verdict": "none"}, "lacks a part of a diagnosis"),
        ({"format": "millfrf.robot_diagnosis", "format_version": 1}, "lacks a part of a diagnosis"),
    ],
)
def test_what_is_no_diagnosis_is_refused(tmp_path: Path, content: Any, message: str) -> None:
    with pytest.raises(FileFormatError, match=r"old\.json") as refused:
        read_diagnosis(written(tmp_path, content))
    assert message in str(refused.value)


@pytest.mark.parametrize(
    ("part", "value", "message"),
    [
        ("improvement", {"before": "text"}, "before: Input should be a valid number"),
        ("improvement", {"interval": [1.0]}, "interval.1: Field required"),
        ("physics", {"name": -(10**9)}, "name: Input should be a valid string"),
        ("physics", {"parameters": {"payload": []}}, "parameters.payload: Input should be a valid number"),
        ("physics", {"location": None}, "location: Input should be a valid"),
        ("candidates", {"evidence": "much"}, "evidence: Input should be a valid number"),
        ("held_out", {"floor": {}}, "floor: Input should be a valid number"),
    ],
)
def test_a_field_of_another_type_is_refused(tmp_path: Path, part: str, value: Any, message: str) -> None:
    """Before: "the program met something that it does not foresee" in `inspect` and in the report."""
    content = json.loads(json.dumps(diagnosis_content(made())))
    (content[part][0] if isinstance(content[part], list) else content[part]).update(value)
    with pytest.raises(FileFormatError, match="lacks a part of a diagnosis: ") as refused:
        read_diagnosis(written(tmp_path, content))
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)
