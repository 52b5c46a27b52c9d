"""FRFs in UFF 58 and 58b: round trips, pyuff as the other reader, and sdypy-EMA on the same file."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pyuff

from estimation import Frf, read_frf_uff, write_frf_uff
from millfrf.core import FileFormatError, InputError
from replay_data import table_one_model

AXIS = np.arange(0.0625, 40.0, 0.0625)


def frf(quantity: str = "receptance", unit: str = "m/N") -> Frf:
    return replace(table_one_model().frf(AXIS), quantity=quantity, unit=unit)


@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize(
    ("quantity", "unit"),
    [("receptance", "m/N"), ("mobility", "m/s/N"), ("accelerance", "m/s^2/N"), ("transfer", "m/V")],
)
def test_round_trip(tmp_path: Path, binary: bool, quantity: str, unit: str) -> None:
    truth = frf(quantity, unit)
    write_frf_uff(tmp_path / "a.uff", truth, binary=binary)
    result = read_frf_uff(tmp_path / "a.uff")
    assert (result.responses, result.excitations) == (truth.responses, truth.excitations)
    assert (result.quantity, result.unit) == (quantity, unit)
    np.testing.assert_allclose(result.frequencies, truth.frequencies, rtol=1e-9)
    np.testing.assert_allclose(result.values, truth.values, rtol=1e-9, atol=1e-20)
    assert result.valid.all()
    assert [path.name for path in tmp_path.iterdir()] == ["a.uff"]


def test_lines_without_frf_and_an_odd_axis_survive(tmp_path: Path) -> None:
    axis = np.sort(np.random.default_rng(0).uniform(1, 40, 200))
    valid = np.arange(200) % 9 != 0
    truth = replace(table_one_model().frf(axis), valid=valid)
    truth = replace(truth, values=np.where(valid[:, None, None], truth.values, 0))
    write_frf_uff(tmp_path / "a.uff", truth)
    result = read_frf_uff(tmp_path / "a.uff")
    np.testing.assert_allclose(result.frequencies, axis, rtol=1e-10)
    np.testing.assert_array_equal(result.valid, valid)


def test_another_reader_sees_nodes_directions_and_values(tmp_path: Path) -> None:
    truth = replace(frf(), responses=("HOUSING:+X", "HOUSING:-Y", "TCP:+Z"))
    write_frf_uff(tmp_path / "a.unv", truth)
    sets = pyuff.UFF(str(tmp_path / "a.unv")).read_sets()
    assert len(sets) == 9
    second = sets[3]  # response 2, excitation 1
    assert (second["rsp_ent_name"].strip(), second["rsp_dir"], second["ref_dir"]) == ("HOUSING", -2, 1)
    assert (second["rsp_node"], second["ref_node"]) == (1, 2)
    np.testing.assert_allclose(second["data"], truth.values[:, 1, 0], rtol=1e-9)


def test_sdypy_ema_fits_the_file_unchanged(tmp_path: Path) -> None:
    """The modes of Table 1 from this file by another package, its receptance taken for a receptance."""
    from sdypy import EMA

    write_frf_uff(tmp_path / "a.uff", frf())
    sets = pyuff.UFF(str(tmp_path / "a.uff")).read_sets()
    assert all(s["ordinate_spec_data_type"] == 8 and s["orddenom_spec_data_type"] == 13 for s in sets)
    values = np.array([s["data"] for s in sets])
    model = EMA.Model(values, sets[0]["x"], lower=1, upper=39, pol_order_high=20, frf_form="receptance")
    model.get_poles(show_progress=False)
    poles = np.asarray(model.all_poles[-1])
    for true in table_one_model().poles:
        assert np.abs(poles - true).min() < 1e-3 * abs(true)


def test_unusable_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "junk.uff").write_bytes(b"nothing at all\n" * 20)
    with pytest.raises(FileFormatError):
        read_frf_uff(tmp_path / "junk.uff")
    with pytest.raises(InputError, match="no file"):
        read_frf_uff(tmp_path / "none.uff")
    write_frf_uff(tmp_path / "a.uff", frf())
    sets = [s | {"binary": 0} for s in pyuff.UFF(str(tmp_path / "a.uff")).read_sets()]
    pyuff.UFF(str(tmp_path / "less.uff")).write_sets(sets[:-1], "overwrite")
    with pytest.raises(FileFormatError, match="lacks"):
        read_frf_uff(tmp_path / "less.uff")
    pyuff.UFF(str(tmp_path / "twice.uff")).write_sets([*sets, sets[0]], "overwrite")
    with pytest.raises(FileFormatError, match="twice"):
        read_frf_uff(tmp_path / "twice.uff")
    with pytest.raises(InputError, match="suffix"):
        write_frf_uff(tmp_path / "a.txt", frf())
    with pytest.raises(InputError, match="10 characters"):
        write_frf_uff(tmp_path / "b.uff", replace(frf(), responses=("SPINDLEHOUSING:+X", "B:+X", "C:+X")))
