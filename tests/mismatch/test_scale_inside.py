"""The scale of a joint's deflection is a convention where no channel shows it: a prediction does not depend on it."""

from dataclasses import replace

import numpy as np
from hidden_joint import law_of, moved_by, with_law

from mismatch import predict_lines
from mismatch.adapters.structure.told_causes import unknown_scales
from mismatch.inference import AcceptedCause
from mismatch.joints import ModalScales, inside_of


def test_lengths_and_forces_of_a_joint_inside_have_no_scale_of_their_own() -> None:
    """Play of 1.5 times the gap, of a stiffness 2.25 times as small, on modes with parts 1.5 times as large."""
    hidden = with_law(law_of("backlash"), np.array([2e4, 1e-4]))
    cause = hidden.causes[-1]
    assert cause.axis is not None
    assert cause.motion is not None
    inside = inside_of(hidden.model, cause.axis)
    assert inside.scales is not None
    larger = replace(inside, scales=ModalScales(1.5 * inside.scales.seen, 1.5 * inside.scales.pushed))
    motion = replace(cause.motion, reach=1.5 * cause.motion.reach, deflection=1.5 * cause.motion.deflection)
    scaled = replace(cause, axis=larger, motion=motion, values=np.array([2e4 / 1.5**2, 1.5e-4]))
    (line,) = moved_by(hidden, (40.0,))
    one, other = (
        predict_lines(replace(hidden, causes=(each,)), line).response for each in (replace(cause, axis=inside), scaled)
    )
    bare = predict_lines(hidden.without(0), line).response
    assert np.linalg.norm(one - other) < 1e-3 * np.linalg.norm(one - bare)


def test_the_answer_says_so() -> None:
    inside = AcceptedCause("backlash", {"participation": [{"mode_hz": 9.0, "part": 1.0}]}, {}, {}, 900.0)
    (said,) = unknown_scales([inside])
    assert "backlash" in said
    assert unknown_scales([replace(inside, location={"direction": [1.0, 0.0]})]) == ()
