"""Thresholds of robots: what they mean, and that all others are the core's."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import wilcoxon

from millfrf.mismatch import ROBOT, SearchSettings
from millfrf.mismatch.inference.settings import EvidenceSettings, ProofSettings
from millfrf.mismatch.robot.posed import LIMITS


def test_equivalents_are_within_a_likelihood_ratio_of_20() -> None:
    assert np.exp(ROBOT.evidence.as_good / 2) == pytest.approx(20, rel=0.01)


def test_what_does_not_differ_is_the_cores() -> None:
    assert replace(ROBOT.evidence, as_good=EvidenceSettings().as_good) == EvidenceSettings()
    assert replace(ROBOT.search, most_causes=SearchSettings().most_causes) == SearchSettings()
    proof = ProofSettings()
    assert replace(ROBOT.proof, significance=proof.significance, beaten=proof.beaten) == proof


def test_fewer_blocks_than_the_least_are_never_significant() -> None:
    for count in range(2, 12):
        best = wilcoxon(np.arange(1.0, count + 1), alternative="greater").pvalue
        assert (best < ROBOT.proof.significance) == (count >= LIMITS.least_blocks)


def test_a_loose_belief_makes_ten_deviations_one() -> None:
    assert LIMITS.loose * 10.0**2 == pytest.approx(1.0)
