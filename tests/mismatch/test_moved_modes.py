"""Refitted modes state which poles, rows and columns moved, and explain nothing if they are another structure's."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from estimation import BandRecording
from millfrf.mismatch import Hypothesis, LabError, ModelShape, Settings, StructureDiagnosis, diagnose, library
from millfrf.mismatch.structure.moved_modes import moved_parts
from millfrf.reports.diagnoses.answers import verdict_sentence
from modal_fit import ModalModel

LAB = LabError()


def diagnosed(model: ModalModel, recordings: list[BandRecording]) -> StructureDiagnosis:
    """A diagnosis whose library holds no fault of the wiring."""
    known = {name: cause for name, cause in library().items() if name in ("channel_delay", "gain_error")}
    return diagnose(model, recordings, Settings(causes=known))


@pytest.mark.parametrize("factor", [0.93, 1.07])
def test_a_pole_within_ten_laboratory_errors_is_named_with_its_distance(
    model: ModalModel, linear_trials: list[BandRecording], factor: float
) -> None:
    """The second frequency of the nominal model is off by 7 %, the laboratory's error is 1 %."""
    diagnosis = diagnosed(replace(model, poles=model.poles * [1.0, factor]), linear_trials)
    assert (diagnosis.verdict, [cause.name for cause in diagnosis.physics]) == ("explained", ["modal_parameters"])
    (part, *_) = moved_parts(diagnosis.details.final.hypothesis)
    assert part.part == "frequency of mode 2"
    assert part.errors == pytest.approx(abs(np.log(factor)) / LAB.frequency, rel=0.03)
    assert diagnosis.physics[0].location["moved"][0] == str(part)


@pytest.mark.parametrize(
    ("wrong", "part"),
    [
        (lambda model: replace(model, poles=1.2 * model.poles), "frequency of mode"),
        (lambda model: replace(model, right=model.right * [1.0, -1.0]), "row TCP:+Y"),
        (lambda model: replace(model, left=model.left * [-1.0, 1.0]), "column TCP:+X"),
    ],
)
def test_modes_beyond_ten_laboratory_errors_are_another_structure_or_wiring(
    model: ModalModel, linear_trials: list[BandRecording], wrong: Callable[[ModalModel], ModalModel], part: str
) -> None:
    """Frequencies 20 % off, a response reversed, a force reversed: refitted modes predict all three, and explain none.

    Without the limit each was ``explained`` by ``modal_parameters``.
    """
    diagnosis = diagnosed(wrong(model), linear_trials)
    assert diagnosis.improvement.after < 1.2 * diagnosis.improvement.noise_floor
    assert (diagnosis.verdict, diagnosis.physics) == ("unexplained", ())
    (doubt,) = (text for text in diagnosis.doubts if text.startswith("another structure or another wiring"))
    assert part in doubt
    assert "another structure or another wiring" in verdict_sentence(diagnosis)


def test_a_factor_between_the_vectors_of_a_mode_moves_nothing(model: ModalModel) -> None:
    """``psi l^T`` does not change if psi is multiplied and l divided by a complex number."""
    shape = ModelShape(model, LAB)
    factor = np.array([[1.3 * np.exp(0.4j)], [0.8 * np.exp(-0.9j)]])
    changes = [
        vectors * (change - 1) / unit[:, None]
        for vectors, change, unit in zip((model.right, model.left), (factor, 1 / factor), shape.scales(), strict=True)
    ]
    numbers = [part for change in changes for part in (change.real, change.imag)]
    moved = Hypothesis(shape, np.hstack([np.zeros((2, 2)), *numbers]).ravel())
    assert np.allclose(moved.model.receptance(np.array([8.0, 12.0])), model.receptance(np.array([8.0, 12.0])))
    assert moved_parts(moved)[0].errors < 1e-6
