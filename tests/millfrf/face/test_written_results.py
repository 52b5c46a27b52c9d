"""Results that a step wrote to a file: named as sources, and taken by the report instead of their files."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import millfrf as mf
from millfrf.core import InputError
from millfrf.core.steps import written_file
from millfrf.cutting import MillingProcess, write_cutting_process


def test_a_written_result_is_a_source_of_what_is_made_of_it(simulated_frf: str, tmp_path: Path) -> None:
    model, cut = tmp_path / "model.json", tmp_path / "cut.toml"
    fitted = mf.fit(simulated_frf, out=str(model))
    assert written_file(fitted) == model
    assert written_file(replace(fitted, warnings=())) is None
    write_cutting_process(cut, MillingProcess(2, 0.01, np.pi / 2, 6e8, 1 / 3, 0.0, np.pi / 2, np.pi, 1e-4))
    lobes = mf.lobes(fitted, str(cut), speeds=(9000, 10000, 2), out=str(tmp_path / "lobes.csv"))
    notes = json.loads((tmp_path / "lobes.csv-metadata.json").read_text(encoding="utf-8"))["notes"][0]
    assert [source["file"] for source in notes["provenance"]["sources"]] == ["model.json", "cut.toml"]
    warnings = mf.report(fitted, lobes, str(cut), out=str(tmp_path / "page.html"))
    assert (tmp_path / "page.html").exists()
    assert not any("was not made from" in text for text in warnings)


def test_a_file_that_was_replaced_is_no_source(simulated_frf: str, tmp_path: Path) -> None:
    model = tmp_path / "model.json"
    fitted = mf.fit(simulated_frf, out=str(model))
    model.unlink()
    mf.fit(simulated_frf, modes=1, out=str(model))
    assert written_file(fitted) is None
    with pytest.raises(InputError, match="changed since"):
        mf.report(fitted, out=str(tmp_path / "page.html"))


def test_a_result_in_no_file_is_refused_with_the_remedy(simulated_frf: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="out=FILE"):
        mf.report(mf.fit(simulated_frf), out=str(tmp_path / "page.html"))
    assert not (tmp_path / "page.html").exists()
