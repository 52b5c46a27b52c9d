"""`millfrf robot ...`: what the commands print and write, and what they refuse."""

import csv
import shutil
from math import pi
from pathlib import Path

import numpy as np
import pytest

from estimation import read_frf
from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.core import read_csv
from millfrf.cutting import MillingProcess
from millfrf.robot_model import modal_model_at, read_planar_robot, read_spatial_robot, rigid_model, tool_down
from millfrf.stability import certified_lobes, multipliers, read_lobes
from millfrf.steps.robot.maps import depth_limits, depth_over_places, depth_over_redundancy
from millfrf.steps.robot.tip_lobes import at_the_tip
from modal_fit import read_modal_model
from replay_data import MillingCell

STAUBLI = read_spatial_robot("staubli_rx170").robot
HALF_DOWN = MillingProcess(2, 0.02, pi / 2, 700e6, 0.3, 0.1, pi / 2, pi, 1e-4)
FACE = MillingProcess(4, 0.05, pi / 4, 700e6, 0.3, 0.1, 0.0, pi, 1e-4)
CUT = """[cutting]
teeth = 2
diameter_m = 0.02
ktc_pa = 700e6
krc = 0.3
kac = 0.1
start_angle_deg = 90.0
exit_angle_deg = 180.0
"""


@pytest.fixture
def cut(tmp_path: Path) -> str:
    path = tmp_path / "cut.toml"
    path.write_text(CUT)
    return str(path)


@pytest.mark.long
@pytest.mark.parametrize("process", [HALF_DOWN, FACE], ids=["end mill", "face mill"])
@pytest.mark.parametrize("rpm", [3000.0, 6000.0])
def test_limits_of_postures_are_those_of_the_cut(process: MillingProcess, rpm: float) -> None:
    """Multipliers just below and above; averaged coefficients miss these limits by up to a factor of two."""
    rng = np.random.default_rng(4)
    low, high = np.radians([-90, -60, 40, -90, 20, -90]), np.radians([90, 60, 140, 90, 120, 90])
    models = [modal_model_at(STAUBLI, rng.uniform(low, high)) for _ in range(4)]
    speed = rpm * pi / 30
    for model, limit in zip(models, depth_limits(models, process, speed, 0.05), strict=True):
        assert multipliers(model, process, speed, 0.999 * limit).stable
        assert not multipliers(model, process, speed, 1.001 * limit).stable


def test_turning_the_redundancy_makes_an_unstable_cut_stable() -> None:
    """4 mm at 6000 rpm chatters with the tool upright and is stable with tool and table turned by 90 degrees."""
    place = tool_down([1.1, 0.0, 0.85], pi)
    result = depth_over_redundancy(STAUBLI, place, np.radians([0.0, 90.0]), HALF_DOWN, 200 * pi, 0.02, "table")
    assert result.values[0] < 3.6e-3
    assert result.values[1] > 4.4e-3


def test_places_on_two_processes_are_those_on_one() -> None:
    places = [tool_down([x, 0.1, 0.8]) for x in (0.7, 0.9, 1.1, 5.0)]
    single = depth_over_places(STAUBLI, places, HALF_DOWN, 100 * pi, 0.02)
    two = depth_over_places(STAUBLI, places, HALF_DOWN, 100 * pi, 0.02, workers=2)
    for first, second in zip(single, two, strict=True):
        assert first == pytest.approx(second, rel=1e-12, nan_ok=True)
    assert np.isnan(single[0]).tolist() == [False, False, False, True]


def test_modes_and_pictures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page, picture = tmp_path / "m.html", tmp_path / "m.png"
    assert run(["robot", "modes", "staubli_rx170", "--picture", str(page)]) == DONE
    assert "8.93" in capsys.readouterr().out
    assert "The lowest natural frequencies are 8.93" in page.read_text()
    assert "Displacements are exaggerated" in page.read_text()  # caption of the mode shapes
    assert "http://" not in page.read_text()  # it needs no network
    assert "https://" not in page.read_text()
    assert run(["robot", "modes", "staubli_rx170", "--at", "0.9", "0.1", "0.8", "--picture", str(picture)]) == DONE
    assert picture.stat().st_size > 1000
    assert run(["robot", "modes", "chen_2026", "--pose", "P1"]) == DONE
    assert "11.956" in capsys.readouterr().out


def test_frf_and_model_files(tmp_path: Path) -> None:
    frf, model = tmp_path / "f.h5", tmp_path / "m.json"
    posture = ["--joints", "0,-20,110,0,90,0"]
    assert run(["robot", "frf", "staubli_rx170", *posture, "--out", str(frf), "--lines", "50"]) == DONE
    assert run(["robot", "frf", "staubli_rx170", *posture, "--out", str(model)]) == DONE
    stored = read_frf(frf)
    assert stored.values == pytest.approx(read_modal_model(model).receptance(stored.frequencies), rel=1e-6, abs=1e-13)


def test_a_robot_mills_in_the_simulated_cell(tmp_path: Path) -> None:
    out = tmp_path / "cell.json"
    place = ["--at", "1.5", "0.1", "0.7", "--sensor-at", "0.06", "-0.04", "0.25"]
    assert run(["robot", "frf", "kuka_kr90_r3100", *place, "--out", str(out)]) == DONE
    structure = read_modal_model(out)
    step = 2 * np.real(np.einsum("rp,rq->pq", structure.right, structure.left))
    assert np.abs(step).max() < 1e-9 * np.abs(structure.right).max() * np.abs(structure.left).max()
    cut = MillingProcess(2, 12.7e-3, pi / 2, 119e6, 0.17, 0.33, pi / 2, pi, 0.15e-3)
    samples = MillingCell(structure, cut, 0.5e-3, 1000 * pi / 30, duration=0.2, sample_rate=8192.0).samples()
    assert samples.shape == (1638, 6)
    assert np.isfinite(samples).all()
    assert np.abs(samples[:, 3:]).max() > 0


def test_stiffness_and_list(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["robot", "stiffness", "fanuc_s420if"]) == DONE
    assert "largest deflection under 650 N: 3.173 mm" in capsys.readouterr().out
    assert run(["robot", "list"]) == DONE
    assert "staubli_rx170" in capsys.readouterr().out
    assert run(["robot", "list", "staubli_rx170"]) == DONE
    assert "Table 3 is missing" in capsys.readouterr().out


@pytest.mark.long
def test_deviation_of_drilled_holes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table, picture = tmp_path / "d.csv", tmp_path / "d.png"
    area = ["--x", "0.7", "1.0", "2", "--y", "-0.2", "0.2", "3"]
    options = ["--drill", "8", *area, "--out", str(table), "--picture", str(picture), "--position-tolerance", "5"]
    assert run(["robot", "deviation", "staubli_rx170", *options]) == DONE
    captured = capsys.readouterr()
    printed = captured.out
    assert "thrust 1" in printed
    assert "Monte Carlo" in printed
    assert "position tolerance needed (ISO 1101" in printed
    assert "at least" in printed
    assert "repeatability" in captured.err
    assert "cannot tell at 6" in printed
    doubts = read_csv(table).warnings
    with table.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 6
    assert captured.err == "".join(f"warning: {doubt}\n" for doubt in doubts)
    assert "repeatability" in doubts[0]
    assert picture.exists()
    for row in rows:
        moved = [float(row[f"deviation_{axis}_m"]) + float(row[f"weight_{axis}_m"]) for axis in "xy"]
        entry = [float(row[f"weight_{axis}_m"]) for axis in "xy"]
        # the axis must lie in its zone at entry, under weight alone, and under full thrust: they may not cancel
        assert float(row["position_tolerance_m"]) > 2 * max(np.hypot(*moved), np.hypot(*entry))
    known = [*options, "--repeatability", "0.04", "--force"]
    assert run(["robot", "deviation", "staubli_rx170", *known]) == DONE
    captured = capsys.readouterr()
    assert "holds at 6" in captured.out
    assert "repeatability" not in captured.err
    assert "40.0" in captured.out
    with table.open(newline="") as stream:
        better = [float(row["position_tolerance_m"]) for row in csv.DictReader(stream)]
    assert all(new > float(row["position_tolerance_m"]) for new, row in zip(better, rows, strict=True))


def test_lobes_and_posture_map(tmp_path: Path, cut: str) -> None:
    out = tmp_path / "l.csv"
    common = ["staubli_rx170", "--cutting", cut, "--max-depth", "0.02", "--at", "0.9", "0.1", "0.8"]
    common += ["--out", str(out), "--force"]
    assert run(["robot", "lobes", *common, "--speeds", "2500", "3000", "3"]) == DONE
    assert len(read_lobes(out).depth_limits) == 3
    assert run(["robot", "lobes", *common, "--turns", "-20", "20", "3", "--speed", "3000"]) == DONE
    with out.open() as stream:
        rows = list(csv.DictReader(line for line in stream if not line.startswith("#")))
    assert [float(row["angle_deg"]) for row in rows] == pytest.approx([-20, 0, 20])
    picture = tmp_path / "map.png"
    drawn = ["--turns", "-20", "20", "3", "--speed", "3000", "--picture", str(picture), "--depth", "0.002"]
    assert run(["robot", "lobes", *common, *drawn]) == DONE
    assert picture.stat().st_size > 10_000
    assert run(["robot", "lobes", *common, *drawn[:-1], "-1"]) == BAD_INPUT
    assert run(["robot", "lobes", *common]) == BAD_INPUT
    assert run(["robot", "lobes", *common, "--turns", "-20", "20", "3"]) == BAD_INPUT


def test_lobes_of_a_planar_robot_are_rigid_across(tmp_path: Path, cut: str) -> None:
    """Y has no compliance: the limit is that of the model with zeros there."""
    out, picture = tmp_path / "l.csv", tmp_path / "l.png"
    common = ["chen_2026", "--pose", "P2", "--cutting", cut, "--max-depth", "0.05", "--speeds", "2000", "3000", "2"]
    assert run(["robot", "lobes", *common, "--out", str(out), "--picture", str(picture)]) == DONE
    assert picture.exists()
    chen = read_planar_robot("chen_2026")
    model = at_the_tip(rigid_model(chen.robot, chen.poses["P2"]))
    assert np.abs(model.receptance(np.array([9.0]))[0, 1]).max() == 0
    limits = certified_lobes(model, HALF_DOWN, np.array([2000.0, 3000.0]) * pi / 30, 0.05).depth_limits
    assert read_lobes(out).depth_limits == pytest.approx(limits, rel=1e-6)


def test_workspace_map(tmp_path: Path, cut: str, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "w.png"
    area = ["staubli_rx170", "--picture", str(picture), "--x", "0.7", "1.1", "3", "--y", "-0.2", "0.2", "2"]
    assert run(["robot", "map", *area]) == DONE
    assert "6 of 6 places reached" in capsys.readouterr().out
    assert run(["robot", "map", *area, "--force", "--cutting", cut, "--speed", "3000"]) == DONE
    assert "depth limit" in capsys.readouterr().out
    assert run(["robot", "map", *area, "--force", "--speed", "3000"]) == BAD_INPUT


def test_compensation(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = tmp_path / "p.csv", tmp_path / "c.csv"
    path.write_text(
        "x_m,y_m,z_m,rx_rad,ry_rad,rz_rad,fx_n,fy_n,fz_n\n1.858,0,2.519,0.9573,0,2.9924,0,100,500\n"
        "1.85,0.02,2.51,0.9573,0,2.9924,0,100,500\n"
    )
    assert run(["robot", "compensate", "fanuc_s420if", str(path), "--out", str(out)]) == DONE
    assert "after correction" in capsys.readouterr().out
    assert out.exists()


@pytest.mark.long
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["modes", "nobody"], "chen_2026"),
        (["modes", "fanuc_s420if"], "no masses"),
        (["modes", "staubli_rx170", "--pose", "no"], "no posture 'no'"),
        (["modes", "staubli_rx170", "--joints", "a,b"], "list of degrees"),
        (["modes", "staubli_rx170", "--joints", "1,2"], "2 joint values for 6"),
        (["modes", "staubli_rx170", "--pose", "ready", "--joints", "0,0,0,0,0,0"], "once"),
        (["modes", "staubli_rx170", "--at", "9", "0", "0"], "does not reach"),
        (["modes", "chen_2026", "--at", "1", "0", "0"], "planar"),
        (["deviation", "staubli_rx170", "--x", "8", "9", "2"], "no hole"),
        (["frf", "staubli_rx170", "--out", "x.txt"], "suffix"),
    ],
)
def test_refusals(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["robot", *arguments]) == BAD_INPUT
    assert message in capsys.readouterr().err


def test_a_robot_file_of_ones_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from millfrf import robot_model

    source = Path(robot_model.__file__).parent / "robots" / "staubli_rx170.toml"
    own = tmp_path / "mine.toml"
    shutil.copy(source, own)
    own.write_text(
        own.read_text().replace("ratios = [0.065, 0.065]\n", "").replace("frequencies_hz = [5.9, 8.2]", "ratio = 0.03")
    )
    assert run(["robot", "modes", str(own)]) == DONE
    captured = capsys.readouterr()
    assert "3.00" in captured.out
    assert "Rayleigh" not in captured.err
