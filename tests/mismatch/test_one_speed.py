"""A rotor's coupling at one speed: modes with unlike left and right vectors imitate it, and belief decides."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from trial_case import diagnosed

from millfrf.mismatch.inference.settings import EvidenceSettings
from millfrf.mismatch.structure.acceptance import required_evidence


@pytest.mark.long
def test_a_strong_coupling_is_found_from_the_modes_that_the_lab_believes(tmp_path: Path) -> None:
    """Before: the fit from the lab's modes ended after 20 steps, far from its best, and odd modes were told."""
    diagnosis = diagnosed(tmp_path, "extended", 300, 3501, 119)
    assert [each.name for each in diagnosis.physics] == ["gyroscopic_coupling"]
    assert diagnosis.improvement.after < 1.05 * diagnosis.improvement.noise_floor


@pytest.mark.long
def test_odd_modes_are_told_with_the_coupling_that_is_as_likely(tmp_path: Path) -> None:
    """Three numbers and modes as they should be gain 14 over odd modes, where 20 are asked for: neither is sure."""
    diagnosis = diagnosed(tmp_path, "steady", 120, 3502, 13)
    assert [each.name for each in diagnosis.physics] == ["modal_parameters"]
    assert diagnosis.equivalents == ("gyroscopic_coupling",)


@pytest.mark.parametrize(("laws", "own", "least"), [((), False, 30.0), ((1,), True, 150.0), ((1,), False, 1500.0)])
def test_less_is_asked_of_a_cause_beside_linear_ones(laws: tuple[int, ...], own: bool, least: float) -> None:
    """A mode has one form; a law's form is never quite the true one, and others mend it."""
    current: Any = SimpleNamespace(score=-15000.0, hypothesis=SimpleNamespace(laws=laws))
    base: Any = SimpleNamespace(score=0.0)
    assert required_evidence(current, base, EvidenceSettings(), own=own) == pytest.approx(least)
    few: Any = SimpleNamespace(score=-100.0, hypothesis=SimpleNamespace(laws=()))
    assert required_evidence(few, base, EvidenceSettings()) == EvidenceSettings().least
