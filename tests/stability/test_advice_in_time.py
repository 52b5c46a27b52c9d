"""Bands and recommended cuts against time: the truth is drawn from the stated errors and integrated independently."""

from dataclasses import dataclass

import numpy as np
import pytest
from drawn_cuts import Case, growth, helical, random_case
from scipy.stats import binom

from millfrf.core import InputError
from millfrf.stability import certified_cut, certified_lobes, depth_errors, limit_band
from millfrf.stability.recommendation import recommended_cut

MARGIN = 5e-4
"""By which a depth is moved off the end of a band, so that the integration's own error does not decide."""

DRIFT = 0.02


@dataclass
class Trial:
    """Whether the true limit lay inside the band, and whether the recommended cut was stable; None: none was given."""

    inside: bool | None
    stable: bool | None


def trial(case: Case, seed: int) -> Trial:
    """Three integrations of the truth: at both ends of a band, and at the recommended cut somewhere in its drift."""
    rng = np.random.default_rng(10_000 + seed)
    lobes = certified_lobes(case.model, case.cut, case.speeds, case.max_depth)
    if not np.isfinite(lobes.depth_limits).any():
        return Trial(None, None)
    errors = depth_errors(case.model, case.cut, lobes)
    cut = certified_cut(
        case.model, case.cut, lobes, errors, drift=DRIFT, max_depth=float(np.nanmax(_finite(lobes.depth_limits)))
    )
    speed = cut.spindle_speed * (1 + rng.uniform(-DRIFT, DRIFT))
    return Trial(_inside(case, rng), growth(case.true_model, case.true_cut, cut.depth, speed) < 1)


def _finite(limits: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(limits), limits, np.nan)


def _inside(case: Case, rng: np.random.Generator) -> bool | None:
    speeds = case.speeds[[int(rng.integers(0, len(case.speeds)))]]
    lobes = certified_lobes(case.model, case.cut, speeds, case.max_depth)
    band = limit_band(case.model, case.cut, lobes, case.max_depth)
    [low], [high] = band.low, band.high
    if not (np.isfinite(low) and np.isfinite(high)):
        return None
    at = (case.true_model, case.true_cut)
    below = growth(*at, max(low, 1e-6) * (1 - MARGIN), float(speeds[0])) < 1
    return below and growth(*at, high * (1 + MARGIN), float(speeds[0])) > 1


def assert_covered(trials: list[Trial], least: int) -> None:
    """Bands inside the 99 % binomial interval of 95 %; recommended cuts not below its lower end."""
    inside = [each.inside for each in trials if each.inside is not None]
    stable = [each.stable for each in trials if each.stable is not None]
    assert min(len(inside), len(stable)) >= least
    low, high = binom.interval(0.99, len(inside), 0.95)
    assert low <= sum(inside) <= high, (sum(inside), len(inside))
    assert sum(stable) >= binom.ppf(0.005, len(stable), 0.95), (sum(stable), len(stable))


@pytest.mark.long
def test_the_integration_agrees_with_the_certified_limits() -> None:
    """The judge first: growth by 1 at the limit of the truth, to the step's accuracy."""
    for seed in (1, 2, 5):
        case = random_case(seed)
        lobes = certified_lobes(case.true_model, case.true_cut, case.speeds[[8]], case.max_depth)
        [limit] = lobes.depth_limits
        if np.isfinite(limit):
            assert growth(case.true_model, case.true_cut, 0.995 * limit, float(case.speeds[8])) < 1
            assert growth(case.true_model, case.true_cut, 1.005 * limit, float(case.speeds[8])) > 1


@pytest.mark.long
def test_errors_as_large_as_the_limits_leave_it_to_the_draws() -> None:
    """Before: refused, since limit less 1.6 errors was below zero at every speed."""
    case = random_case(27)
    lobes = certified_lobes(case.model, case.cut, case.speeds[[18, 24]], case.max_depth)
    errors, largest = depth_errors(case.model, case.cut, lobes), float(lobes.depth_limits.max())
    with pytest.raises(InputError, match="no cut is stable"):
        recommended_cut(lobes, errors, max_depth=largest)
    cut = certified_cut(case.model, case.cut, lobes, errors, drift=DRIFT, max_depth=largest)
    assert 0.2 * lobes.depth_limits.min() < cut.depth < lobes.depth_limits.max()
    assert cut.draws == 39
    assert growth(case.true_model, case.true_cut, cut.depth, cut.spindle_speed) < 1


@pytest.mark.long
def test_advice_holds_in_time_for_a_few() -> None:
    assert_covered([trial(random_case(seed), seed) for seed in range(4)], 2)


@pytest.mark.slow
def test_advice_holds_in_three_hundred_integrations() -> None:
    """100 structures, 3 integrations each."""
    assert_covered([trial(random_case(seed), seed) for seed in range(100)], 90)


@pytest.mark.long
def test_advice_with_a_helix_holds_in_time_for_a_few() -> None:
    """End mills have helical edges; before, no band and no cut were given for them."""
    assert_covered([trial(helical(random_case(seed)), seed) for seed in range(4)], 2)


@pytest.mark.slow
def test_advice_with_a_helix_holds_in_ninety_integrations() -> None:
    assert_covered([trial(helical(random_case(seed)), seed) for seed in range(30)], 25)
