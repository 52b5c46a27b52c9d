"""Numbers with which no decision can be made are refused by name; one unit of `LabError` moves a mode by its share."""

import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from millfrf.core import InputError
from millfrf.mismatch import LabError, ModelShape, SearchSettings
from millfrf.mismatch.cut.settings import CutSettings
from millfrf.mismatch.inference.settings import (
    EvidenceSettings,
    FaultSettings,
    LocationSettings,
    ProofSettings,
    ScreeningSettings,
    Thresholds,
    VerdictSettings,
)
from millfrf.mismatch.robot.posed import RobotLimits
from modal_fit import ModalModel

CLASSES = (
    EvidenceSettings, SearchSettings, ScreeningSettings, FaultSettings, ProofSettings, VerdictSettings,
    LocationSettings, CutSettings, RobotLimits,
)  # fmt: skip
NUMBERS = [(kind, one.name, one.type) for kind in CLASSES for one in fields(kind) if one.type in (int, float)]


@dataclass(frozen=True)
class Doubt(Thresholds, shares=("most",)):
    """One number of each kind, and a text that is none."""

    most: float = 0.1
    gain: float = 20.0
    rounds: int = 3
    name: str = "doubt"


@given(st.floats(), st.floats(), st.integers())
def test_exactly_the_numbers_that_can_decide_are_taken(most: float, gain: float, rounds: int) -> None:
    right = 0 <= most <= 1 and gain >= 0 and rounds >= 0
    if right:
        single = Doubt(most, gain, rounds)
        assert (single.most, single.gain, single.rounds) == (most, gain, rounds)
    else:
        with pytest.raises(InputError, match=r"Doubt\.(most|gain|rounds) = "):
            Doubt(most, gain, rounds)


@pytest.mark.parametrize(("kind", "name", "number"), NUMBERS)
def test_every_number_of_the_settings_is_checked(kind: type[Any], name: str, number: type) -> None:
    for value in (-1, math.nan, "20", None, *([2.5] if number is int else [])):
        with pytest.raises(InputError, match=rf"{kind.__name__}\.{name} = "):
            kind(**{name: value})


@pytest.mark.parametrize("kind", CLASSES)
def test_every_share_is_a_field_and_refuses_per_cent(kind: type[Any]) -> None:
    assert kind.shares <= {each.name for each in fields(kind)}
    for name in kind.shares:
        assert getattr(kind(**{name: 1.0}), name) == 1.0
        with pytest.raises(InputError, match="must be a share from 0 to 1"):
            kind(**{name: 5.0})


def test_numbers_of_numpy_are_numbers() -> None:
    assert Doubt(np.float64(0.5), np.int64(3), np.int64(2)) == Doubt(0.5, 3, 2)  # type: ignore[arg-type]
    assert Doubt(gain=math.inf).gain == math.inf  # nothing is ever enough


def test_one_unit_is_the_share_that_the_field_states(small_model: ModalModel) -> None:
    """Frequency and damping by ``exp(share)``, every part of an entry by the share of its vector's root mean square."""
    lab = LabError(frequency=0.02, damping=0.3, shape=0.05)
    shape = ModelShape(small_model, lab)
    rows = np.zeros((len(small_model.poles), shape.per_mode))
    rows[0, :2], rows[1, 2:] = 1.0, 1.0
    moved = shape.model(rows.ravel())
    factors = np.abs(moved.poles) / np.abs(small_model.poles)
    assert factors == pytest.approx([math.exp(0.02), 1.0])
    dampings = moved.damping_ratios / small_model.damping_ratios
    assert dampings == pytest.approx([math.exp(0.3), 1.0])
    for now, before in ((moved.right, small_model.right), (moved.left, small_model.left)):
        np.testing.assert_array_equal(now[0], before[0])
        size = np.sqrt(np.mean(np.abs(before[1]) ** 2))
        np.testing.assert_allclose(now[1] - before[1], 0.05 * size * (1 + 1j), rtol=1e-12)


def test_deviations_drawn_from_the_belief_scatter_by_the_shares(small_model: ModalModel) -> None:
    """Standard normal u: the standard deviation of ln f is the share, within ``4 / sqrt(2 n)`` of it."""
    lab, count = LabError(), 2000
    shape = ModelShape(small_model, lab)
    drawn = [shape.model(u) for u in np.random.default_rng(1).standard_normal((count, shape.size))]
    logs = np.array([np.log(np.abs(each.poles)) for each in drawn])
    dampings = np.array([np.log(each.damping_ratios) for each in drawn])
    entries = np.array([each.right[0] for each in drawn])
    size = np.sqrt(np.mean(np.abs(small_model.right[0]) ** 2))
    tolerance = 4 / math.sqrt(2 * count)
    np.testing.assert_allclose(logs.std(axis=0), lab.frequency, rtol=tolerance)
    np.testing.assert_allclose(dampings.std(axis=0), lab.damping, rtol=tolerance)
    np.testing.assert_allclose(entries.real.std(axis=0), lab.shape * size, rtol=tolerance)
    np.testing.assert_allclose(entries.imag.std(axis=0), lab.shape * size, rtol=tolerance)


@pytest.mark.parametrize("name", ["frequency", "damping", "shape"])
@pytest.mark.parametrize("value", [12.0, 1.0, 0.0, -0.1, math.nan, math.inf])
def test_what_is_no_share_is_refused(name: str, value: float) -> None:
    """Per cent instead of a share, and zero: a deviation is counted in units of it."""
    with pytest.raises(InputError, match=rf"LabError\.{name} = {value!r} must be a share above 0 and below 1"):
        LabError(**{name: value})
