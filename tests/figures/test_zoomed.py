"""Figures for the browser: the same text for the same figure, and the values that were given."""

import base64
import gzip
import json
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from estimation import Frf
from millfrf.figures import (
    EntryCurves,
    FrfCurves,
    ZoomedPlot,
    browser_library,
    zoomed_frfs,
    zoomed_limits,
    zoomed_matrix,
)
from millfrf.stability import StabilityLobes
from modal_fit import ModalModel

F = np.linspace(1.0, 60.0, 300)


def _values(item: Any, found: list[NDArray[np.float64]] | None = None) -> list[NDArray[np.float64]]:
    """Every array in the JSON of a figure."""
    found = [] if found is None else found
    if isinstance(item, dict):
        if item.get("type") == "ndarray":
            data = base64.b64decode(item["array"]["data"])
            data = gzip.decompress(data) if data[:2] == b"\x1f\x8b" else data
            found.append(np.frombuffer(data, np.dtype(item["dtype"])).astype(float))
        for each in item.values():
            _values(each, found)
    elif isinstance(item, list):
        for each in item:
            _values(each, found)
    return found


def _holds(plot: ZoomedPlot, wanted: NDArray[np.float64]) -> bool:
    arrays = _values(json.loads(plot.document))
    return any(each.shape == wanted.shape and np.allclose(each, wanted, rtol=1e-6, equal_nan=True) for each in arrays)


def _model() -> ModalModel:
    poles = 2 * np.pi * np.array([16.0, 42.0]) * (-0.02 + 1j * np.sqrt(1 - 0.02**2))
    vectors = np.array([[1.0, 0.5], [0.3, -1.0]], dtype=complex) * 1e-3
    dofs = ("TCP:+X", "TCP:+Y")
    return ModalModel(poles, vectors, vectors.copy() * -1j, dofs, dofs)


def test_equal_figures_are_equal_texts() -> None:
    curves = FrfCurves(_model().frf(F), (5.0, 50.0), _model())
    assert zoomed_matrix(curves) == zoomed_matrix(curves)


def test_a_matrix_offers_every_entry_with_its_values() -> None:
    frf: Frf = _model().frf(F)
    plot = zoomed_matrix(FrfCurves(frf, (5.0, 50.0), _model()))
    inside = (F >= 5.0) & (F <= 50.0)
    choices = json.loads(plot.choices)
    assert [each["label"] for each in choices] == [f"TCP:+{p} / TCP:+{q}" for p in "XY" for q in "XY"]
    packed = choices[1]["sources"]["measured"]["size"]
    size = np.frombuffer(base64.b64decode(packed), "<f4")
    assert size == pytest.approx(np.abs(frf.values[inside, 0, 1]), rel=1e-6)
    assert _holds(plot, np.abs(frf.values[inside, 0, 0])), "the first entry is drawn from the start"


def test_lines_without_a_value_are_gaps_and_the_phase_jumps_unseen() -> None:
    measured = np.exp(1j * np.linspace(0, 7, 300))
    measured[3] = np.nan
    fitted = np.exp(1j * np.linspace(0, 7, 300))
    plot = zoomed_frfs([EntryCurves("1 / 2", measured, fitted)], F, F, "|H| (m/N)")
    columns = json.loads(plot.choices)[0]["sources"]
    angle = np.frombuffer(base64.b64decode(columns["fitted"]["angle"]), "<f4")
    assert np.isnan(angle).sum() == 1, "the line is broken where the phase passes 180 degrees"
    size = np.frombuffer(base64.b64decode(columns["measured"]["size"]), "<f4")
    assert np.flatnonzero(np.isnan(size)).tolist() == [3]


def test_limits_are_told_in_millimetres_and_none_where_there_is_none() -> None:
    depths = np.array([1e-3, np.inf, 3e-3])
    lobes = StabilityLobes(
        np.array([100.0, 110.0, 120.0]), depths, np.array([17.0, np.nan, 18.0]), ("hopf", "none", "hopf"), "zero-order"
    )
    assert _holds(zoomed_limits({"one": lobes}), np.array([1.0, np.nan, 3.0]))


def test_the_library_can_stand_in_a_page() -> None:
    text = browser_library()
    assert "</script" not in text.lower()
    assert len(text) < 2e6
