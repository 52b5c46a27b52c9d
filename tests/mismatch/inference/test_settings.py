"""What the settings say of their thresholds holds: closed forms, brute force, and every threshold decides something."""

import ast
import math
import re
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2, norm

from millfrf import mismatch
from millfrf.mismatch import ROBOT, LabError, SearchSettings, Settings
from millfrf.mismatch.cut.settings import CUT
from millfrf.mismatch.faults.tones import sharp_contrast
from millfrf.mismatch.inference.numerics import signed_ranks
from millfrf.mismatch.inference.search import Proposal, Round, Search, search
from millfrf.mismatch.inference.settings import (
    FAULTS,
    LOCATION,
    EvidenceSettings,
    FaultSettings,
    LocationSettings,
    ProofSettings,
    ScreeningSettings,
    VerdictSettings,
)
from millfrf.mismatch.location.residual_view import NoiseSpread, holm
from millfrf.mismatch.robot.posed import LIMITS

Real = NDArray[np.float64]

CLASSES = (LabError, EvidenceSettings, SearchSettings, ScreeningSettings, FaultSettings, ProofSettings,
           VerdictSettings, LocationSettings, Settings)  # fmt: skip


def odds(gain: float) -> float:
    """Ratio of likelihoods, or Bayes factor, of a gain in score."""
    return math.exp(gain / 2)


def test_gains_are_the_odds_that_are_stated() -> None:
    evidence = EvidenceSettings()
    assert odds(evidence.least) == pytest.approx(22_000, rel=0.01)
    assert odds(evidence.as_good) == pytest.approx(150, rel=0.02)
    assert odds(ProofSettings().gain) == pytest.approx(150, rel=0.02)
    assert odds(ROBOT.evidence.as_good) == odds(CUT.evidence.as_good) == pytest.approx(20, rel=0.01)


def test_standard_errors_are_as_rare_as_stated() -> None:
    assert 1 / (2 * norm.sf(EvidenceSettings().clear)) == pytest.approx(16_000, rel=0.02)
    assert 1 / (2 * norm.sf(CUT.implausible)) == pytest.approx(370, rel=0.01)


def median_exceeded(times: float, around: int, rank: int) -> float:
    """Chance that a line of noise is so many times the ``rank``-th smallest of the lines around it.

    Powers are exponential: with Renyi's representation of the k-th smallest of n, ``E exp(-c X) = prod (n - j) / (n -
    j + c)`` over j from 0 to k - 1 (Acta Math. Acad. Sci. Hung. 4, 1953).
    """
    j = np.arange(rank)
    return float(np.prod((around - j) / (around - j + times)))


def test_noise_passes_for_a_tone_as_rarely_as_stated() -> None:
    """A line that stands out is the largest of 41: the median is the 21st smallest of the other 40."""
    rare = 1 / median_exceeded(15.0, 40, 21)
    assert rare == pytest.approx(6000, rel=0.1)
    assert 1e10 < 1 / median_exceeded(FAULTS.contrast, 40, 21) < 2e10
    count = 2_000_000
    passed = int(np.sum(sharp_contrast(np.random.default_rng(3).exponential(size=count)) > 15))
    expected = count / rare
    # the lines just beside it must let it pass too, which takes a few
    assert 0.8 * expected < passed < expected + 3 * math.sqrt(expected)


def test_a_significance_can_be_reached_by_as_few_blocks_as_counted() -> None:
    """n falls in a row have ``p = 2^-n``."""
    for significance, least in ((ProofSettings().significance, 5), (ROBOT.proof.significance, LIMITS.least_blocks)):
        for count in range(2, 12):
            falls = np.arange(1.0, count + 1)
            assert (signed_ranks(falls, np.zeros(count)) < significance) is (count >= least)


def test_noise_alone_is_placed_anywhere_as_rarely_as_stated() -> None:
    """Power of n complex lines over a noise level that is itself known to 10 %, in 40 cells of 1 to 60 lines."""
    rng, runs, spread = np.random.default_rng(2), 20_000, 0.1
    count = np.resize([1.0, 4.0, 12.0, 60.0], 40)
    freedom = 2 / spread**2
    ratio = rng.chisquare(2 * count, (runs, 40)) / (2 * count) / (rng.chisquare(freedom, (runs, 40)) / freedom)
    chances = NoiseSpread(1.0, spread).chance(ratio, count)
    alarms = float(np.mean([holm(each).min() < LOCATION.family_wise for each in chances]))
    assert alarms == pytest.approx(LOCATION.family_wise, abs=4 * math.sqrt(LOCATION.family_wise / runs))


def test_a_right_robot_passes_for_noise() -> None:
    """What is left of n deviations that are told is chi-square over n: its mean is 1, and 2 is rare from twenty on."""
    for count in (20, 50, 200):
        assert chi2.mean(count) / count == 1.0
        assert chi2.sf(ROBOT.verdict.noise_like * count, count) < 0.006


def test_a_shift_that_the_robot_limit_allows_is_as_large_as_stated() -> None:
    assert math.exp(LIMITS.strange * ROBOT.lab.frequency) == pytest.approx(1.8, rel=0.02)


@dataclass(frozen=True)
class Columns:
    """A regression on orthonormal columns; noise has variance 1, and every column is a cause with one number."""

    y: Real
    settings: Settings
    taken: tuple[int, ...] = ()

    @property
    def score(self) -> float:
        return float(self.y @ self.y - sum(self.y[k] ** 2 for k in self.taken)) + len(self.taken) * math.log(
            len(self.y)
        )

    def finished(self, found: Search["Columns"]) -> bool:
        return False

    def round(self, found: Search["Columns"]) -> Round["Columns"]:
        here = found.current
        further = [replace(here, taken=(*here.taken, k)) for k in range(8) if k not in here.taken]
        proposals = [Proposal(f"column {one.taken[-1]}", {}, one, here.score - one.score) for one in further]
        best = max(proposals, key=lambda one: one.evidence)
        return Round(tuple(proposals), best if best.evidence > self.needed(here, here) else None, ())

    def without(self, found: Search["Columns"], place: int) -> "Columns":
        return replace(found.current, taken=tuple(each for k, each in enumerate(found.current.taken) if k != place))

    def needed(self, current: "Columns", base: "Columns") -> float:
        return self.settings.evidence.least


@pytest.mark.parametrize("least", [0.0, 2.0, 4.0])
def test_chance_finds_a_cause_as_often_as_its_evidence_says(least: float) -> None:
    """One of 8 columns gains ``chi^2_1 - ln N`` by chance: some cause is found in ``1 - (1 - sf(least + ln N))^8``."""
    settings, count, runs = Settings(evidence=EvidenceSettings(least=least)), 16, 3000
    noise = np.random.default_rng(9).standard_normal((runs, count))
    result = [bool(search(each, each, lambda text: None).accepted) for each in (Columns(y, settings) for y in noise)]
    share = 1 - float(chi2.cdf(least + math.log(count), 1)) ** 8
    assert np.mean(result) == pytest.approx(share, abs=4 * math.sqrt(share * (1 - share) / runs))


def test_a_score_is_twice_the_logarithm_of_a_bayes_factor() -> None:
    """Against the exact marginal likelihood of one number with a prior worth one value: variance N about zero.

    ``2 ln B = t^2 N / (N + 1) - ln(N + 1)``, the score says ``t^2 - ln N`` (Kass & Raftery 1995).
    """
    count, settings = 10_000, Settings()
    for t_squared in (0.0, 5.0, settings.evidence.least + math.log(count), 400.0):
        y = np.zeros(count)
        y[0] = math.sqrt(t_squared)
        base = Columns(y, settings)
        gain = base.score - replace(base, taken=(0,)).score
        exact = t_squared * count / (count + 1) - math.log(count + 1)
        assert gain == pytest.approx(exact, abs=1e-3 + 2e-4 * t_squared)


def test_no_more_causes_are_accepted_than_allowed() -> None:
    y = np.zeros(1000)
    y[:8] = 20.0
    for most in (0, 1, 3, 8):
        single = Columns(y, Settings(search=SearchSettings(most_causes=most)))
        assert len(search(single, single, lambda text: None).accepted) == most


def test_defaults_are_the_same_for_everyone_and_belong_to_no_one() -> None:
    assert Settings() == Settings()
    assert Settings().faults == FAULTS == FaultSettings()
    assert Settings().location == LOCATION == LocationSettings()
    stricter = replace(Settings(), evidence=EvidenceSettings(least=50.0))
    assert Settings().evidence.least == 20.0
    assert {
        each.name for each in fields(Settings) if getattr(stricter, each.name) != getattr(Settings(), each.name)
    } == {"evidence"}


@pytest.mark.parametrize("kind", CLASSES)
def test_every_threshold_says_what_it_means(kind: type) -> None:
    said = re.findall(r"^    (\w[\w, ]*)\n        \S", kind.__doc__ or "", re.MULTILINE)
    assert {each.name for each in fields(kind)} <= {name for line in said for name in line.split(", ")}


def test_every_threshold_decides_something() -> None:
    """A threshold that no module reads is a promise that is not kept."""
    folder = Path(mismatch.__file__).parent
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in folder.rglob("*.py") if path.name != "settings.py"]
    read = {node.attr for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    stated = {each.name for kind in (*CLASSES, type(CUT), type(LIMITS)) for each in fields(kind)}
    assert stated <= read, stated - read
