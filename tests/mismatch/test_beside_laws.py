"""Beside a law in any form a cause of its own keeps what it gains, and one that mends the law's form loses it."""

from dataclasses import dataclass

import numpy as np
import pytest
from hidden_joint import MOTION, RIG, at_the_joint, law_of, recorded, with_law
from one_mode_rig import Real

from estimation import WindowedSpectrum
from millfrf.mismatch import JointLaw, Parameter, fit, predict_lines
from millfrf.mismatch.inference.settings import EvidenceSettings
from millfrf.mismatch.joints.joint_law import JointMotion
from millfrf.mismatch.models.fitting import Fit
from millfrf.mismatch.models.model_terms import with_free_forms
from millfrf.mismatch.physics.wider_forms import families
from millfrf.mismatch.screening.linear_causes_fitted import Gains, gains_with_laws

LEVELS = (20.0, 40.0)
FRICTION = 3.0


@dataclass
class _Hidden:
    """Friction that falls with speed by a share (Stribeck), beside a spring that softens by a share."""

    falls: float
    softens: float
    name: str = "hidden"
    equation: str = ""
    source: str = ""
    parameters: tuple[Parameter, ...] = ()
    confusable_with: tuple[str, ...] = ()

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        return ()

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        x, v = motion.deflections, motion.velocities
        friction = FRICTION * np.tanh(v / 2e-3) * (1 - self.falls + self.falls * np.exp(-((v / 0.02) ** 2)))
        spring = self.softens * RIG.stiffness * (x / np.sqrt(1 + (x / 2e-4) ** 2) - x)
        return JointLaw(motion.reach, spring, motion.speed, friction)


def _with_friction(lines: list[WindowedSpectrum]) -> Fit:
    """The library's dry friction, fitted."""
    return fit(lines, with_law(law_of("coulomb_friction"), np.array([FRICTION, 2e-3])), iterations=15)


def _gains(hidden: _Hidden, *names: str) -> list[Gains]:
    """What second laws would gain beside the library's friction."""
    lines = recorded(hidden, LEVELS)
    return gains_with_laws(lines, _with_friction(lines), [at_the_joint(law_of(name), np.zeros(0)) for name in names])


OWN = EvidenceSettings().own


def test_a_spring_beside_friction_keeps_its_gain_and_what_imitates_it_does_not() -> None:
    spring, slip = _gains(_Hidden(falls=0.3, softens=0.3), "stiffness_softening", "hysteresis")
    assert spring.fixed_form > 500
    assert spring.is_independent(100.0, OWN)
    assert not slip.is_independent(20.0, OWN)


def test_what_mends_the_form_of_friction_loses_its_gain() -> None:
    (gain,) = _gains(_Hidden(falls=0.6, softens=0.0), "quadratic_damping")
    assert gain.fixed_form > 50
    assert not gain.is_independent(20.0, OWN)


def test_a_free_form_begins_as_the_law_it_frees() -> None:
    lines = recorded(_Hidden(falls=0.3, softens=0.1), LEVELS)
    fitted = _with_friction(lines)
    for kinds in ("", "xvmt"):
        free = with_free_forms(fitted.hypothesis, kinds)
        assert free.size > fitted.hypothesis.size
        for item in lines:
            seen, same = (predict_lines(each, item).response for each in (fitted.hypothesis, free))
            np.testing.assert_allclose(same, seen, atol=1e-9 * float(np.abs(seen).max()))


@pytest.mark.parametrize(
    ("name", "kinds"),
    [("coulomb_friction", "v"), ("hysteresis", "m"), ("stiffness_hardening", "x"), ("pose_drift", "t")],
)
def test_families_of_laws(name: str, kinds: str) -> None:
    law = law_of(name)
    assert families(law.law(law.starts(MOTION)[0], MOTION)) == kinds
