"""A law of free form: it mends what the textbook law lacks where held-out data ask for it, and predicts from a file."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from hidden_joint import MOTION, RIG, law_of, recorded, with_law
from one_mode_rig import Real

from estimation import windowed_spectrum
from millfrf.core import FileFormatError
from millfrf.mismatch import (
    Hypothesis,
    JointLaw,
    JointPhysics,
    LabError,
    ModelShape,
    Parameter,
    Settings,
    diagnose,
    fit,
    improved_model,
    improved_model_of,
    library,
    predict_lines,
)
from millfrf.mismatch.inference.search import Proposal, Search
from millfrf.mismatch.inference.settings import VerdictSettings
from millfrf.mismatch.joints.joint_law import JointMotion
from millfrf.mismatch.models.fitting import Fit
from millfrf.mismatch.models.model_terms import hypothesis_of, with_free_forms
from millfrf.mismatch.physics.wider_forms import FreeForm
from millfrf.mismatch.records.reading import band_of
from millfrf.mismatch.structure.answer import Answer
from millfrf.mismatch.structure.comparison import StructureComparison
from millfrf.mismatch.structure.form_of_law import form_of_law
from millfrf.mismatch.structure.freed_laws import (
    FreedAnswer,
    FreedLaws,
    FreeFormStart,
    free_named_laws,
    free_unproved_law,
    freed_answer,
)
from millfrf.mismatch.structure.held_out import held_out_improvement, recordings_of
from millfrf.mismatch.structure.structured_residual import remainder_of
from millfrf.reports.diagnoses.answers import verdict_sentence
from millfrf.steps.diagnose import diagnosis_lines
from modal_fit import read_modal_model, write_modal_model

LEVELS = (10.0, 20.0, 40.0)
FRICTION = 3.0
PLACES = ({"direction": [1.0]},)


@dataclass
class _Slip:
    """Friction that falls with the speed by a share (Stribeck)."""

    falls: float
    name: str = "slip"
    equation: str = ""
    source: str = ""
    parameters: tuple[Parameter, ...] = ()
    confusable_with: tuple[str, ...] = ()

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        return ()

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        v = motion.velocities
        force = FRICTION * np.tanh(v / 2e-3) * (1 - self.falls + self.falls * np.exp(-((v / 0.03) ** 2)))
        return JointLaw(speed=motion.speed, damping=force)


@dataclass
class _FallingDrag(_Slip):
    """A drag that is viscous at low speed, and falls beyond the typical speed of 0.06 m/s."""

    falls: float = 0.0

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        v = motion.velocities
        return JointLaw(speed=motion.speed, damping=200.0 * v / (1 + (v / 0.05) ** 2))


def _slip(falls: float) -> Hypothesis:
    return with_law(_Slip(falls), np.zeros(0))


def _over_velocity(hypothesis: Hypothesis) -> Real:
    """Force of the law over speeds that are met often, without its linear part; memory has yielded."""
    law, v = hypothesis.laws[0].law(), np.linspace(-0.12, 0.12, 24)
    force = np.interp(v, np.linspace(-law.speed, law.speed, len(law.damping)), law.damping)
    force = force + np.sign(v) * float(law.springs @ law.yields)
    return np.asarray(force - v * (force @ v) / (v @ v))


def _freed(falls: float, *, named: bool = True) -> tuple[Fit, FreedLaws | None]:
    """Dry friction fitted to friction that may fall with speed, and its free form; ``named``: as if it was proved."""
    lines = recorded(_Slip(falls), LEVELS)
    shape = ModelShape(RIG.model, LabError())
    base = fit(lines, Hypothesis(shape, np.zeros(shape.size)), iterations=15)
    dry = fit(lines, with_law(law_of("coulomb_friction"), np.array([FRICTION, 2e-3])), iterations=15)
    both, settings = recordings_of(lines, lines, base.hypothesis), Settings()
    if named:
        worth = held_out_improvement(both, dry.hypothesis, dry.noises, (), settings.proof)
        return dry, free_named_laws(both, FreeFormStart(dry, base, worth, PLACES), (), settings)
    worth = held_out_improvement(both, base.hypothesis, base.noises, (), settings.proof)
    return dry, free_unproved_law(both, FreeFormStart(dry, base, worth, PLACES), (), settings)


@pytest.mark.long
def test_friction_that_falls_with_speed_gets_its_own_form() -> None:
    dry, result = _freed(0.6)
    assert result is not None
    assert result.chance < 0.01
    assert result.ratio > 1.5
    assert result.names == (("coulomb_friction", "along +1.000 X"),)
    (form,) = result.forms
    assert 0.1 < form.distance < 0.9
    assert form.kind.startswith("dissipative")
    assert result.content()["held_out"]["free_form"] == result.held_out.everywhere.after
    # the force that was found is the force that was there, up to a damper that the structure's own may hold
    truth, free, named = (_over_velocity(each) for each in (_slip(0.6), result.fitted.hypothesis, dry.hypothesis))
    assert np.std(free - truth) < 0.5 * np.std(named - truth)


def test_friction_as_in_the_textbook_keeps_its_form() -> None:
    assert _freed(0.0)[1] is None


@pytest.mark.long
def test_a_form_is_told_where_no_law_was_proved() -> None:
    result = _freed(0.6, named=False)[1]
    assert result is not None
    assert result.ratio > 2.0
    assert result.evidence > 1000


def test_a_free_form_predicts_from_a_file(tmp_path: Path) -> None:
    free = with_free_forms(with_law(law_of("coulomb_friction"), np.array([FRICTION, 2e-3])), "xvm")
    cause = free.causes[0]
    values = cause.values + np.append(np.zeros(2), np.random.default_rng(1).normal(size=len(cause.values) - 2))
    free = replace(free, causes=(replace(cause, values=values),))
    write_modal_model(tmp_path / "model.json", improved_model(free))
    again = hypothesis_of(read_modal_model(tmp_path / "model.json"))
    assert isinstance(again.causes[0].physics, FreeForm)
    lines = windowed_spectrum(RIG.recordings((20.0,))[0], band_of(RIG.model, RIG.rate), 1.0)
    seen, same = (predict_lines(each, lines).response for each in (free, again))
    np.testing.assert_allclose(same, seen, atol=1e-9 * float(np.abs(seen).max()))


@pytest.mark.parametrize("location", [{"law": "friction"}, {"law": "coulomb_friction", "families": "q"}, {}])
def test_a_term_of_free_form_that_is_none_is_refused(location: dict[str, str]) -> None:
    model = replace(RIG.model, physics=({"name": "free_form", "location": location, "parameters": {}},))
    with pytest.raises(FileFormatError, match=r"unknown physics|is no law"):
        hypothesis_of(model)


@pytest.mark.parametrize(
    ("name", "kind"),
    [("stiffness_hardening", "elastic"), ("coulomb_friction", "dissipative"), ("hysteresis", "one with")],
)
def test_what_a_force_follows(name: str, kind: str) -> None:
    law = law_of(name)
    (start, *_) = law.starts(MOTION)
    size = 2.0 if name == "coulomb_friction" else 0.1 * RIG.stiffness
    single = with_law(law, np.array([size, *start[1:]]))
    lines = [windowed_spectrum(RIG.recordings((20.0,))[0], band_of(RIG.model, RIG.rate), 1.0)]
    form = form_of_law(single, single, 0, lines)
    assert form.distance < 1e-6
    assert form.kind.startswith(kind)


def _answered(hidden: JointPhysics, most: float) -> FreedAnswer:
    """What becomes of an answer that names dry friction, where it may leave ``most`` times what its free form does."""
    lines = recorded(hidden, LEVELS)
    shape = ModelShape(RIG.model, LabError())
    base = fit(lines, Hypothesis(shape, np.zeros(shape.size)), iterations=15)
    dry = fit(lines, with_law(law_of("coulomb_friction"), np.array([FRICTION, 2e-3])), iterations=15)
    both, settings = (
        recordings_of(lines, lines, base.hypothesis),
        Settings(verdict=VerdictSettings(most_over_free=most)),
    )
    worth = held_out_improvement(both, dry.hypothesis, dry.noises, (), settings.proof)
    result = Search((base, dry), (Proposal("coulomb_friction", PLACES[0], dry, base.score - dry.score),))
    before = remainder_of(base.hypothesis, lines)
    answer = Answer("explained", (), dry, result, remainder_of(dry.hypothesis, lines), worth)
    return freed_answer(answer, StructureComparison(lines, library(), settings, before), both, ())


def test_an_answer_keeps_its_name_and_predicts_with_the_free_form() -> None:
    result = _answered(_Slip(0.3), 100.0)
    assert result.answer.verdict == "explained"
    assert not result.doubt
    assert result.sentence.startswith("Free form: the force of coulomb_friction (along +1.000 X) differs")
    assert result.textbook is not None
    (term,) = improved_model(result.answer.final.hypothesis).physics
    assert (term["name"], term["location"]["law"]) == ("free_form", "coulomb_friction")


def test_a_name_that_leaves_far_more_than_its_free_form_is_not_the_whole() -> None:
    result = _answered(_Slip(0.6), 1.5)
    assert result.answer.verdict == "partly explained"
    assert "does not describe all of the force" in result.doubt


def test_a_drag_that_falls_is_not_named_dry_friction() -> None:
    result = _answered(_FallingDrag(), 100.0)
    assert result.answer.verdict in ("unlisted", "unexplained")
    assert not result.answer.causes
    assert "the law is another one" in result.doubt


@pytest.mark.long
@pytest.mark.parametrize(
    ("falls", "verdict"), [(0.1, "explained"), (0.6, "partly explained"), (0.9, "partly explained")]
)
def test_friction_that_falls_is_named(falls: float, verdict: str) -> None:
    """By 10 % it is dry friction; by more the name leaves five times the noise, which its free form does not."""
    diagnosis = diagnose(RIG.model, [each.recording for each in recorded(_Slip(falls), LEVELS)])
    assert diagnosis.verdict == verdict
    assert diagnosis.physics[0].name == "coulomb_friction"
    assert diagnosis.improvement.after < 0.5 * diagnosis.improvement.refitted
    said = [line for line in diagnosis_lines(diagnosis) if line.startswith("the named law leaves")]
    assert len(said) == (verdict == "partly explained")
    assert all(line.endswith(f"leaves {100 * diagnosis.improvement.after:.3g} %") for line in said)


@pytest.mark.long
def test_a_law_that_nobody_listed_has_no_name_and_predicts() -> None:
    """A force that turns with the speed from braking to driving: modes alone leave ten times the noise."""
    diagnosis = diagnose(RIG.model, [each.recording for each in recorded(_Slip(1.3), LEVELS)])
    assert diagnosis.verdict == "unlisted"
    assert not diagnosis.physics
    assert diagnosis.improvement.after < 1.1 * diagnosis.improvement.noise_floor
    assert diagnosis.improvement.noise_floor < 0.1 * diagnosis.improvement.refitted
    assert diagnosis.content["improved_model"]["model"] == "final"
    assert [each["name"] for each in improved_model_of(diagnosis).physics] == ["free_form"]
    (said,) = (
        line for line in diagnosis_lines(diagnosis) if line.startswith("Outside the library: a force sits in a joint")
    )
    assert "dissipative" in said
    assert verdict_sentence(diagnosis).endswith(said)
