"""Beside a law in any form a cause of its own keeps what it gains, and one that mends the law's form loses it."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from one_mode_rig import Real, Rig
from scipy.fft import irfft

from estimation import WindowedSpectrum, windowed_spectrum
from mismatch import Cause, LabError, ModelShape, band_of, fit
from mismatch.inference import EvidenceSettings
from mismatch.joints import JointAxis, JointLaw, JointMotion
from mismatch.models import Fit, Hypothesis, predict_lines, with_free_forms
from mismatch.physics import JointPhysics, Parameter, families, library
from mismatch.screening import Gains, gains_beside_laws

LEVELS = (20.0, 40.0)
RIG = Rig()
MOTION = JointMotion(1e-3, 0.06, 1e-2, 0.6, RIG.stiffness)
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


def _cause(physics: JointPhysics, values: Real) -> Cause:
    return Cause(physics, values, "", JointAxis(np.ones(1)), MOTION)


def _law(name: str) -> JointPhysics:
    found = library()[name]
    assert isinstance(found, JointPhysics)
    return found


def _recorded(hidden: _Hidden) -> list[WindowedSpectrum]:
    """Two recordings of a rig with a hidden law, 1 % noise."""
    band, shown = band_of(RIG.model, RIG.rate), []
    shape = ModelShape(RIG.model, LabError())
    truth = Hypothesis(shape, np.zeros(shape.size)).with_cause(_cause(hidden, np.zeros(0)))
    for seed, one in enumerate(RIG.recordings(LEVELS)):
        lines = windowed_spectrum(one, band, 1.0)
        moved = irfft(predict_lines(truth, lines).spectrum, n=lines.padded, axis=0)[: len(one.force)]
        moved += 0.01 * moved.std() * np.random.default_rng(seed).normal(size=moved.shape)
        shown.append(windowed_spectrum(replace(one, response=moved), band, 1.0))
    return shown


def _with_friction(lines: list[WindowedSpectrum]) -> Fit:
    """The library's dry friction, fitted."""
    shape = ModelShape(RIG.model, LabError())
    start = Hypothesis(shape, np.zeros(shape.size)).with_cause(
        _cause(_law("coulomb_friction"), np.array([FRICTION, 2e-3]))
    )
    return fit(lines, start, iterations=15)


def _gains(hidden: _Hidden, *names: str) -> list[Gains]:
    """What second laws would gain beside the library's friction."""
    lines = _recorded(hidden)
    return gains_beside_laws(lines, _with_friction(lines), [_cause(_law(name), np.zeros(0)) for name in names])


OWN = EvidenceSettings().own


def test_a_spring_beside_friction_keeps_its_gain_and_what_imitates_it_does_not() -> None:
    spring, slip = _gains(_Hidden(falls=0.3, softens=0.3), "stiffness_softening", "hysteresis")
    assert spring.held > 500
    assert spring.own(100.0, OWN)
    assert not slip.own(20.0, OWN)


def test_what_mends_the_form_of_friction_loses_its_gain() -> None:
    (mends,) = _gains(_Hidden(falls=0.6, softens=0.0), "quadratic_damping")
    assert mends.held > 50
    assert not mends.own(20.0, OWN)


def test_a_free_form_begins_as_the_law_it_frees() -> None:
    lines = _recorded(_Hidden(falls=0.3, softens=0.1))
    fitted = _with_friction(lines)
    for kinds in ("", "xvmt"):
        free = with_free_forms(fitted.hypothesis, kinds)
        assert free.size > fitted.hypothesis.size
        for one in lines:
            seen, same = (predict_lines(each, one).response for each in (fitted.hypothesis, free))
            np.testing.assert_allclose(same, seen, atol=1e-9 * float(np.abs(seen).max()))


@pytest.mark.parametrize(
    ("name", "kinds"),
    [("coulomb_friction", "v"), ("hysteresis", "m"), ("stiffness_hardening", "x"), ("pose_drift", "t")],
)
def test_families_of_laws(name: str, kinds: str) -> None:
    law = _law(name)
    assert families(law.law(law.starts(MOTION)[0], MOTION)) == kinds
