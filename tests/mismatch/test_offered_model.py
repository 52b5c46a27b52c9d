"""The model that is offered after a diagnosis: the refit where it is better, else the nominal one, and a word on it."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from one_mode_rig import Rig

from millfrf.core import InputError
from millfrf.mismatch import (
    Settings,
    StructureDiagnosis,
    diagnose,
    improved_model_of,
    library,
    predict,
    write_diagnosis,
)
from millfrf.reports.diagnoses.answers import how_sure
from millfrf.steps.diagnose import diagnosis_lines
from millfrf.steps.given import model_of

LEVELS = (20.0, 40.0, 60.0)


def diagnosed(share: float, off: float, levels: tuple[float, ...] = LEVELS) -> StructureDiagnosis:
    """A hardening rig without its law in the library, from a nominal model whose frequency is off by a factor."""
    rig = Rig().stiffened(share, LEVELS[-1])
    known = {name: each for name, each in library().items() if name in ("channel_delay", "gain_error")}
    model = replace(rig.model, poles=off * rig.model.poles, band=(4.0, 22.0))
    return diagnose(model, rig.recordings(levels, 20.0), Settings(causes=known))


def test_a_refit_that_is_better_everywhere_is_kept() -> None:
    diagnosis = diagnosed(0.1, 1.0)
    assert (diagnosis.verdict, diagnosis.content["improved_model"]["model"]) == ("unexplained", "final")
    np.testing.assert_array_equal(improved_model_of(diagnosis).poles, diagnosis.details.final.hypothesis.model.poles)
    assert "The improved model holds refitted modes and no law: they leave " in diagnosis_lines(diagnosis)[-4]
    assert all(each["final"] < each["nominal"] for each in diagnosis.content["improved_model"]["recordings"])


@pytest.mark.parametrize(
    ("share", "held_out_is_better", "worst"),
    [(0.3, False, "level_2"), (0.1, True, "level_3")],  # the latter was fitted, and the refit is worse all the same
)
def test_the_nominal_model_is_kept_where_the_refit_is_worse(
    share: float, held_out_is_better: bool, worst: str, tmp_path: Path
) -> None:
    """A rig that hardens to the frequency that the lab believes: a refit to all levels ends at the low one's."""
    diagnosis = diagnosed(share, 1.05)
    assert diagnosis.verdict == "unexplained"
    assert (diagnosis.improvement.after < diagnosis.improvement.before) is held_out_is_better
    nominal = diagnosis.details.base.hypothesis.shape.nominal
    np.testing.assert_array_equal(improved_model_of(diagnosis).poles, nominal.poles)
    for lines in diagnosis.details.measured:
        errors = [predict(each, lines.recording).total_error for each in (improved_model_of(diagnosis), nominal)]
        assert errors[0] == errors[1]
    sentence = diagnosis.content["improved_model"]["sentence"]
    assert sentence.startswith("The improved model is the nominal model: refitted modes leave ")
    assert f" % of {worst}, the nominal model " in sentence
    assert sentence in diagnosis_lines(diagnosis)
    assert sentence in how_sure(diagnosis)
    write_diagnosis(tmp_path / "diagnosis.json", diagnosis)
    stored = json.loads((tmp_path / "diagnosis.json").read_text())["improved_model"]
    assert (stored["model"], stored["sentence"]) == ("nominal", sentence)
    assert [each["recording"] for each in stored["recordings"]] == ["level_1", "level_2", "level_3"]


def test_the_delay_of_the_chain_stays_in_the_nominal_model() -> None:
    rig, late = Rig(excitation="voltage", response="displacement").stiffened(0.3, LEVELS[-1]), 4
    model = replace(rig.model, poles=1.05 * rig.model.poles, quantity="transfer", unit="m/V", band=(4.0, 22.0))
    model = replace(model, delay=late / rig.rate)
    trials = [replace(each, response=np.roll(each.response, late, axis=0)) for each in rig.recordings(LEVELS, 20.0)]
    diagnosis = diagnose(model, trials, Settings(causes={"gain_error": library()["gain_error"]}))
    assert diagnosis.content["improved_model"]["model"] == "nominal"
    assert improved_model_of(diagnosis) == model
    assert model_of(diagnosis) == (model, "the improved model", list(diagnosis.doubts))
    with pytest.raises(InputError, match="a diagnosis of a cut has no modal model"):
        model_of(replace(diagnosis, compared="cut"))


def test_an_accepted_cause_that_harms_one_recording_is_kept_and_said_to() -> None:
    """Three quiet recordings agree on modes that the loud one contradicts: the answer is told in part."""
    diagnosis = diagnosed(0.1, 1.05, (20.0, 22.0, 24.0, 60.0))
    assert (diagnosis.verdict, [cause.name for cause in diagnosis.physics]) == (
        "partly explained",
        ["modal_parameters"],
    )
    assert improved_model_of(diagnosis).poles[0] == diagnosis.details.final.hypothesis.model.poles[0]
    *quiet, loud = diagnosis.content["improved_model"]["recordings"]
    assert all(each["final"] < each["nominal"] for each in quiet)
    assert loud["final"] > 1.1 * loud["nominal"]
    numbers = f"{100 * loud['final']:.3g} % of level_4, the nominal model {100 * loud['nominal']:.3g} %"
    said = f"The improved model is worse than the nominal one: it leaves {numbers}."
    assert said in diagnosis_lines(diagnosis)
    assert said in how_sure(diagnosis)
