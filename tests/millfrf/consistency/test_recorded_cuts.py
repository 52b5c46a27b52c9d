"""Cutting data of lobes against the cuts in which the structure was measured: cutter and material, in every file."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.lab_cell import Record, draw_structure, sweeps
from millfrf.command_line import DONE, run
from millfrf.cutting import read_cutting_process
from millfrf.gate import check_recorded_cuts, recorded_cuts
from millfrf.stability import read_lobes

CUT = """[cutting]
teeth = 2
diameter_m = 0.0127
edge_angle_deg = 90.0
ktc_pa = 119e6
krc = 0.17
kac = 0.33
start_angle_deg = 90.0
exit_angle_deg = 180.0
feed_per_tooth_m = 0.15e-3
"""
RECORDED = {
    f"{name}.h5": {
        "teeth": 2,
        "diameter_m": 0.0127,
        "edge_angle_deg": 90.0,
        "ktc_pa": 119e6,
        "krc": 0.17,
        "kac": 0.33,
        "start_angle_deg": start,
        "exit_angle_deg": start + 41,
        "feed_per_tooth_m": 0.15e-3,
    }
    for name, start in (("up", 0.0), ("down", 139.0))
}


def warnings_of(folder: Path, *changes: tuple[str, str]) -> list[str]:
    text = CUT
    for pattern, value in changes:
        text, count = re.subn(pattern, value, text)
        assert count == 1
    (folder / "cut.toml").write_text(text)
    return check_recorded_cuts(read_cutting_process(folder / "cut.toml"), "cut.toml", RECORDED)


@pytest.mark.parametrize(
    ("pattern", "value", "says"),
    [
        ("teeth = 2", "teeth = 1", "has teeth = 1, but up.h5, down.h5, .* state teeth = 2; another cutter"),
        ("0.0127", "0.00635", "has diameter_m = 0.00635, .* state diameter_m = 0.0127; another cutter"),
        ("edge_angle_deg = 90.0", "edge_angle_deg = 2.0", "state edge_angle_deg = 90; another cutter"),
        ("119e6", "238e6", r"has ktc_pa = 2.38e\+08, .* state ktc_pa = 1.19e\+08; .* another material"),
        (
            "krc = 0.17\nkac = 0.33",
            "krc = 0.33\nkac = 0.17",
            r"has krc = 0.33, kac = 0.17, .* state krc = 0.17, kac = 0.33",
        ),
        ("kac = 0.33", "kac = -0.33", "has kac = -0.33, .* state kac = 0.33"),
    ],
)
def test_another_cutter_or_material_than_in_the_recordings(tmp_path: Path, pattern: str, value: str, says: str) -> None:
    (text,) = warnings_of(tmp_path, (pattern, value))
    assert re.search(says, text), text


@pytest.mark.parametrize(
    "changes",
    [
        (),
        (("119e6", "127e6\nktc_std_pa = 6e6"),),  # 7 % off, with 5 % stated
        (("start_angle_deg = 90.0", "start_angle_deg = 0.0"),),  # the engagement is that of the planned cut
        (("0.15e-3", "0.1e-3"),),
        (("kac = 0.33", "kac = 0.33\nhelix_angle_deg = 30.0"),),  # of which the recordings state nothing
    ],
)
def test_the_same_cutter_and_material(tmp_path: Path, changes: tuple[tuple[str, str], ...]) -> None:
    assert warnings_of(tmp_path, *changes) == []


def test_set_ups_that_state_less_than_a_cutting_file(tmp_path: Path) -> None:
    (tmp_path / "cut.toml").write_text(CUT)
    process = read_cutting_process(tmp_path / "cut.toml")
    assert check_recorded_cuts(process, "cut.toml", {"up.h5": {"teeth": 3}, "x.h5": {"immersion": "slot"}}) == []


def test_the_cuts_of_the_recordings_reach_the_lobes(
    written: Callable[[dict[str, Record]], list[Path]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rng = np.random.default_rng(5)
    drawn = draw_structure(rng)
    records = sweeps(replace(drawn, sensor=drawn.tip), rng)
    for record in records.values():
        record.places = [place.replace("HOUSING", "TCP") for place in record.places]
    paths = written(records)
    frf, model, cut = (tmp_path / name for name in ("frf.h5", "model.json", "cut.toml"))
    assert run(["estimate", *map(str, paths), "--out", str(frf), "--band", "10", "30"]) == DONE
    assert run(["fit", str(frf), "--out", str(model), "--band", "13", "25"]) == DONE
    assert recorded_cuts([model]) == recorded_cuts([frf]) == recorded_cuts(paths)
    assert set(recorded_cuts(paths)) == {"central.h5", "down.h5", "up.h5"}
    cut.write_text(CUT.replace("teeth = 2", "teeth = 3"))
    capsys.readouterr()
    limits = tmp_path / "lobes.csv"
    speeds = ["--speeds", "500", "900", "3", "--max-depth", "0.02"]
    assert run(["lobes", str(model), "--cutting", str(cut), *speeds, "--out", str(limits)]) == DONE
    said = capsys.readouterr()
    text = "cut.toml has teeth = 3, but central.h5, down.h5, up.h5, from which the structure comes, state teeth = 2"
    assert text in said.err
    assert any(text in stored for stored in read_lobes(limits).warnings)
    assert "the cutting file alone states 3 edges, engaged from 90 to 180 degrees" in said.out
