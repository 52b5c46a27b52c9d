"""Numbers that a law holds within limits of the motion are reported as the law goes by them."""

import numpy as np
import pytest
from hidden_joint import MOTION as RIG_MOTION
from hidden_joint import at_the_joint, law_of, moved_by, with_law
from one_mode_rig import Rig

from millfrf.mismatch import AcceptedCause, Hypothesis, JointPhysics, LabError, ModelShape, Settings, fit, library
from millfrf.mismatch.inference.search import Proposal, Search
from millfrf.mismatch.inference.settings import EvidenceSettings
from millfrf.mismatch.joints.joint_law import JointMotion
from millfrf.mismatch.models.cause import Cause
from millfrf.mismatch.models.fitting import Fit
from millfrf.mismatch.physics.protocol import DRY, LimitedPhysics
from millfrf.mismatch.screening.joint_starts import laws_beyond, laws_in_place
from millfrf.mismatch.structure.acceptance import undetermined_beyond_limits, undetermined_causes
from millfrf.mismatch.structure.answer import equivalents_of_answer

MOTION = JointMotion(reach=1e-3, speed=0.1, deflection=2e-4, velocity=0.02, stiffness=1e6)
LEVELS = (20.0, 60.0)


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
    held = physics.limited(np.array(values), MOTION)
    assert physics.beyond_limits(np.array(values), MOTION)
    assert not physics.beyond_limits(held, MOTION)
    assert held[place] == pytest.approx(limit)
    farther = np.array(values)
    farther[place] *= 3 if values[place] > limit else 1 / 3
    laws = [physics.law(np.array(v), MOTION) for v in (values, held, farther)]
    for law in laws[1:]:
        np.testing.assert_allclose(law.damping, laws[0].damping)
        np.testing.assert_allclose(law.springs, laws[0].springs)
        np.testing.assert_allclose(law.yields, laws[0].yields)


@pytest.mark.parametrize(
    ("name", "truth", "start"),
    [
        ("coulomb_friction", [6.0, 2e-3], [6.0, 0.05]),
        ("presliding_friction", [6.0, 3e-5], [6.0, 5e-4]),
        ("hysteresis", [6e4, 2e-4, 0.8], [6e4, 2e-5, 0.8]),
    ],
)
def test_a_fit_that_begins_beyond_a_limit_finds_back(name: str, truth: list[float], start: list[float]) -> None:
    """Nothing changes beyond a limit, and a difference quotient there is zero: the step aside goes inwards."""
    law = law_of(name)
    hidden = with_law(law, np.array(truth))
    assert isinstance(law, LimitedPhysics)
    assert law.beyond_limits(np.array(start), RIG_MOTION)
    result = fit(moved_by(hidden, LEVELS), with_law(law, np.array(start)), iterations=20).hypothesis.causes[-1]
    assert not law.beyond_limits(result.values, RIG_MOTION)
    np.testing.assert_allclose(result.values[:2], truth[:2], rtol=0.1)


def test_numbers_stop_at_their_limits() -> None:
    """A fit's step leads hardly beyond a limit: far enough to tell that more is asked for."""
    law = law_of("coulomb_friction")
    limit = DRY * RIG_MOTION.velocity
    inside = at_the_joint(law, np.array([6.0, 0.5 * limit]))
    assert not inside.blocked().any()
    stepped = inside.stepped(inside.coordinates() + np.array([0.0, 9.0]))
    assert stepped.values[1] == pytest.approx(limit, rel=1e-3)
    assert isinstance(law, LimitedPhysics)
    assert law.beyond_limits(stepped.values, RIG_MOTION)
    assert stepped.blocked().tolist() == [0.0, 1.0]
    assert (stepped.difference_steps() < 0).tolist() == [False, True]


@pytest.mark.parametrize(
    ("name", "truth", "equivalents"),
    [
        ("presliding_friction", [6.0, 3e-5], ("coulomb_friction",)),
        ("hysteresis", [15e3, 4e-4, 0.8], ()),
    ],
)
def test_at_the_limit_of_its_name_a_law_is_told_with_the_law_beyond(
    name: str, truth: list[float], equivalents: tuple[str, ...]
) -> None:
    """Friction that slides almost at once, fitted as hysteresis, ends at its limit; hysteresis does not."""
    begun = with_law(law_of("hysteresis"), np.array([2e4, 3e-4, 0.8]))
    fitted = fit(moved_by(with_law(law_of(name), np.array(truth)), LEVELS), begun, iterations=20)
    search = Search((fitted, fitted), (Proposal("hysteresis", {}, fitted, 100.0),))
    stated = [AcceptedCause("hysteresis", {}, {}, {}, 100.0)]
    assert equivalents_of_answer(search, stated, EvidenceSettings()) == equivalents
    assert equivalents_of_answer(search, [], EvidenceSettings()) == ()


@pytest.mark.parametrize(("name", "truth"), [("presliding_friction", [6.0, 3e-5]), ("hysteresis", [15e3, 4e-4, 0.8])])
def test_the_law_beyond_a_limit_is_fitted_in_its_place(name: str, truth: list[float]) -> None:
    """Friction that was fitted as hysteresis explains more under its own name; true hysteresis asks for no other."""
    begun = with_law(law_of("hysteresis"), np.array([2e4, 3e-4, 0.8]))
    lines = moved_by(with_law(law_of(name), np.array(truth)), LEVELS)
    current, fitted = fit(lines, begun.without(0)), fit(lines, begun, iterations=40)
    best = Proposal("hysteresis", {}, fitted, current.score - fitted.score)
    laws = [each for each in library().values() if isinstance(each, JointPhysics)]
    result = laws_beyond(lines, current, best, laws, Settings())
    if name == "hysteresis":
        assert result == []
        return
    assert {each.name for each in result} == {"coulomb_friction"}
    assert max(each.evidence for each in result) > best.evidence + 20


def test_another_form_of_a_law_is_fitted_in_its_place() -> None:
    """A power law was fitted as a spring that saturates; in its place the power law explains more."""
    power = law_of("stiffness_hardening")
    lines = moved_by(with_law(power, np.array([1.0, 3.0])), LEVELS)
    begun = with_law(law_of("saturating_hardening"), np.array([1e3, 2e-3, 2.0]))
    current, fitted = fit(lines, begun.without(0)), fit(lines, begun, iterations=20)
    best = Proposal("stiffness_hardening", {}, fitted, current.score - fitted.score)
    (result,) = laws_in_place(lines, current, best, [power], Settings())
    assert result.evidence > best.evidence
    assert result.fitted.hypothesis.causes[-1].values[1] == pytest.approx(3.0, rel=0.02)


@pytest.mark.parametrize(("error", "evidence", "undetermined"), [(0.7, 60.0, [0]), (0.3, 60.0, []), (0.7, 120.0, [])])
def test_a_linear_cause_whose_number_may_be_none_is_not_reported(
    error: float, evidence: float, undetermined: list[int]
) -> None:
    """A corner of 0.08 Hz, far below the band, with an error of 70 % of it; large evidence decides without a number."""
    rig = Rig()
    shape = ModelShape(rig.model, LabError())
    corner = Cause(library()["ac_coupling"], np.array([0.08]), "")
    hypothesis = Hypothesis(shape, np.zeros(shape.size), (corner,))
    step = corner.physics.parameters[0].unit_step
    covariance = np.diag([*np.zeros(shape.size), (error / step) ** 2])
    fitted = Fit(hypothesis, (), 0.0, 0.0, 0.0, covariance)
    assert undetermined_causes(fitted, [evidence], EvidenceSettings()) == undetermined


@pytest.mark.parametrize(("smooth", "error", "named"), [(0.2, 0.2, True), (0.2, 0.6, False), (0.05, 0.6, True)])
def test_a_friction_whose_plateau_is_not_seen_is_not_named(smooth: float, error: float, *, named: bool) -> None:
    """Its smoothing speed is beyond a tenth of the joint's speed, and the force at which it slides not determined."""
    values = np.array([2.0, smooth * RIG_MOTION.velocity])
    hypothesis = with_law(law_of("coulomb_friction"), values)
    cause = AcceptedCause("coulomb_friction", {}, {"friction_n": 2.0}, {"friction_n": 2.0 * error}, 500.0)
    sentence = undetermined_beyond_limits(hypothesis, [cause])
    assert ("coulomb_friction is not shown" in sentence) != named


def test_between_friction_and_hysteresis_a_limit_is_a_matter_of_degree() -> None:
    values = np.array([1e5, 1e-4 * RIG_MOTION.deflection, 0.8])
    cause = AcceptedCause("hysteresis", {}, {"stiffness_n_per_m": 1e5}, {"stiffness_n_per_m": 1e6}, 500.0)
    assert not undetermined_beyond_limits(with_law(law_of("hysteresis"), values), [cause])
