"""Every output says what it was made from: files with hashes, options, versions of the program and its libraries."""

import csv
import hashlib
import json
import shutil
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scipy.io import loadmat
from writing_commands import COMMANDS, Writing

from millfrf.command_line import run
from millfrf.core.provenance import read_provenance

WITHOUT = {
    "convert uff": "UFF has no place for it",
    "convert modes": "UFF has no place for it",
    "robot modes": "a page",
    "robot map": "a picture",
}
PAGES = (".html", ".png")
SLOW = ("diagnose", "cut diagnose", "fit records", "chatter", "calibrate", "tap")


def origin_of(path: Path) -> dict[str, Any]:
    """What an output says of its making, read as its format stores it."""
    if path.suffix == ".npz":
        with np.load(path) as stored:
            return dict(json.loads(str(stored["provenance"])))
    if path.suffix == ".mat":
        return dict(json.loads(str(np.ravel(loadmat(path)["provenance"])[0])))
    if path.suffix == ".h5":
        with h5py.File(path) as file:
            return dict(json.loads(file.attrs["provenance"]))
    return read_provenance(path)


def _hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def judge(one: Writing, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run a command and look at each of its files."""
    monkeypatch.chdir(folder)
    # a file that another one names may be a source, too
    present = {_hash(path) for path in folder.rglob("*") if path.is_file()}
    assert run(one.words) == 0
    given = [word for word in one.words[1:] if (folder / word).is_file() and word not in one.outputs]
    hashes = {_hash(folder / word) for word in given}
    for name in one.outputs:
        if Path(name).suffix in PAGES:
            continue
        result = origin_of(folder / name)
        assert result["versions"]["millfrf"], name
        assert result["versions"]["numpy"] == np.__version__
        assert result.get("step") or result.get("command")
        if given:
            stated = {source["sha256"] for source in result["sources"]}
            assert stated & hashes, name
            assert stated <= present, name


QUICK = [one for one in COMMANDS if one.name not in WITHOUT and one.name not in SLOW]


@pytest.mark.long
@pytest.mark.parametrize("one", QUICK, ids=lambda one: one.name)
def test_an_output_says_what_it_was_made_from(
    one: Writing, inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(inputs, tmp_path / "bench")
    judge(one, tmp_path / "bench", monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize("name", SLOW)
def test_a_slow_output_says_what_it_was_made_from(
    name: str, inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(inputs, tmp_path / "bench")
    (item,) = [each for each in COMMANDS if each.name == name]
    judge(item, tmp_path / "bench", monkeypatch)


def test_a_csv_with_its_origin_is_still_a_table(inputs: Path, tmp_path: Path) -> None:
    assert run(["convert", str(inputs / "up.h5"), str(tmp_path / "a.csv")]) == 0
    with (tmp_path / "a.csv").open(encoding="utf-8") as file:
        rows = list(csv.reader(line for line in file if not line.startswith("#")))
    assert rows[0][0] == "time [s]"
    assert run(["convert", str(tmp_path / "a.csv"), str(tmp_path / "back.h5")]) == 0
