"""Numbers that a law holds within limits of the motion are reported as the law goes by them."""

import numpy as np
import pytest

from mismatch.joints.joint_law import JointMotion
from mismatch.physics import JointPhysics, LimitedPhysics, library
from mismatch.physics.protocol import DRY

MOTION = JointMotion(reach=1e-3, speed=0.1, deflection=2e-4, velocity=0.02, stiffness=1e6)


@pytest.mark.parametrize(
    ("name", "values", "place", "limit"),
    [
        ("coulomb_friction", [10.0, 5.0], 1, DRY * MOTION.velocity),
        ("presliding_friction", [10.0, 5.0], 1, DRY * MOTION.deflection),
        ("hysteresis", [1e5, 1e-9, 0.8], 1, DRY * MOTION.deflection),
    ],
)
def test_beyond_its_limit_a_number_changes_nothing(name: str, values: list[float], place: int, limit: float) -> None:
    physics = library()[name]
    assert isinstance(physics, JointPhysics)
    assert isinstance(physics, LimitedPhysics)
    held = physics.held(np.array(values), MOTION)
    assert physics.strained(np.array(values), MOTION)
    assert not physics.strained(held, MOTION)
    assert held[place] == pytest.approx(limit)
    farther = np.array(values)
    farther[place] *= 3 if values[place] > limit else 1 / 3
    laws = [physics.law(np.array(v), MOTION) for v in (values, held, farther)]
    for law in laws[1:]:
        np.testing.assert_allclose(law.damping, laws[0].damping)
        np.testing.assert_allclose(law.springs, laws[0].springs)
        np.testing.assert_allclose(law.yields, laws[0].yields)
