"""What is told where a cause stands and something else is left: half of the error gone, and a name that is sure."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from millfrf.mismatch import AcceptedCause, Candidate, library
from millfrf.mismatch.inference.diagnosis import Improvement, error_halved
from millfrf.mismatch.inference.search import Proposal, Round, Search
from millfrf.mismatch.inference.settings import VerdictSettings
from millfrf.mismatch.structure.answer import confirmed_faults, has_reliable_name, small_causes

LAWS = {"coulomb_friction", "hysteresis", "backlash", "stiffness_hardening"}


def gain(before: float, refitted: float, after: float, noise: float, against: str = "refitted") -> Improvement:
    return Improvement("mid", before, refitted, after, noise, 1e-4, (0.1, 0.9), 500.0, against)


@pytest.mark.parametrize(
    ("told", "halved"),
    [
        (gain(0.52, 0.1306, 0.0318, 0.0248), True),
        (gain(0.5244, 0.1733, 0.1305, 0.0828), False),  # two thirds of the error above noise are left
        (gain(0.44, 0.0323, 0.0311, 0.0371), False),  # nothing was above the noise
        (gain(0.7, 0.4, 0.4, 0.1, "nominal"), False),
        (gain(0.9, 0.4, 0.4, 0.1, "nominal"), True),  # refitted modes are the answer, and the nominal model its rival
        (gain(2.5, 2.4, 1.06, 0.1), False),  # it predicts nothing
    ],
)
def test_a_partial_answer_halves_the_error_above_the_noise(told: Improvement, halved: bool) -> None:
    assert error_halved(told, VerdictSettings()) is halved


def found_with(*causes: tuple[str, float], screened: dict[str, float] | None = None) -> Search[Any]:
    """A search that accepted causes with their evidence, one a round."""
    known, rounds, accepted, steps, score = library(), [], [], [SimpleNamespace(score=0.0)], 0.0
    candidates = tuple(Candidate(name, each, "screened") for name, each in (screened or {}).items())
    hypothesis = SimpleNamespace(causes=tuple(SimpleNamespace(physics=known[name]) for name, _ in causes))
    for name, evidence in causes:
        score -= evidence
        steps.append(SimpleNamespace(score=score, hypothesis=hypothesis))
        accepted.append(Proposal[Any](name, {}, steps[-1], evidence))
        rounds.append(Round[Any]((), accepted[-1], candidates))
    return Search(tuple(steps), tuple(accepted), tuple(rounds))


def test_what_brings_little_may_mend_the_rest() -> None:
    result = found_with(("coulomb_friction", 900.0), ("non_proportional_damping", 100.0))
    assert small_causes(result, 0.25) == [1]
    assert small_causes(found_with(("coulomb_friction", 600.0), ("channel_delay", 400.0)), 0.25) == []


def test_modes_alone_are_no_name() -> None:
    assert not has_reliable_name(found_with(("missing_mode", 900.0)), LAWS)
    assert has_reliable_name(found_with(("missing_mode", 900.0), ("channel_delay", 500.0)), LAWS)


def test_a_law_that_another_outdoes_on_the_motion_seen_is_no_sure_name() -> None:
    seen = {"coulomb_friction": 5e4, "backlash": 900.0, "missing_mode": 1e6}
    assert has_reliable_name(found_with(("coulomb_friction", 900.0), screened=seen), LAWS)
    other = found_with(("coulomb_friction", 900.0), screened=seen | {"backlash": 6e4})
    assert not has_reliable_name(other, LAWS)
    told_with_it = replace(other.rounds[0], equivalents=("backlash",))
    assert has_reliable_name(replace(other, rounds=(told_with_it,)), LAWS)


def test_a_tone_in_the_band_must_lower_the_error() -> None:
    inside, above = (AcceptedCause("unmeasured_excitation", {}, {"frequency_hz": f}, {}, 90.0) for f in (9.0, 70.0))
    chance = Improvement("mid", 0.2, 0.12, 0.12, 0.1, 0.2, (0.4, 0.7))
    assert confirmed_faults([inside, above], chance, 40.0, 0.05) == [above]
    falls = Improvement("mid", 0.2, 0.12, 0.03, 0.02, 1e-4, (0.1, 0.2))
    assert confirmed_faults([inside, above], falls, 40.0, 0.05) == [inside, above]
