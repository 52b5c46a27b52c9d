"""The whole truth table of a verdict, and what an answer may leave of a held-out recording."""

from itertools import product

import pytest

from millfrf.mismatch.inference.diagnosis import (
    Findings,
    Improvement,
    Remainder,
    leaves_too_much,
    share_left,
    verdict_of,
)
from millfrf.mismatch.inference.settings import VerdictSettings

LIMITS = VerdictSettings(noise_like=2.0, explained=0.9, partly=0.5)
BEFORE = {True: Remainder(1.9, 1.9), False: Remainder(40.0, 40.0)}
"""Without causes: noise-like, or not."""

AFTER = {
    "noise": Remainder(2.0, 39.0),  # passes by its share, whatever its size
    "little": Remainder(2.1, 0.099 * 1.9),
    "half": Remainder(2.1, 0.0),
    "much": Remainder(39.0, 39.0),
}

WITH_CAUSES = {
    # what is left, incomplete, halved
    ("noise", False, False): "explained",
    ("noise", False, True): "explained",
    ("noise", True, False): "unexplained",
    ("noise", True, True): "partly explained",
    ("little", False, False): "explained",
    ("little", False, True): "explained",
    ("little", True, False): "unexplained",
    ("little", True, True): "partly explained",
    ("half", False, False): "unexplained",
    ("half", False, True): "partly explained",
    ("half", True, False): "unexplained",
    ("half", True, True): "partly explained",
    ("much", False, False): "unexplained",
    ("much", False, True): "unexplained",
    ("much", True, False): "unexplained",
    ("much", True, True): "unexplained",
}


def left(kind: str, before: Remainder) -> Remainder:
    return AFTER[kind] if kind != "half" else Remainder(2.1, 0.5 * before.size)


@pytest.mark.parametrize(("case", "verdict"), WITH_CAUSES.items())
@pytest.mark.parametrize("quiet", [True, False])
def test_with_causes_that_hold_on_held_out_data(case: tuple[str, bool, bool], verdict: str, quiet: bool) -> None:
    kind, incomplete, halved = case
    before = BEFORE[quiet]
    result = Findings(before, left(kind, before), named=True, incomplete=incomplete, halved=halved)
    assert verdict_of(result, LIMITS) == verdict


@pytest.mark.parametrize(("kind", "halved"), list(product(AFTER, [True, False])))
def test_without_causes_the_nominal_hypothesis_alone_decides(kind: str, halved: bool) -> None:
    for quiet, incomplete, verdict in (
        (True, False, "none"),
        (True, True, "unexplained"),
        (False, False, "unexplained"),
        (False, True, "unexplained"),
    ):
        before = BEFORE[quiet]
        result = Findings(before, left(kind, before), named=False, incomplete=incomplete, halved=halved)
        assert verdict_of(result, LIMITS) == verdict


@pytest.mark.parametrize("flags", list(product([True, False], repeat=4)))
def test_what_rules_out_every_answer_leaves_it_unexplained(flags: tuple[bool, bool, bool, bool]) -> None:
    quiet, named, incomplete, halved = flags
    result = Findings(BEFORE[quiet], AFTER["noise"], named=named, excluded=True, incomplete=incomplete, halved=halved)
    assert verdict_of(result, LIMITS) == "unexplained"


def test_limits_are_shares_of_what_was_left_before() -> None:
    before = Remainder(40.0, 40.0)
    for size, verdict in (
        (3.999, "explained"),
        (4.01, "partly explained"),
        (20.0, "partly explained"),
        (20.01, "unexplained"),
    ):
        assert verdict_of(Findings(before, Remainder(size, size), named=True), LIMITS) == verdict


def test_no_part_is_told_where_all_must_be_gone() -> None:
    result = Findings(Remainder(0.5, 10.0), Remainder(0.2, 1.0), named=True)
    assert verdict_of(result, VerdictSettings(partly=1.0)) == "unexplained"
    assert verdict_of(result, VerdictSettings(partly=0.5)) == "partly explained"


def gain(before: float, after: float, noise: float) -> Improvement:
    return Improvement("held out", before, before, after, noise, 0.001, (0.1, 0.9))


def test_the_share_left_counts_power_above_the_noise() -> None:
    assert share_left(gain(5.0, 4.0, 3.0)) == pytest.approx((16 - 9) / (25 - 9))
    assert share_left(gain(5.0, 2.0, 3.0)) == 0.0
    assert share_left(gain(3.0, 3.0, 3.0)) == 0.0  # nothing was wrong, and nothing is
    assert share_left(gain(2.0, 4.0, 3.0)) == 1.0  # nothing was wrong, and now something is


@pytest.mark.parametrize(
    ("before", "after", "noise", "too_much"),
    [
        (0.9, 0.26, 0.25, True),  # more than a quarter of the response
        (0.9, 0.25, 0.01, False),  # far above the noise, but less than a tenth of what the nominal left
        (0.6, 0.25, 0.01, True),  # more than a tenth of it
        (0.2, 0.14, 0.10, False),  # within half as much again as the noise
    ],
)
def test_what_an_answer_may_leave(before: float, after: float, noise: float, too_much: bool) -> None:
    assert leaves_too_much(gain(before, after, noise), VerdictSettings()) is too_much
