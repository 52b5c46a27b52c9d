"""The tutorial's commands, run one after the other on the files that it is about, give what it says."""

import importlib.util
import re
import shlex
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from millfrf.__main__ import run
from modal_fit import read_modal_model
from stability import read_lobes

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "tutorials" / "mat_to_cut.md").read_text(encoding="utf-8")


def _blocks(kind: str) -> list[str]:
    return re.findall(rf"```{kind}\n(.*?)```", PAGE, re.DOTALL)


def _example(name: str) -> Any:
    spec = importlib.util.spec_from_file_location(name, ROOT / "examples" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_from_mat_files_to_a_safe_cut(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    _example("lab_files").write_lab_files(tmp_path)
    (tmp_path / "hits.csv").write_text(next(text for text in _blocks("text") if text.startswith("file,hit")))
    (tmp_path / "cut.toml").write_text(next(text for text in _blocks("toml") if text.startswith("# cut.toml")))
    for line in "".join(_blocks("console")).splitlines():
        assert run(shlex.split(line)[1:]) == 0, line
        for name in ("cuts", "hits"):  # what the reader fills in
            shutil.copy(ROOT / "examples" / f"lab_{name}.toml", tmp_path / f"{name}.toml")
    model = read_modal_model(tmp_path / "at_tip.json")
    np.testing.assert_allclose(model.natural_frequencies, [16.99, 18.48, 52.0], rtol=2e-3)
    np.testing.assert_allclose(model.damping_ratios, [0.0285, 0.0996, 0.04], rtol=1e-2)
    lobes = read_lobes(tmp_path / "lobes.csv")
    at_1200 = np.argmin(np.abs(lobes.spindle_speeds - 1200 * np.pi / 30))
    assert lobes.depth_limits[at_1200] == pytest.approx(2.35e-3, rel=0.02)
    assert (tmp_path / "report.html").stat().st_size > 1e5


def test_the_mappings_that_ship_differ_from_the_templates_by_what_the_reader_fills_in(tmp_path: Path) -> None:
    """Names, arrays and columns are those that `millfrf new mapping` proposes."""
    import tomllib

    from millfrf.new.making import mapping_for

    _example("lab_files").write_lab_files(tmp_path, 1.0)
    for source, name in (("cut_down.mat", "cuts"), ("hit_x.mat", "hits")):
        proposed = tomllib.loads(mapping_for(tmp_path / source).text)
        filled = tomllib.loads((ROOT / "examples" / f"lab_{name}.toml").read_text(encoding="utf-8"))
        assert proposed["sample_rate"] == filled["sample_rate"]
        for given, complete in zip(proposed["channels"], filled["channels"], strict=True):
            assert given.items() <= complete.items()
            assert set(complete) - set(given) <= {"unit", "quantity"}
