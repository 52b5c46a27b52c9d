"""FRFs of a known structure, and UFF files of them as other programs write them (through pyuff)."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyuff

from estimation import Frf
from modal_fit import ModalModel

AXIS = np.arange(0.5, 200.5, 0.5)
DIRECTIONS = {"+X": 1, "-X": -1, "+Y": 2, "-Y": -2, "+Z": 3, "-Z": -3}


@pytest.fixture(scope="session")
def plate() -> Frf:
    """Receptance of six points at two references, three modes, m/N."""
    return plate_model().frf(AXIS)


def plate_model() -> ModalModel:
    """A reciprocal structure of three modes."""
    omega = 2 * np.pi * np.array([31.0, 74.0, 128.0])
    poles = (-0.01 + 1j) * omega
    shapes = np.random.default_rng(3).uniform(-1, 1, (3, 6)) + 0j
    left = shapes[:, :2] / (40j * poles.imag[:, None])
    return ModalModel(poles, shapes, left, tuple(f"{k}:+Z" for k in range(1, 7)), ("1:+Z", "2:+Z"))


def accelerance(frf: Frf) -> Frf:
    """The same structure's accelerance, m/s^2/N."""
    values = frf.values * (2j * np.pi * frf.frequencies[:, None, None]) ** 2
    return replace(frf, values=values, quantity="accelerance", unit="m/s^2/N")


def function(x: np.ndarray, data: np.ndarray, response: str, reference: str, **changed: Any) -> dict[str, Any]:
    """One data set 58 as pyuff takes it, accelerance in m/s^2 over N."""
    ends = {}
    for side, label in (("rsp", response), ("ref", reference)):
        node, direction = label.split(":")
        ends |= {f"{side}_ent_name": "NONE", f"{side}_node": int(node), f"{side}_dir": DIRECTIONS[direction]}
    kinds = {"ordinate_spec_data_type": 12, "orddenom_spec_data_type": 13, "abscissa_spec_data_type": 18}
    labels = {"ordinate_axis_units_lab": "m/s^2", "orddenom_axis_units_lab": "N", "abscissa_axis_units_lab": "Hz"}
    axis = {"abscissa_spacing": 1, "abscissa_min": float(x[0]), "abscissa_inc": float(x[1] - x[0]), "x": x}
    names = {f"id{k}": "NONE" for k in range(1, 6)}
    entry = {"type": 58, "binary": 0, "func_type": 4, "data": data, "num_pts": len(x), "ver_num": 1, "load_case_id": 0}
    return {**entry, **ends, **kinds, **labels, **axis, **names, **changed}


def coherence_of(x: np.ndarray, data: np.ndarray, response: str, reference: str) -> dict[str, Any]:
    """A coherence (function type 6), real numbers without a unit."""
    none: Mapping[str, Any] = {"ordinate_spec_data_type": 0, "orddenom_spec_data_type": 0}
    labels = {"ordinate_axis_units_lab": "NONE", "orddenom_axis_units_lab": "NONE"}
    return function(x, data, response, reference, func_type=6, **none, **labels)


def write_sets(path: Path, *sets: Mapping[str, Any]) -> Path:
    """Write data sets with pyuff."""
    pyuff.UFF(str(path)).write_sets([dict(each) for each in sets], "overwrite")
    return path
