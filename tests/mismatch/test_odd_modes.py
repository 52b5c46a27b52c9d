"""A gain error beside a hardening joint: modes take it up and look odd, and from the lab's model it is found.

The recordings are integrated by an adaptive Runge-Kutta method that shares nothing with the tool.
"""

from dataclasses import replace

import numpy as np
import pytest
from concealed_recordings import Concealed, forces, structure, trial

from estimation import BandRecording
from millfrf.mismatch import StructureDiagnosis, diagnose
from modal_fit import ModalModel

CUBIC, GAIN = 4e10, 1.4


def _recordings(gain: float) -> list[BandRecording]:
    """Two levels with a cubic spring along an oblique direction; the X response shows ``gain`` times too much."""
    rng, result = np.random.default_rng(8), []
    joint = Concealed(lambda x, v: CUBIC * x**3, np.array([0.8, 0.6]))
    for name, level in (("low", 20.0), ("high", 60.0)):
        force = forces(rng, level, 24.0)
        moved = joint.acceleration(structure(), force) * np.array([gain, 1.0])
        result.append(trial(name, force, moved, rng))
    return result


def _told(gain: float, nominal: ModalModel) -> StructureDiagnosis:
    return diagnose(nominal, _recordings(gain))


@pytest.mark.long
def test_a_gain_that_modes_have_taken_up_is_told_beside_a_law() -> None:
    result = _told(GAIN, structure())
    assert {"stiffness_hardening", "gain_error"} <= {each.name for each in result.physics}
    assert "modal_parameters" not in {each.name for each in result.physics}
    gain = next(each for each in result.physics if each.name == "gain_error")
    assert gain.location == {"channel": "TCP:+X", "role": "response"}
    value, error = next((gain.parameters[key], gain.standard_errors[key]) for key in gain.parameters)
    assert abs(1 + value - GAIN) < 3 * error


@pytest.mark.long
@pytest.mark.parametrize("off", [1.0, 1.08])
def test_modes_that_are_off_ask_for_no_gain(off: float) -> None:
    """Frequencies that the lab has wrong by 8 % look odd, too, and no linear cause brings them back."""
    model = structure()
    result = _told(1.0, replace(model, poles=model.poles * off))
    assert "stiffness_hardening" in {each.name for each in result.physics}
    assert {each.name for each in result.physics} <= {"stiffness_hardening", "modal_parameters"}
