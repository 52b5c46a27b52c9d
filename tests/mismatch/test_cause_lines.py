"""A cause in a line of the terminal: its place is told with the names of the axes."""

from collections.abc import Callable
from dataclasses import replace

from estimation import BandRecording
from millfrf.mismatch import AcceptedCause, StructureDiagnosis
from millfrf.steps.diagnose import diagnosis_lines
from modal_fit import ModalModel


def test_a_direction_at_the_tip_is_told_by_axis(
    small_model: ModalModel,
    trial_of: Callable[[ModalModel, str, float, int], BandRecording],
    hand_made: Callable[[ModalModel, list[BandRecording]], StructureDiagnosis],
) -> None:
    friction = AcceptedCause("coulomb_friction", {"direction": [0.8, -0.6]}, {"friction_n": 12.0}, {}, 90.0)
    gain = AcceptedCause("gain_error", {"channel": "ax"}, {"gain_minus_one": 0.1}, {"gain_minus_one": 0.01}, 50.0)
    result = hand_made(small_model, [trial_of(small_model, "low", 20.0, 1)])
    lines = diagnosis_lines(replace(result, physics=(friction, gain)))
    assert (
        "coulomb_friction (along +0.800 X, -0.600 Y): friction_n 12; odds more than a million to one (evidence 90)"
        in lines
    )
    assert "gain_error (channel ax): gain_minus_one 0.1 ± 0.01; odds more than a million to one (evidence 50)" in lines
