"""`millfrf cut diagnose` from files to files, and what it refuses."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from acquisition import record
from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.cutting import MillingProcess, read_cutting_process, write_cutting_process
from modal_fit import write_modal_model
from replay_data import (
    MillingCell,
    default_structure,
    dynamometer,
    housing_accelerometers,
    table_one_model,
    tip_accelerometers,
)
from replay_data.speed_profiles import DriftingSpeed

CUT = MillingProcess(2, 12.7e-3, math.pi / 2, 119e6, 0.17, 0.33, math.pi / 2, math.pi, 0.15e-3)
SPEED = 800 * math.pi / 30


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cutting file that knows of no runout, and a recording that has some."""
    where = tmp_path_factory.mktemp("cut")
    write_cutting_process(where / "cut.toml", CUT)
    true = replace(CUT, runout=15e-6, ktc=1.1 * CUT.ktc)
    sensors = dynamometer() + tip_accelerometers()
    record(MillingCell(default_structure(), true, 1e-3, SPEED, 6.5, sensors=sensors, seed=3), where / "cut.h5")
    return where


@pytest.mark.long
def test_from_files_to_files(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = folder / "out"
    cut = str(folder / "cut.toml")
    assert run(["cut", "diagnose", cut, str(folder / "cut.h5"), "--depth", "0.001", "--out", str(out)]) == DONE
    text = capsys.readouterr().out
    assert "verdict: explained" in text
    assert "runout: radial offset 15." in text or "runout: radial offset 14.9" in text
    content = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    assert (content["format"], content["format_version"]) == ("millfrf.diagnosis", 2)
    assert {cause["name"] for cause in content["physics"]} == {"runout", "regenerative_feedback"}
    keys = {"name", "location", "parameters", "standard_errors", "evidence", "error_parts"}
    assert set(content["physics"][0]) == keys
    assert content["compared"] == "cut"
    assert content["improvement"]["after"] < 0.05 * content["improvement"]["before"]
    assert content["cut"]["recordings"][0]["spindle_speed_rpm"] == pytest.approx(800, abs=0.01)
    improved = read_cutting_process(out / "improved_cut.toml")
    assert improved.runout == pytest.approx(15e-6, rel=0.02)
    assert improved.ktc == pytest.approx(1.1 * CUT.ktc, rel=0.01)
    page = (out / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/") == 2, "forces over a revolution, and the residual over orders"
    assert "Explained" in page
    write_modal_model(folder / "model.json", table_one_model())
    lobes = ["lobes", str(folder / "model.json"), "--cutting", str(out / "improved_cut.toml")]
    assert run([*lobes, "--speeds", "800", "900", "2", "--max-depth", "0.02", "--out", str(folder / "l.csv")]) == DONE


def _bad(folder: Path, *words: str) -> list[str]:
    given = [word if word.startswith("-") or not word.endswith((".toml", ".h5", ".json")) else str(folder / word)
             for word in words]  # fmt: skip
    return ["cut", "diagnose", *given, "--out", str(folder / "bad")]


def test_what_is_refused_is_said_in_one_line(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sensors = housing_accelerometers() + dynamometer()[:1]
    record(MillingCell(default_structure(), CUT, 1e-3, SPEED, 1.0, sensors=sensors), folder / "one_force.h5")
    wandering = DriftingSpeed(SPEED, 0.05, 3.0)
    record(MillingCell(default_structure(), CUT, 1e-3, wandering, 1.0, sensors=dynamometer()), folder / "drift.h5")
    record(MillingCell(default_structure(), CUT, 1e-3, SPEED, 1.0, sensors=dynamometer()), folder / "short.h5")
    write_cutting_process(folder / "helix.toml", replace(CUT, helix_angle=0.5))
    write_cutting_process(folder / "still.toml", replace(CUT, feed_per_tooth=0.0))
    depth = ("--depth", "0.001")
    cases = {
        ("none.toml", "cut.h5", *depth): "no file",
        ("cut.toml", "none.h5", *depth): "none.h5",
        ("cut.toml", "one_force.h5", *depth): "forces at TCP:+X and TCP:+Y are needed",
        ("cut.toml", "drift.h5", *depth): "states no spindle speed that is constant or swept linearly",
        ("cut.toml", "short.h5", *depth): "80 are the least",
        ("cut.toml", "cut.h5", *depth, "--speed", "950"): "no tooth passing within 2 % of 950 rpm",
        ("cut.toml", "cut.h5", *depth, "--speed", "-5"): "spindle speed -5 rpm must be positive",
        ("helix.toml", "cut.h5", *depth): "does not take helical edges",
        ("still.toml", "cut.h5", *depth): "without a feed no force can be computed",
        ("cut.toml", "cut.h5", "--depth", "-1"): "depth -1 m must be positive",
        ("cut.toml", "cut.h5", "cut.h5", *depth): "recordings need different names",
    }
    for words, message in cases.items():
        assert run(_bad(folder, *words)) == BAD_INPUT, words
        error = capsys.readouterr().err
        assert message in error, (words, error)
        assert error.count("\n") == 1
    assert not (folder / "bad").exists()
