"""What a diagnosis does against its own answer: recordings held out in turn, and the gate of its improved model."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from one_mode_rig import Rig

from estimation import BandRecording
from millfrf.core import InputError
from millfrf.gate import check_model
from millfrf.mismatch import AcceptedCause, Settings, StructureDiagnosis, diagnose, improved_model_of, library
from millfrf.mismatch.inference.diagnosis import HeldOutError
from millfrf.mismatch.structure.held_out_in_turn import worse_than_nominal
from millfrf.reports.diagnoses.answers import held_out_in_turn
from millfrf.steps.diagnose import checked_by_gate
from modal_fit import ModalModel


def test_each_recording_is_held_out_in_turn() -> None:
    """A hardening spring at three levels: without any one recording, the law still predicts it to its noise."""
    rig = Rig().stiffened(0.05, 60.0)
    known = {name: cause for name, cause in library().items() if "stiffness" in name or name == "gain_error"}
    model = replace(rig.model, band=(4.0, 22.0))
    diagnosis = diagnose(model, rig.recordings((20.0, 40.0, 60.0), 20.0), Settings(causes=known))
    assert [cause.name for cause in diagnosis.physics] == ["stiffness_hardening"]
    assert [error.name for error in diagnosis.held_out] == ["level_1", "level_2", "level_3"]
    in_band = np.sqrt((22.0 - 4.0) / (rig.rate / 2))  # white noise of 1 % of the response
    for error in diagnosis.held_out:
        assert error.floor == pytest.approx(0.01 * in_band, rel=0.2)
        assert error.after < 1.6 * error.floor
        assert error.before > 5 * error.after
    (own,) = (error for error in diagnosis.held_out if error.name == diagnosis.improvement.held_out)
    assert own.after == diagnosis.improvement.after
    (sentence,) = held_out_in_turn(diagnosis)
    assert max(diagnosis.held_out, key=lambda error: error.after).name in sentence


def test_causes_that_fail_on_a_held_out_recording_are_doubted() -> None:
    good, bad = HeldOutError("low", 0.2, 0.1, 0.01), HeldOutError("high", 0.3, 0.4, 0.01)
    assert worse_than_nominal([good]) == ""
    assert "without high, the causes leave 40 % of it, the nominal model 30 %" in worse_than_nominal([good, bad])


def test_a_model_that_the_gate_refuses_explains_nothing(
    small_model: ModalModel,
    trial_of: Callable[[ModalModel, str, float, int], BandRecording],
    hand_made: Callable[[ModalModel, list[BandRecording]], StructureDiagnosis],
) -> None:
    """The fitted modes have a reversed response, whose point then moves against its own force: no structure does."""
    result = hand_made(small_model, [trial_of(small_model, "low", 20.0, 1), trial_of(small_model, "high", 60.0, 2)])
    final = result.details.final
    shape, unit = final.hypothesis.shape, final.hypothesis.shape.scales()[0]
    numbers = np.zeros((2, shape.per_mode))
    numbers[:, 1 + 2] = -2 * small_model.right[:, 1].real / unit
    reversed_y = replace(final.hypothesis, u=numbers.ravel())
    cause = AcceptedCause("modal_parameters", {"modes": [1, 2]}, {}, {}, 900.0)
    wrong = replace(
        result,
        verdict="explained",
        physics=(cause,),
        details=replace(result.details, final=replace(final, hypothesis=reversed_y)),
    )
    with pytest.raises(InputError) as refusal:
        check_model(improved_model_of(wrong))
    checked = checked_by_gate(wrong)
    assert (checked.verdict, checked.physics) == ("unexplained", ())
    assert checked.content["improved_model"]["model"] == "nominal"
    assert str(refusal.value).split(":", 1)[1][:20] in checked.doubts[0]
    assert np.array_equal(improved_model_of(checked).right, small_model.right)
    assert checked.candidates[0].name == "modal_parameters"


def test_a_model_that_passes_the_gate_is_left_as_it_is(
    small_model: ModalModel,
    trial_of: Callable[[ModalModel, str, float, int], BandRecording],
    hand_made: Callable[[ModalModel, list[BandRecording]], StructureDiagnosis],
) -> None:
    result = hand_made(small_model, [trial_of(small_model, "low", 20.0, 1)])
    assert checked_by_gate(result) is result
