"""A diagnosis in the hand: four lines of text, equality by value, pickles, and fields that agree with each other."""

import html
import math
import pickle
from collections.abc import Callable, Mapping
from dataclasses import FrozenInstanceError, dataclass, fields, replace
from functools import partial
from itertools import pairwise, product
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from estimation import BandRecording
from millfrf.core.results import same_values
from millfrf.mismatch import AcceptedCause, Candidate, Diagnosis, Settings, StructureDiagnosis
from millfrf.mismatch.inference.diagnosis import VERDICTS, Findings, HeldOutError, Improvement, Remainder, verdict_of
from millfrf.mismatch.inference.numerics import signed_ranks
from millfrf.mismatch.inference.search import Proposal, Round, Search, search
from millfrf.mismatch.inference.settings import VerdictSettings
from millfrf.mismatch.location.residual_view import residual_view
from modal_fit import ModalModel

Real = NDArray[np.float64]

CAUSE = AcceptedCause("play", {"direction": [1.0, 0.0]}, {"gap_m": 1.25e-5}, {"gap_m": 2e-7}, 812.0)
GAIN = Improvement("mid", 0.5, 0.4, 0.125, 0.09, 0.001, (0.2, 0.3), 40.0)


def made(**changed: Any) -> Diagnosis[Any]:
    """A diagnosis with every field filled."""
    whole: dict[str, Any] = {
        "compared": "structure",
        "verdict": "explained",
        "physics": (CAUSE,),
        "candidates": (Candidate("play", 812.0, "fitted"), Candidate("friction", 3.0, "screened")),
        "equivalents": ("friction",),
        "improvement": GAIN,
        "before": Remainder(0.5, 12.0),
        "after": Remainder(0.01, 0.2),
        "located": {"bands": [[10.0, 20.0]]},
        "details": {"spectrum": np.arange(6.0).reshape(2, 3), "law": partial(np.multiply, np.ones(2))},
        "held_out": (HeldOutError("mid", 0.5, 0.125, 0.09),),
        "doubts": ("fx rests.",),
        "content": {"compared_band": {"low": 10.0}},
    }
    return Diagnosis(**whole | changed)


def test_four_lines_say_what_was_found() -> None:
    assert repr(made()).splitlines() == [
        "Diagnosis of a structure: explained",
        "  play (direction [1.0, 0.0]) (cannot be distinguished from friction)",
        "  error on mid: 50 % nominal, 12.5 % improved, 9 % noise",
        "  1 warning: fx rests.",
    ]
    quiet = made(verdict="none", physics=(), equivalents=(), doubts=())
    assert repr(quiet).splitlines()[1:2] == ["  no cause"]
    assert len(repr(quiet).splitlines()) == 3


def test_a_place_without_a_value_is_not_told() -> None:
    """The number of a robot's joint has no unit."""
    cause = AcceptedCause("joint 3 stiffness", {"kind": "stiffness", "unit": ""}, {}, {}, 50.0)
    assert repr(made(physics=(cause,), equivalents=())).splitlines()[1] == "  joint 3 stiffness (kind stiffness)"


WORDS = st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=12)
NUMBERS = st.dictionaries(WORDS, st.floats(), max_size=3)
CAUSES = st.lists(st.builds(AcceptedCause, WORDS, st.just({}), NUMBERS, NUMBERS, st.floats()), max_size=30)


@given(CAUSES, st.lists(WORDS, max_size=5), st.sampled_from(VERDICTS))
def test_no_content_takes_more_than_four_lines_or_breaks_the_table(
    causes: list[AcceptedCause], doubts: list[str], verdict: str
) -> None:
    result = made(physics=tuple(causes), doubts=tuple(doubts), verdict=verdict)
    lines = repr(result).splitlines()
    assert 3 <= len(lines) <= 4
    assert lines[0].endswith(f": {verdict}")
    assert all(each.name in lines[1] for each in causes)
    table = result._repr_html_()
    shown = [(cause, name) for cause in causes for name in cause.parameters][:20]
    assert table.count("<td") == 4 * len(shown) + (sum(len(each.parameters) for each in causes) > 20)
    assert all(html.escape(f"{cause.parameters[name]:.4g}") in table for cause, name in shown)
    assert table.count("<div>") == table.count("</div>") == 1


OTHERS: Mapping[str, Any] = {
    "compared": "robot",
    "verdict": "class",
    "physics": (replace(CAUSE, evidence=811.0),),
    "candidates": (),
    "equivalents": (),
    "improvement": replace(GAIN, interval=(0.2, 0.31)),
    "before": Remainder(0.5, 13.0),
    "after": Remainder(0.02, 0.2),
    "located": {"bands": [[10.0, 21.0]]},
    "details": {"spectrum": np.arange(6.0), "law": partial(np.multiply, np.ones(2))},
    "held_out": (),
    "doubts": (),
    "content": {},
}


def test_equal_content_is_equal_and_any_other_field_is_not() -> None:
    assert made() == made()
    assert {each.name for each in fields(Diagnosis)} == set(OTHERS)
    for name, value in OTHERS.items():
        assert made() != made(**{name: value}), name
    assert made() != made(details=made().details | {"law": partial(np.multiply, np.zeros(2))})
    assert made() != made().physics
    nowhere = partial(made, improvement=replace(GAIN, noise_floor=math.nan), before=Remainder(math.nan, math.nan))
    assert nowhere() == nowhere()


def test_it_cannot_be_changed_nor_hashed() -> None:
    with pytest.raises(FrozenInstanceError):
        made().verdict = "none"  # type: ignore[misc]
    with pytest.raises(TypeError):
        hash(made())


@pytest.mark.parametrize("protocol", range(2, pickle.HIGHEST_PROTOCOL + 1))
def test_a_pickle_comes_back_equal(protocol: int) -> None:
    again = pickle.loads(pickle.dumps(made(), protocol))
    assert again == made()
    assert repr(again) == repr(made())


def test_a_live_diagnosis_of_a_structure_comes_back_with_its_fits(
    small_model: ModalModel,
    trial_of: Callable[[ModalModel, str, float, int], BandRecording],
    hand_made: Callable[[ModalModel, list[BandRecording]], StructureDiagnosis],
) -> None:
    """Fits, recordings and maps come back as they are, and so does what is computed from them."""
    result = hand_made(small_model, [trial_of(small_model, "low", 1.0, 1), trial_of(small_model, "high", 3.0, 2)])
    result = replace(result, details=replace(result.details, view=residual_view(result.details, False)))
    again = pickle.loads(pickle.dumps(result))
    assert again == result
    assert same_values(residual_view(again.details, False).after, result.details.view.after)
    changed = replace(result.details.base, misfit=1.0)
    assert again != replace(result, details=replace(result.details, base=changed))


@pytest.mark.parametrize("partly", [0.5, 1.0])
def test_every_verdict_that_findings_give_is_one_of_the_list(partly: float) -> None:
    sizes = [Remainder(share, size) for share, size in product((0.01, 0.5), (0.1, 3.0, 10.0))]
    flags = product(sizes, sizes, *[(False, True)] * 4)
    given_ = {verdict_of(Findings(*each), VerdictSettings(partly=partly)) for each in flags}
    assert given_ <= set(VERDICTS)
    assert given_ >= {"none", "explained", "unexplained"}


@dataclass(frozen=True)
class Levels:
    """Means of groups of readings with noise of variance 1; a group whose mean is free is a cause."""

    readings: Real
    free: tuple[int, ...] = ()

    @property
    def score(self) -> float:
        return float(np.sum(self.rest(0) ** 2)) + len(self.free) * math.log(self.readings[0].size)

    def rest(self, half: int) -> Real:
        """What is left of one half by the means of the first half, (n_groups, n)."""
        means = [each.mean() if k in self.free else 0.0 for k, each in enumerate(self.readings[0])]
        return np.asarray(self.readings[half] - np.array(means)[:, None])


@dataclass(frozen=True)
class Groups:
    """Which groups have a mean?"""

    settings: Settings

    def finished(self, found: Search[Levels]) -> bool:
        return False

    def round(self, found: Search[Levels]) -> Round[Levels]:
        here = found.current
        further = [replace(here, free=(*here.free, k)) for k in range(len(here.readings[0])) if k not in here.free]
        proposals = [Proposal(f"group {one.free[-1]}", {}, one, here.score - one.score) for one in further]
        proposals.sort(key=lambda one: -one.evidence)
        best = proposals[0] if proposals and proposals[0].evidence > self.settings.evidence.least else None
        return Round(tuple(proposals), best, tuple(Candidate(one.name, one.evidence, "fitted") for one in proposals))

    def without(self, found: Search[Levels], place: int) -> Levels:
        return replace(found.current, free=tuple(each for k, each in enumerate(found.current.free) if k != place))

    def needed(self, current: Levels, base: Levels) -> float:
        return self.settings.evidence.least


def diagnosed(readings: Real) -> Diagnosis[Search[Levels]]:
    result = search(Groups(Settings()), Levels(readings), lambda text: None)
    before, after = (each.rest(1).ravel() ** 2 for each in (result.base, result.current))
    size = math.sqrt(float(np.mean(readings[1] ** 2)))
    errors = [math.sqrt(float(np.mean(each))) / size for each in (before, before, after)]
    gain = Improvement("second half", *errors, 1 / size, signed_ranks(before, after), (0.0, 1.0))
    left = [Remainder(max(float(each.mean()) - 1, 0.0) / float(each.mean()), float(each.mean()) - 1)
            for each in (before, after)]  # fmt: skip
    stated = tuple(
        AcceptedCause(each.name, {}, {"mean": float(readings[0][k].mean())}, {"mean": 0.1}, each.evidence)
        for each, k in zip(result.accepted, result.current.free, strict=True)
    )
    verdict = verdict_of(Findings(left[0], left[1], bool(stated)), VerdictSettings(noise_like=0.2))
    return Diagnosis(
        "group", verdict, stated, result.candidates, result.equivalents, gain, left[0], left[1], {}, result
    )


def test_fields_of_a_live_diagnosis_agree_with_each_other_and_with_its_fits() -> None:
    """Two of five groups have a mean; it is the truth, and every field follows from the fits in ``details``."""
    rng, truth = np.random.default_rng(12), np.array([0.0, 2.0, 0.0, -3.0, 0.0])
    diagnosis = diagnosed(truth[:, None] + rng.standard_normal((2, 5, 100)))
    assert (diagnosis.verdict, [each.name for each in diagnosis.physics]) == ("explained", ["group 3", "group 1"])
    for cause, k in zip(diagnosis.physics, (3, 1), strict=True):
        assert cause.parameters["mean"] == pytest.approx(truth[k], abs=4 * cause.standard_errors["mean"])
        # a free mean gains n mean^2, and costs ln N
        assert cause.evidence == pytest.approx(100 * cause.parameters["mean"] ** 2 - math.log(500))
    steps = diagnosis.details.steps
    falls = [each.score - other.score for each, other in pairwise(steps)]
    assert [each.evidence for each in diagnosis.physics] == pytest.approx(falls)
    assert not set(diagnosis.equivalents) & {each.name for each in diagnosis.physics}
    evidence = [each.evidence for each in diagnosis.candidates]
    assert evidence == sorted(evidence, reverse=True)
    assert {each.name for each in diagnosis.physics} <= {each.name for each in diagnosis.candidates}
    assert diagnosis.leftover == diagnosis.after.share < diagnosis.before.share
    assert diagnosis.after.size < diagnosis.before.size
    assert diagnosis.improvement.after < diagnosis.improvement.before
    assert diagnosis.improvement.after == pytest.approx(diagnosis.improvement.noise_floor, rel=0.1)
    again = pickle.loads(pickle.dumps(diagnosis))
    assert again == diagnosis
    assert again.details.current.score == diagnosis.details.current.score
