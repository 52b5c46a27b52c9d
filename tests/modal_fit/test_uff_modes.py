"""Modal models in UFF 55: round trip, and what another reader sees."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pyuff

from foundation import FileFormatError, InputError
from modal_fit import read_modes_uff, write_modes_uff
from replay_data import default_structure, table_one_model


def test_round_trip_keeps_sides_signs_and_nodes(tmp_path: Path) -> None:
    structure = default_structure()
    turned = replace(structure, responses=tuple(label.replace("TCP:+Y", "TCP:-Y") for label in structure.responses))
    write_modes_uff(tmp_path / "modes.uff", turned)
    found = read_modes_uff(tmp_path / "modes.uff")
    assert (found.responses, found.excitations) == (turned.responses, turned.excitations)
    np.testing.assert_allclose(found.poles, turned.poles, rtol=1e-5)
    np.testing.assert_allclose(found.right, turned.right, rtol=1e-5, atol=1e-5 * np.abs(turned.right).max())
    np.testing.assert_allclose(found.left, turned.left, rtol=1e-5, atol=1e-5 * np.abs(turned.left).max())
    assert [path.name for path in tmp_path.iterdir()] == ["modes.uff"]


def test_another_reader_sees_complex_modes(tmp_path: Path) -> None:
    model = table_one_model()
    write_modes_uff(tmp_path / "modes.unv", model)
    sets = pyuff.UFF(str(tmp_path / "modes.unv")).read_sets()
    assert [s["analysis_type"] for s in sets] == [3] * 4
    np.testing.assert_allclose(sets[2]["eig"], model.poles[1], rtol=1e-5)
    np.testing.assert_allclose(np.ravel(sets[2]["r2"])[0], model.right[1, 1], rtol=1e-5)


def test_unusable_files_and_models_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no file"):
        read_modes_uff(tmp_path / "none.uff")
    with pytest.raises(InputError, match="suffix"):
        write_modes_uff(tmp_path / "a.txt", table_one_model())
    (tmp_path / "junk.uff").write_text("nothing\n" * 20, encoding="utf-8")
    with pytest.raises(FileFormatError):
        read_modes_uff(tmp_path / "junk.uff")
