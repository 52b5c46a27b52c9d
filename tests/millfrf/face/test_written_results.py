"""Results that a step wrote to a file: named as sources, and taken by the report instead of their files."""

import json
from pathlib import Path

import numpy as np
import pytest

import millfrf as mf
from estimation import write_frf
from millfrf.core import InputError
from millfrf.core.steps import written_file
from millfrf.cutting import MillingProcess, write_cutting_process
from replay_data import table_one_model


@pytest.fixture
def frf(tmp_path: Path) -> str:
    path = tmp_path / "frf.h5"
    write_frf(path, table_one_model().frf(np.arange(8.0, 60.0, 0.25)))
    return str(path)


def test_a_written_result_is_a_source_of_what_is_made_of_it(frf: str, tmp_path: Path) -> None:
    model, cut = tmp_path / "model.json", tmp_path / "cut.toml"
    fitted = mf.fit(frf, out=str(model))
    assert written_file(fitted) == model
    write_cutting_process(cut, MillingProcess(2, 0.01, np.pi / 2, 6e8, 1 / 3, 0.0, np.pi / 2, np.pi, 1e-4))
    lobes = mf.lobes(fitted, str(cut), speeds=(9000, 10000, 2), out=str(tmp_path / "lobes.csv"))
    notes = json.loads((tmp_path / "lobes.csv-metadata.json").read_text(encoding="utf-8"))["notes"][0]
    assert [source["file"] for source in notes["provenance"]["sources"]] == ["model.json", "cut.toml"]
    warnings = mf.report(fitted, lobes, str(cut), out=str(tmp_path / "page.html"))
    assert (tmp_path / "page.html").exists()
    assert not any("was not made from" in text for text in warnings)


def test_a_result_in_no_file_is_refused_with_the_remedy(frf: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="out=FILE"):
        mf.report(mf.fit(frf), out=str(tmp_path / "page.html"))
    assert not (tmp_path / "page.html").exists()
