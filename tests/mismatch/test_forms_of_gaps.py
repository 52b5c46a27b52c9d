"""Hardening that saturates and play with soft corners: what they share, and which of them is told."""

import numpy as np
import pytest

from millfrf.mismatch import Hypothesis, JointPhysics, LabError, ModelShape, library
from millfrf.mismatch.inference.search import Proposal
from millfrf.mismatch.inference.settings import EvidenceSettings
from millfrf.mismatch.joints.joint_law import JointMotion
from millfrf.mismatch.models.cause import Cause
from millfrf.mismatch.models.fitting import Fit
from millfrf.mismatch.physics.protocol import reported_name
from millfrf.mismatch.structure.acceptance import plainest, twins_of
from modal_fit import ModalModel

MOTION = JointMotion(reach=1e-3, speed=0.1, deflection=2e-4, velocity=0.02, stiffness=1e6)


def _table(name: str, values: list[float]) -> np.ndarray:
    physics = library()[name]
    assert isinstance(physics, JointPhysics)
    table = physics.law(np.array(values), MOTION).stiffness
    assert table is not None
    return table


def test_they_differ_by_a_linear_spring() -> None:
    numbers = [3e5, 1.5e-4, 2.5]
    difference = _table("saturating_hardening", numbers) - _table("smooth_backlash", numbers)
    np.testing.assert_allclose(difference, 3e5 * MOTION.deflections, atol=1e-9)


def test_soft_corners_grow_sharp() -> None:
    """At the highest sharpness the smooth gap is the sharp one within a few hundredths of its force."""
    smooth, sharp = _table("smooth_backlash", [3e5, 1.5e-4, 12.0]), _table("backlash", [3e5, 1.5e-4])
    assert np.abs(smooth - sharp).max() < 0.06 * np.abs(sharp).max()


def test_small_deflections_harden_like_a_cubic() -> None:
    x = MOTION.deflections
    small = np.abs(x) < 2e-5
    table = _table("saturating_hardening", [3e5, 1.5e-4, 2.0])[small]
    np.testing.assert_allclose(table, 3e5 * x[small] ** 3 / (2 * 1.5e-4**2), atol=2e-2 * np.abs(table).max())


def test_they_are_reported_under_the_name_of_the_cause() -> None:
    assert reported_name(library()["saturating_hardening"]) == "stiffness_hardening"
    assert reported_name(library()["smooth_backlash"]) == "backlash"


@pytest.mark.parametrize(("worse", "chosen"), [(0.4, "plain"), (0.6, "long")])
def test_of_equal_forms_the_one_with_fewer_numbers_is_told(model: ModalModel, worse: float, chosen: str) -> None:
    """As good is what lies within half the least evidence."""
    as_good = EvidenceSettings().as_good

    def option(name: str, added: int, score: float) -> Proposal[Fit]:
        shape = ModelShape(model, LabError())
        for _ in range(added):
            shape = shape.with_mode(model.poles[0] * 2, model.right[0], model.left[0])
        here = Hypothesis(shape, np.zeros(shape.size))
        fitted = Fit(here, (), 0.0, 0.0, score, np.zeros((1, 1)))
        return Proposal(name, {"form": "long" if added else "plain"}, fitted, -score)

    options = [option("gap", 1, -500.0), option("gap", 0, -500.0 + 2 * worse * as_good), option("other", 0, -499.0)]
    best = plainest(options, as_good)
    assert best is not None
    assert best.location["form"] == chosen
    assert best.name == "gap"
    assert plainest([], as_good) is None


@pytest.mark.parametrize(("evidence", "told"), [(995.0, "backlash"), (980.0, "stiffness_hardening")])
def test_of_twins_as_good_as_forms_go_the_one_with_the_less_odd_modes_is_told(
    model: ModalModel, evidence: float, told: str
) -> None:
    """A difference of less than a hundredth of the evidence is a matter of the law's form."""
    shape = ModelShape(model, LabError())

    def option(name: str, score: float, odd: float) -> Proposal[Fit]:
        physics = library()[name]
        here = Hypothesis(shape, np.zeros(shape.size)).with_cause(Cause(physics, np.array([3e5, 1.5e-4, 2.5])))
        return Proposal(reported_name(physics), {}, Fit(here, (), 0.0, odd, -score, np.zeros((1, 1))), score)

    hardens, play = option("saturating_hardening", 1000.0, 300.0), option("smooth_backlash", evidence, 20.0)
    other = option("backlash", 999.0, 0.0)
    assert twins_of(hardens, [hardens, play, other], EvidenceSettings().small)[0].name == told
    assert twins_of(other, [hardens, play, other], EvidenceSettings().small) == [other]
