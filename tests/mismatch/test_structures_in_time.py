"""Modes at both ends of a drift, against receptances of the structure with a spring."""

import numpy as np
import pytest
from concealed_recordings import structure

from estimation import BandRecording
from millfrf.gate import check_drifts
from millfrf.mismatch import structures_in_time
from modal_fit import ModalModel

DIRECTION = np.array([0.6, 0.8])


def _with_drift(change: float, nominal_at: float, bend: float = 0.0) -> ModalModel:
    motion = {"deflection": 1e-4, "velocity": 1e-2, "reach": 3e-4, "speed": 3e-2, "stiffness": 1e5}
    term = {
        "name": "pose_drift",
        "location": {"direction": DIRECTION.tolist(), "motion": motion},
        "parameters": {"stiffness_change_n_per_m": change, "nominal_at": nominal_at, "bend_n_per_m": bend},
    }
    plain = structure()
    return ModalModel(plain.poles, plain.right, plain.left, plain.responses, plain.excitations, physics=(term,))


@pytest.mark.parametrize("nominal_at", [0.0, 0.3, 1.0])
def test_both_ends_are_the_structure_with_a_spring(nominal_at: float) -> None:
    change, frequencies = -3e4, np.linspace(4.0, 25.0, 60)
    first, last = structures_in_time(_with_drift(change, nominal_at, bend=5e3))
    plain = structure().receptance(frequencies)
    for end, share in ((first, 0.0), (last, 1.0)):
        spring = change * (share - nominal_at) * np.outer(DIRECTION, DIRECTION)
        expected = np.linalg.solve(np.eye(2) + plain @ spring, plain)
        assert np.abs(end.receptance(frequencies) - expected).max() < 1e-9 * np.abs(expected).max()
        assert end.physics == ()


def test_without_a_drift_there_are_no_ends() -> None:
    assert structures_in_time(structure()) == ()


def test_a_drift_is_predicted_for_recordings_of_the_length_that_it_was_fitted_to() -> None:
    model = _with_drift(-3e4, 0.5)
    model.physics[0]["location"]["motion"]["durations"] = [30.0, 30.0]
    same, half = (BandRecording("rec", 100.0, np.zeros((n, 2)), np.zeros((n, 2)), (), ()) for n in (3000, 1500))
    assert not check_drifts(model, same)
    (warning,) = check_drifts(model, half)
    assert "fitted to 30 s; rec lasts 15 s" in warning
