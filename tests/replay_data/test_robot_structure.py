"""The default structure: published peaks, a mechanical structure, a rigid housing."""

import numpy as np
import pytest

from millfrf.core import InputError
from modal_fit import ModalModel, Residuals
from replay_data import default_structure, table_one_model, tip_model
from replay_data.robot_structure import SENSOR_FROM_TIP


def test_table_one_has_the_peaks_evaluated_independently() -> None:
    """Largest |Hxx|, |Hyy|, |Hzz| computed twice from the printed table, m/N at Hz, to three digits."""
    frequencies = np.arange(12, 25, 0.01)
    receptance = np.abs(table_one_model().receptance(frequencies))
    for axis, (peak, where) in enumerate([(4.28e-6, 17.8), (1.52e-5, 16.95), (1.59e-6, 17.0)]):
        assert receptance[:, axis, axis].max() == pytest.approx(peak, rel=4e-3)
        assert frequencies[receptance[:, axis, axis].argmax()] == pytest.approx(where, abs=0.05)


def test_a_step_of_force_gives_no_step_of_velocity() -> None:
    """The velocity of a mechanical structure starts at zero: sum 2 Re(right left^T) = 0, at the tip and the housing."""
    structure = default_structure()
    immediate = 2 * np.real(np.einsum("rp,rq->pq", structure.right, structure.left))
    assert np.abs(immediate).max() < 1e-12 * np.abs(structure.right).max() * np.abs(structure.left).max()
    lone = table_one_model()
    assert np.abs(2 * np.real(np.einsum("rp,rq->pq", lone.right, lone.left))).max() > 1e-5


def test_modes_out_of_band_change_the_close_pair_little() -> None:
    frequencies = np.arange(14, 23, 0.01)
    with_them = tip_model(default_structure()).receptance(frequencies)
    alone = table_one_model().receptance(frequencies)
    change = np.abs(with_them - alone).max(axis=0) / np.abs(alone).max(axis=0)
    assert change.max() < 0.1
    assert change[1, 1] < 0.02
    assert np.diag(np.abs(with_them - alone).max(axis=0)).min() > 5e-8  # but they are there


def test_the_housing_moves_with_the_tip_as_one_rigid_body() -> None:
    """Two points of a rigid body keep their distance: the relative motion is square to the line between them."""
    structure = default_structure()
    relative = structure.right[:, 3:] - structure.right[:, :3]
    assert np.abs(relative @ np.array(SENSOR_FROM_TIP)).max() < 1e-12 * np.abs(structure.right).max()


def test_the_housing_moves_less_than_the_tip_and_differently_in_each_close_mode() -> None:
    structure = default_structure()
    ratio = np.abs(structure.right[:2, 3:] / structure.right[:2, :3])
    assert ratio.min() > 0.75
    assert ratio.max() < 0.97
    assert np.abs(ratio[0] - ratio[1]).min() > 0.03


def test_a_structure_without_a_tip_or_with_residuals_is_refused() -> None:
    lone = table_one_model()
    housing_only = ModalModel(lone.poles, lone.right, lone.left, ("A:+X", "A:+Y", "A:+Z"), lone.excitations)
    with pytest.raises(InputError, match=r"has no TCP:\+X, TCP:\+Y, TCP:\+Z; it has A:\+X"):
        tip_model(housing_only)
    rest = Residuals(np.eye(3), np.zeros((3, 3)))
    with pytest.raises(InputError, match="describe the motion out of band by modes"):
        tip_model(ModalModel(lone.poles, lone.right, lone.left, lone.responses, lone.excitations, residuals=rest))
