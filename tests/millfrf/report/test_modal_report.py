"""What the report of a fit shows beside modes and charts, on a structure that is known."""

import html
import importlib.util
import json
import re
from pathlib import Path
from types import ModuleType

import pytest

from estimation import write_frf
from millfrf.command_line import run

EXAMPLE = Path(__file__).resolve().parents[3] / "examples" / "modal_report.py"


@pytest.fixture(scope="module")
def example() -> ModuleType:
    spec = importlib.util.spec_from_file_location("modal_report", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.long
def test_the_example_finds_its_modes(example: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    example.main(tmp_path)
    said = capsys.readouterr().out
    assert "modes fitted: 22.00 Hz, 48.00 Hz, 48.40 Hz, 71.00 Hz, 104.00 Hz" in said
    assert "(curve 2)" in said
    measures = [float(word) for word in said.partition("MPC: ")[2].split(", ")]
    assert measures[3] < 0.95  # the complex mode, and it alone
    assert min(measures[:3] + measures[4:]) > 0.99
    assert (tmp_path / "frf_gallery.svg").read_text(encoding="utf-8").count(" %</text>") == 8
    for picture in ("mode_indicators", "auto_mac", "mode_vectors", "reciprocity"):
        assert (tmp_path / f"{picture}.png").stat().st_size > 10_000


@pytest.fixture(scope="module")
def folder(example: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """FRF, model of all modes, model of a band's wrong modes, and their reports."""
    folder = tmp_path_factory.mktemp("modal_report")
    write_frf(folder / "frf.h5", example.measured())
    paths = {name: str(folder / name) for name in ("frf.h5", "model.json", "fewer.json")}
    band = ["--band", "10", "120"]
    assert run(["fit", paths["frf.h5"], *band, "--out", paths["model.json"]]) == 0
    assert run(["fit", paths["frf.h5"], *band, "--modes", "2", "--out", paths["fewer.json"]]) == 0
    for model in ("model", "fewer"):
        files = [paths["frf.h5"], paths[f"{model}.json"]]
        assert run(["report", *files, "--out", str(folder / f"{model}.html")]) == 0
    return folder


def words(page: Path) -> str:
    """Text of a page without marks and pictures."""
    text = re.sub(r"<style>.*?</style>", " ", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", text)).split())


def test_indicators_stand_in_the_report_and_tell_modes_that_were_left_out(folder: Path) -> None:
    full, fewer = words(folder / "model.html"), words(folder / "fewer.html")
    assert "mode indicators of the FRF" in full
    assert "without a mode at" not in full
    assert "without a mode at" in fewer
    assert "groups of poles that were not accepted as modes, and why" in fewer
    assert "not among the 2 asked for" in fewer


def test_shapes_are_measured_in_the_report_and_by_inspect(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    full = words(folder / "model.html")
    assert "mode shapes (right vectors, 12 points)" in full
    assert "auto-MAC of the right vectors" in full
    capsys.readouterr()
    assert run(["inspect", str(folder / "model.json")]) == 0
    said = capsys.readouterr().out
    assert "Mode shapes (right vectors, 12 points)" in said
    assert "12 points (1:+Z ... 12:+Z)" in said
    [row] = [
        line.split()
        for line in said.partition("Mode shapes")[2].partition("Reciprocity")[0].splitlines()
        if " 71.0" in line
    ]
    assert float(row[2]) < 0.95
    assert float(row[3]) > 3


def test_pairs_that_were_measured_both_ways_are_compared(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Points 2 and 11 of the beam are hit and measured: reciprocal, but for noise."""
    full = words(folder / "model.html")
    assert "FRFs that were measured both ways" in full
    assert "left against right vectors on 2 shared points" in full
    capsys.readouterr()
    assert run(["inspect", str(folder / "frf.h5")]) == 0
    said = capsys.readouterr().out
    [row] = [line.split() for line in said.splitlines() if line.strip().startswith("2:Z / 11:Z")]
    assert float(row[3]) < 5
    assert float(row[4]) > 0.99
    assert "not reciprocal" not in said


def test_many_frfs_are_ranked_and_drawn_page_by_page(folder: Path) -> None:
    """24 FRFs of the beam: one page of panels, and a table of all of them."""
    text = (folder / "model.html").read_text(encoding="utf-8")
    said = words(folder / "model.html")
    assert "misfit of 24 FRFs between" in said
    assert "FRFs 1 to 24 of 24, misfit" in said
    assert len(re.findall(r"<th scope=\"row\" class=\"n\">\d+</th><td>\d+:\+Z / \d+:\+Z</td>", text)) == 12 + 24
    assert "above 30 %" in words(folder / "fewer.html")  # three of five modes are missing


@pytest.mark.long
def test_poles_are_picked_from_candidates_and_the_report_says_so(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    frf, band = str(folder / "frf.h5"), ["--band", "10", "120"]
    paths = {name: str(tmp_path / name) for name in ("a.json", "b.json", "candidates.json", "poles.toml", "r.html")}
    assert run(["fit", frf, *band, "--out", paths["a.json"], "--candidates", paths["candidates.json"]]) == 0
    assert "groups of poles to pick from" in capsys.readouterr().out
    offered = json.loads((tmp_path / "candidates.json").read_text())
    groups = {each["group"]: each for each in offered["groups"]}
    taken = [each["group"] for each in offered["poles"]]
    assert [round(groups[number]["frequency_hz"], 1) for number in taken] == [22.0, 48.0, 48.4, 71.0, 104.0]
    assert len(offered["stabilisation"]["orders"]) == len(offered["stabilisation"]["poles_rad_per_s"])
    assert run(["inspect", paths["candidates.json"]]) == 0
    assert f"5 picked poles of candidates.json, {len(groups)} groups to pick from" in capsys.readouterr().out
    rows = "".join(f"[[poles]]\ngroup = {number}\n" for number in taken if number != taken[2])
    (tmp_path / "poles.toml").write_text(f'candidates = "candidates.json"\n{rows}')
    assert run(["inspect", paths["poles.toml"]]) == 0
    assert "4 picked poles of poles.toml" in capsys.readouterr().out
    assert run(["fit", frf, *band, "--poles", paths["poles.toml"], "--refine", "--out", paths["b.json"]]) == 0
    assert "4 poles picked in poles.toml, refined" in capsys.readouterr().out
    assert run(["report", frf, paths["b.json"], "--out", paths["r.html"]]) == 0
    assert "picked poles, refined (poles.toml)" in words(tmp_path / "r.html")
