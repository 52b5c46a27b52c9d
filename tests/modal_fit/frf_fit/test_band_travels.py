"""The band of a fit stays with the model, through the calibration to the tool tip too."""

from dataclasses import replace

import numpy as np
import pytest

from estimation import Frf
from millfrf.core import Band, InputError
from modal_fit import ModalModel, calibrate_to_tip, fit_polyreference
from replay_data import default_structure, table_one_model, tip_model

AXIS = np.arange(1.0, 60.0, 0.125)


def at(node: str) -> ModalModel:
    """The cell's structure, moved where ``node`` is and excited at the tip."""
    whole = default_structure()
    rows = [k for k, label in enumerate(whole.responses) if label.startswith(f"{node}:")]
    columns = [k for k, label in enumerate(whole.excitations) if label.startswith("TCP:")]
    return replace(
        whole,
        right=whole.right[:, rows],
        left=whole.left[:, columns],
        responses=tuple(whole.responses[k] for k in rows),
        excitations=tuple(whole.excitations[k] for k in columns),
    )


def fitted() -> ModalModel:
    """What a fit from 13 to 30 Hz would give at the housing: the two modes inside."""
    whole = at("HOUSING")
    inside = whole.natural_frequencies < 30.0
    return replace(
        whole, poles=whole.poles[inside], right=whole.right[inside], left=whole.left[inside], band=(13.0, 30.0)
    )


def hammer(node: str, band: Band | None) -> Frf:
    return replace(at(node).frf(AXIS), band=band)


def test_a_fit_holds_in_its_band() -> None:
    fit = fit_polyreference(table_one_model().frf(AXIS), (12.0, 24.0), max_order=12)
    assert fit.model.band == (12.0, 24.0)


@pytest.mark.parametrize(
    ("tapped", "expected"), [(None, (13.0, 30.0)), ((15.0, 100.0), (15.0, 30.0)), ((5.0, 100.0), (13.0, 30.0))]
)
def test_a_calibrated_model_holds_where_fit_and_taps_do(tapped: Band | None, expected: Band) -> None:
    result = calibrate_to_tip(fitted(), hammer("TCP", tapped), hammer("HOUSING", None), band=(13.0, 30.0))
    assert result.model.band == expected
    assert result.model.responses == tip_model(default_structure()).responses


def test_taps_outside_the_band_of_the_fit_are_refused() -> None:
    with pytest.raises(InputError, match=r"13 to 30 Hz.*nothing in common"):
        calibrate_to_tip(fitted(), hammer("TCP", (40.0, 60.0)), hammer("HOUSING", None), band=(13.0, 30.0))
