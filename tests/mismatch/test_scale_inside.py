"""The scale of a joint's deflection is a convention where no channel shows it: a prediction does not depend on it."""

from dataclasses import replace

import numpy as np
import pytest
from hidden_joint import law_of, moved_by, with_law

from mismatch import predict_lines
from mismatch.adapters.structure.told_causes import unknown_scales
from mismatch.inference import AcceptedCause
from mismatch.joints import inside_of
from mismatch.models.scale_of_joints import counted_at_tip, scale_at_tip, scaled

LAWS = {
    "backlash": [2e4, 1e-4],
    "coulomb_friction": [6.0, 2e-3],
    "hysteresis": [6e4, 2e-4, 0.8],
    "pose_drift": [2e4, 0.3, 1e3],
    "presliding_friction": [6.0, 3e-5],
    "quadratic_damping": [3e3],
    "stiffness_hardening": [1.0, 3.0],
    "stiffness_softening": [3e4, 1e-4, 2.0],
}


@pytest.mark.parametrize("name", sorted(LAWS))
def test_lengths_and_forces_of_a_joint_inside_have_no_scale_of_their_own(name: str) -> None:
    """A joint at the tip, told as one inside, in another scale: all predict the same, and the tip's scale is found."""
    hidden = with_law(law_of(name), np.array(LAWS[name]))
    cause = hidden.causes[-1]
    assert cause.axis is not None
    inside = replace(cause, axis=inside_of(hidden.model, cause.axis))
    assert inside.axis is not None
    assert scale_at_tip(inside.axis, hidden.model) == pytest.approx(1.0)
    other = replace(hidden, causes=(scaled(inside, 1.7),))
    counted = counted_at_tip(other)
    np.testing.assert_allclose(counted.causes[-1].values, cause.values, rtol=1e-9)
    (line,) = moved_by(hidden, (40.0,))
    bare = predict_lines(hidden.without(0), line).response
    first, *others = (predict_lines(one, line).response for one in (hidden, other, counted))
    for shown in others:
        assert np.linalg.norm(shown - first) < 2e-3 * np.linalg.norm(first - bare)


def test_the_answer_says_so() -> None:
    inside = AcceptedCause("backlash", {"participation": [{"mode_hz": 9.0, "part": 1.0}]}, {}, {}, 900.0)
    (said,) = unknown_scales([inside])
    assert "backlash" in said
    assert unknown_scales([replace(inside, location={"direction": [1.0, 0.0]})]) == ()
