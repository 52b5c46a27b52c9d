"""Modes that move with the level: a law is looked for, and an answer without one is not whole."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from trial_case import diagnosed

from millfrf.mismatch import Behaviour, JointPhysics, ModeTrend, Settings, library
from millfrf.mismatch.behaviour.behaviour_of_modes import FAMILIES
from millfrf.mismatch.inference.diagnosis import Improvement
from millfrf.mismatch.inference.settings import VerdictSettings
from millfrf.mismatch.structure.implausible_modes import halves_refitted_error, moved_by_level, shows_no_move

SOFTENS = Behaviour("softening", "Mode at 6.1 Hz softens by 0.9 %.", "N", ())
LINEAR: Any = SimpleNamespace(laws=())
LAW: Any = SimpleNamespace(laws=(1,))
GAIN: Any = SimpleNamespace(name="gain_error")
CLIPPED: Any = SimpleNamespace(name="clipping")


@pytest.mark.long
@pytest.mark.parametrize(
    ("group", "cases", "seed", "index", "law"),
    [("steady", 120, 4301, 20, "stiffness_softening"), ("extended", 300, 4201, 1, "stiffness_hardening")],
)
def test_a_spring_is_found_where_a_linear_cause_was_told(
    tmp_path: Path, group: str, cases: int, seed: int, index: int, law: str
) -> None:
    """Before: a table's mass and an axis were told, with an evidence of 37, as no law had been looked for."""
    diagnosis = diagnosed(tmp_path, group, cases, seed, index)
    assert diagnosis.verdict == "explained"
    assert [each.name for each in diagnosis.physics] == [law]
    assert diagnosis.physics[0].evidence > 1000


def test_what_a_linear_answer_does_not_move_is_told() -> None:
    assert moved_by_level(LINEAR, (GAIN,), SOFTENS) == (
        "Mode at 6.1 Hz softens by 0.9 %. No linear model does that, so the answer is incomplete"
    )


@pytest.mark.parametrize(
    ("answer", "causes", "behaviour"),
    [
        (LAW, (), SOFTENS),
        (LINEAR, (CLIPPED,), SOFTENS),
        (LINEAR, (GAIN,), None),
        *[(LINEAR, (GAIN,), replace(SOFTENS, family=one)) for one in ("none", "drift", "doubtful", "cannot tell")],
    ],
)
def test_nothing_is_said_where_modes_stay_or_something_moves_them(
    answer: Any, causes: tuple[Any, ...], behaviour: Behaviour | None
) -> None:
    assert not moved_by_level(answer, causes, behaviour)


def test_all_other_families_follow_the_level() -> None:
    stay = {"none", "drift", "doubtful", "cannot tell"}
    assert all(replace(SOFTENS, family=each).follows_level != (each in stay) for each in FAMILIES)


@pytest.mark.parametrize(("after", "stands"), [(0.05, True), (0.09, False)])
def test_a_linear_cause_must_halve_the_error_of_a_plain_refit(after: float, stands: bool) -> None:
    """Whatever the nominal model leaves: a refit takes much of that, too."""
    gain = Improvement("mid", 0.5, 0.1, after, 0.01, 0.001, (0.1, 0.3), against="nominal")
    assert halves_refitted_error(gain, VerdictSettings()) == stands


def _moves(shift: float, error: float, family: str) -> Behaviour:
    """One mode whose frequency moves."""
    levels, p_values = (50.0, 200.0), (0.001 if family == "hardening" else 0.4, 0.5)
    frequencies, damping = (5.0, 5.0 * (1 + shift)), (0.02, 0.02)
    numbers = (frequencies, (0.01, 0.01), damping, (1e-4, 1e-4), shift, error, 0.0, 0.01)
    return Behaviour(family, "", "N", (ModeTrend(1, levels, *numbers, p_values, 0.0, 0.5, family, ""),))


@pytest.mark.parametrize(
    ("shift", "error", "family", "stays"),
    [
        (0.0002, 0.0005, "none", True),
        (0.0002, 0.0020, "none", False),  # errors are so wide that the move might be there still
        (0.0030, 0.0004, "hardening", False),
    ],
)
def test_modes_stay_beside_causes_where_their_move_would_show(
    shift: float, error: float, family: str, stays: bool
) -> None:
    moved = _moves(0.0034, 0.0003, "hardening")
    assert shows_no_move(moved, _moves(shift, error, family)) is stays


@pytest.mark.slow
def test_a_coupling_that_moves_the_modes_of_a_refit_is_told(tmp_path: Path) -> None:
    """Before: the coupling and the small mode left the noise, and a mode that a refit moves by 0.34 % spoke against."""
    diagnosis = diagnosed(tmp_path, "extended", 300, 4602, 9)
    assert diagnosis.verdict == "explained"
    assert [each.name for each in diagnosis.physics] == ["gyroscopic_coupling", "missing_mode"]
    assert diagnosis.content["behaviour"]["sentence"].endswith(
        "No mode changes with the level once the named causes are part of the refit."
    )


@pytest.mark.slow
@pytest.mark.parametrize("index", [14, 50])
def test_linear_causes_alone_do_not_explain_a_law(tmp_path: Path, index: int) -> None:
    """Hysteresis, and hardening inside, of the noise beside a small mode: the mode alone is told of neither."""
    linear = {name: each for name, each in library().items() if not isinstance(each, JointPhysics)}
    diagnosis = diagnosed(tmp_path, "extended", 300, 4602, index, Settings(causes=linear))
    assert diagnosis.content["behaviour"]["family"] in ("softening", "hardening")
    assert diagnosis.verdict == "unexplained"
