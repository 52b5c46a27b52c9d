"""A model that states the errors of its modes can be given one more, and be left without it again."""

from dataclasses import replace

import numpy as np

from mismatch import ModelShape, Settings
from modal_fit import ModeErrors

from .one_mode_rig import Rig


def test_a_further_mode_beside_a_model_that_states_its_errors() -> None:
    one = np.full((1, 2), 1e-3)
    model = replace(Rig().model, errors=ModeErrors(one, one, one, one))
    more = ModelShape(model, Settings().lab).with_mode(-1 + 90j, np.ones(1, complex), np.ones(1, complex))
    assert len(more.nominal.poles) == 2
    again, _ = more.without_mode(0, np.zeros(more.size))
    assert len(again.nominal.poles) == 1
    assert len(more.bare.nominal.poles) == 1
