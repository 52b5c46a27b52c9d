"""`millfrf tool` from recordings of taps to lobes, and what it says of files that cannot be used."""

import json
import runpy
from pathlib import Path

import numpy as np
import pytest

from estimation import read_frf, write_frf
from millfrf.command_line import run
from modal_fit import ModalModel

BLANK = """frf = "blank.h5"

[distance_from_tip_m]
TCP = 0.0
MID = 0.04

[material.carbide]
youngs_modulus_pa = 580e9
density_kg_per_m3 = 14500

[[segment]]
material = "carbide"
length_m = 0.07
diameter_m = 0.012
"""
CUT = """[cutting]
teeth = 2
diameter_m = 0.012
edge_angle_deg = 90
ktc_pa = 1.2e9
krc = 0.25
start_angle_deg = 90
exit_angle_deg = 180
feed_per_tooth_m = 1e-4
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A blank, its FRF at two points, and a tool that is the same cylinder."""
    monkeypatch.chdir(tmp_path)
    natural, points = 2 * np.pi * np.array([420.0, 900.0, 1900.0]), ("TCP:+X", "MID:+X")
    shapes = np.array([[0.5, 0.3], [0.9, 0.2], [1.2, -0.4]]) / np.sqrt(2j * natural)[:, None]
    model = ModalModel(-0.02 * natural + 1j * natural, shapes, shapes, points, points)
    write_frf("blank.h5", model.frf(np.arange(100.0, 2400.0, 10.0)))
    Path("blank.toml").write_text(BLANK, encoding="utf-8")
    Path("new.toml").write_text(BLANK.split("\n", 2)[2], encoding="utf-8")
    return tmp_path


def test_the_same_cylinder_has_the_tip_that_was_measured(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["tool", "blank.toml", "--new", "new.toml", "--out", "tip.h5", "--picture", "tip.png"]) == 0
    predicted, measured = read_frf("tip.h5"), read_frf("blank.h5")
    assert predicted.responses == ("TCP:+X",)
    assert np.allclose(predicted.values[:, 0, 0], measured.values[:, 0, 0], rtol=1e-3, atol=0)
    assert Path("tip.png").stat().st_size > 10_000
    shown = capsys.readouterr()
    assert "only one blank was tapped" in shown.err + shown.out
    # above the band of the taps nothing is said
    assert predicted.band == (100.0, 2390.0)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("frf = ", "# frf = "), "names no FRF: add frf ="),
        (('"blank.h5"', '"none.h5"'), "no file"),
        (("TCP = 0.0", "TIP = 0.0"), "do not determine how the base turns"),
        (("MID = 0.04", "MID = 0.08"), "MID is 0.08 m from the tip of a tool 0.07 m long"),
        (('"carbide"\nlength', '"steel"\nlength'), "add a table [material.steel]"),
        (("length_m = 0.07", "length_m = -0.07"), "must be above 0, not -0.07"),
        (("length_m = 0.07", "length_m = 70"), "blank.toml, segment 1: length_m = 70 m is outside"),
        (("diameter_m = 0.012", "diameter_m = 12"), "is it in mm?"),
        (("580e9", "580"), "material carbide: youngs_modulus_pa = 580 Pa is outside"),
        (("14500", "14.5"), "is it in g/cm^3 (times 1000)?"),
        (("diameter_m = 0.012", "diameter_m = 0.012\nfluting = true"), "did you mean fluted"),
        (("diameter_m = 0.012", "diameter_m = 0.012\ninner_diameter_m = 0.013"), "must be below the"),
        (("diameter_m = 0.012", "diameter_m = 0.012\ncontact = true"), "its flexibility is part of the base"),
    ],
)
def test_files_that_cannot_be_used_are_refused_in_one_line(
    folder: Path, capsys: pytest.CaptureFixture[str], change: tuple[str, str], says: str
) -> None:
    Path("blank.toml").write_text(BLANK.replace(*change), encoding="utf-8")
    assert run(["tool", "blank.toml", "--new", "new.toml", "--out", "tip.h5"]) == 2
    assert says in " ".join(capsys.readouterr().err.split())
    assert not Path("tip.h5").exists()


@pytest.mark.slow
def test_from_recordings_of_taps_to_lobes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The commands of docs/another_tool.md."""
    example = runpy.run_path(str(Path(__file__).resolve().parents[3] / "examples" / "another_tool.py"))
    monkeypatch.chdir(tmp_path)
    example["write_taps"](tmp_path)
    Path("cut.toml").write_text(CUT, encoding="utf-8")
    for name in ("long", "short"):
        recordings = [f"{name}_{direction}_{point}.h5" for direction in "xy" for point in ("tcp", "mid")]
        assert run(["tap", *recordings, "--segment", "0.35", "--exponential", "none", "--out", f"{name}.h5"]) == 0
    command = ["tool", "long.toml", "short.toml", "--new", "endmill.toml", "--out", "tip.h5", "--picture", "tip.png"]
    capsys.readouterr()
    assert run([*command, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["error_shares"]["flutes of endmill.toml"] > 0.1
    assert run(["fit", "tip.h5", "--band", "150", "3500", "--out", "tip.json"]) == 0
    limits = ["--speeds", "8000", "20000", "5", "--max-depth", "0.004"]
    assert run(["lobes", "tip.json", "--cutting", "cut.toml", *limits, "--out", "lobes.csv"]) == 0
    predicted = read_frf("tip.h5")
    true = example["true_tip"](predicted.frequencies[predicted.valid])
    for k in range(2):
        off = np.abs(predicted.values[predicted.valid, k, k] - true.values[:, k, k])
        inside = (predicted.frequencies[predicted.valid] > 150) & (predicted.frequencies[predicted.valid] < 3500)
        assert np.median(off[inside] / np.abs(true.values[inside, k, k])) < 0.02
