"""Modes of two models paired and judged by their error bars."""

from dataclasses import replace

import numpy as np
import pytest

from millfrf.core import InputError
from modal_fit import ModalModel, compare_modes
from replay_data import table_one_model


def with_covariance(model: ModalModel, relative: float) -> ModalModel:
    """Independent errors of ``relative`` times each pole's magnitude; vectors are exact."""
    n = len(model.poles)
    size = 2 * (model.poles.size + model.right.size + model.left.size)
    variance = np.zeros(size)
    variance[: 2 * n] = np.tile((relative * np.abs(model.poles)) ** 2, 2)
    return replace(model, covariance=np.diag(variance))


def test_a_model_does_not_differ_from_itself() -> None:
    model = with_covariance(table_one_model(), 1e-3)
    for pair in compare_modes(model, model):
        assert pair.first == pair.second
        assert (pair.frequency_change, pair.damping_change) == (0.0, 0.0)
        assert pair.right_likeness == pytest.approx(1.0)
        assert not pair.moved


def test_shift_is_judged_by_both_error_bars() -> None:
    model = with_covariance(table_one_model(), 1e-3)
    for shift, moved in ((3e-3, False), (6e-3, True)):  # the change has an error of sqrt(2) 1e-3
        other = replace(model, poles=model.poles * (1 + shift))
        pairs = compare_modes(model, other)
        assert [pair.moved for pair in pairs] == [moved, moved]
        expected = shift / (np.sqrt(2) * 1e-3)
        assert [pair.significance for pair in pairs] == pytest.approx([expected] * 2, rel=0.02)


def test_order_does_not_matter_and_far_modes_stay_alone() -> None:
    model = table_one_model()
    turned = replace(model, poles=model.poles[::-1], right=model.right[::-1], left=model.left[::-1])
    assert [(pair.first, pair.second) for pair in compare_modes(model, turned)] == [(0, 1), (1, 0)]
    far = replace(model, poles=model.poles * np.array([1.0, 1.3]))
    assert [(pair.first, pair.second) for pair in compare_modes(model, far)] == [(0, 0)]


def test_without_error_bars_nothing_is_said_to_have_moved() -> None:
    model = table_one_model()
    pairs = compare_modes(model, replace(model, poles=1.02 * model.poles))
    assert all(np.isnan(pair.significance) for pair in pairs)
    assert not any(pair.moved for pair in pairs)


def test_other_degrees_of_freedom_are_refused() -> None:
    model = table_one_model()
    with pytest.raises(InputError, match="same degrees of freedom"):
        compare_modes(model, replace(model, responses=("A:+X", "A:+Y", "A:+Z")))
