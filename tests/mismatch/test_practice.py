"""The practice cases of the shared folder: every verdict, and the error on the recording that no fit has seen."""

import json
from pathlib import Path

import pytest

from millfrf.mismatch import diagnose, improved_model_of, predict, read_recording, read_recordings
from modal_fit import read_modal_model


@pytest.mark.slow
@pytest.mark.shared_data
@pytest.mark.parametrize("number", range(18))
def test_practice_case(shared_data: Path, number: int) -> None:
    """Truth is opened after the diagnosis; the improved model must lower the error wherever there is an effect."""
    folder = shared_data.parent / "practice" / f"case_{number:02d}"
    model = read_modal_model(folder / "nominal.json")
    diagnosis = diagnose(model, read_recordings([folder / f"{level}.h5" for level in ("low", "mid", "high")], model))
    truth = json.loads((folder.parent / "truth.json").read_text())[folder.name]["effect"]
    if truth in ("none", "unexplained"):
        assert diagnosis.verdict == truth
        assert diagnosis.physics == ()
        return
    assert diagnosis.verdict == "explained"
    assert [cause.name for cause in diagnosis.physics] == [truth]
    unseen = read_recording(folder / "unseen.h5", model)
    before, after = predict(model, unseen), predict(improved_model_of(diagnosis), unseen)
    assert after.total_error < before.total_error
