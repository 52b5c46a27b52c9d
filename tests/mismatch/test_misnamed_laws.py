"""A law whose force has another form and grows with another power does not keep its name."""

from typing import Any, cast

import numpy as np
import pytest
from hidden_joint import MOTION, law_of, with_law

from millfrf.mismatch.structure.form_of_law import FormOfLaw
from millfrf.mismatch.structure.freed_laws import FreedLaws

FRICTION, GAP = ("coulomb_friction", [3.0, 0.01 * MOTION.velocity]), ("backlash", [1e3, 0.2 * MOTION.deflection, 2.0])


def freed(law: tuple[str, list[float]], distance: float, growth: float, law_growth: float) -> FreedLaws:
    """A free form that differs from the law by ``distance`` of its size; nothing else of it is compared."""
    name, values = law
    form = FormOfLaw(distance, 0.5, 0.9, 0.8, growth, law_growth)
    unused = cast("Any", None)
    named = with_law(law_of(name), np.array(values))
    return FreedLaws(unused, named, unused, unused, 0.0, 100.0, ((name, ""),), (form,))


@pytest.mark.parametrize(
    ("law", "distance", "growth", "law_growth", "misnamed"),
    [
        (FRICTION, 0.64, 1.5, 0.4, True),  # a drag that falls with speed
        (FRICTION, 0.3, 1.5, 0.4, False),  # it describes nine tenths of the power
        (FRICTION, 0.64, -0.25, 0.0, False),  # dry friction that falls with speed
        (GAP, 0.69, 1.6, 1.0, False),  # a gap of its own size grows with any power
    ],
)
def test_a_friction_of_another_form_and_growth_is_misnamed(
    law: tuple[str, list[float]], distance: float, growth: float, law_growth: float, *, misnamed: bool
) -> None:
    sentence = freed(law, distance, growth, law_growth).misnamed
    assert ("the law is another one" in sentence) == misnamed
