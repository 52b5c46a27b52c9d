"""`millfrf robot learn` and `robot frf --learned`: files that the other commands read."""

import csv
from pathlib import Path

import numpy as np
import pytest

from estimation import read_frf
from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.core.provenance import read_provenance
from millfrf.cutting import read_cutting_process
from millfrf.robot_model import modal_model_at, read_spatial_robot, with_joint_factor
from millfrf.stability import certified_lobes, read_lobes
from modal_fit import read_modal_model, write_modal_model

ROBOT = "kuka_kr90_r3100"
POSTURES = ("0,-10,100,0,90,0", "20,25,70,40,60,0", "-15,45,30,80,-50,0", "10,5,85,20,75,30")


CUT = (
    "[cutting]\nteeth = 2\ndiameter_m = 0.02\nedge_angle_deg = 90.0\nktc_pa = 700e6\nkrc = 0.3\nkac = 0.1\n"
    "start_angle_deg = 90.0\nexit_angle_deg = 180.0\nfeed_per_tooth_m = 1e-4\n"
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Models of a robot whose second joint is 15 % softer than its file says, and what was learned from them."""
    where = tmp_path_factory.mktemp("learned")
    softer = with_joint_factor(read_spatial_robot(ROBOT).robot, "2", 0.85)
    names = []
    for number, posture in enumerate(POSTURES, 1):
        q = np.radians([float(value) for value in posture.split(",")])
        names.append(str(where / f"hall_{number}.json"))
        write_modal_model(names[-1], modal_model_at(softer, q, highest_frequency=45.0))
    poses = [word for posture in POSTURES for word in ("--pose", posture)]
    assert run(["robot", "learn", ROBOT, *names, *poses, "--out", str(where / "postures.json")]) == DONE
    return where


def _frf(folder: Path, out: str, *more: str) -> None:
    learned = ["--learned", str(folder / "postures.json"), "--out", str(folder / out)]
    assert run(["robot", "frf", ROBOT, "--joints", "5,10,80,10,80,0", *learned, *more]) == DONE


def test_a_predicted_model_is_nearer_to_the_softer_robot_and_lobes_read_it(folder: Path) -> None:
    _frf(folder, "model.json")
    result = read_modal_model(folder / "model.json")
    robot, q = read_spatial_robot(ROBOT).robot, np.radians([5, 10, 80, 10, 80, 0])
    truth = modal_model_at(with_joint_factor(robot, "2", 0.85), q).natural_frequencies[:4]
    modelled = modal_model_at(robot, q).natural_frequencies[:4]
    left = np.abs(result.natural_frequencies[:4] / truth - 1).max()
    assert left < 0.3 * np.abs(modelled / truth - 1).max()
    assert result.covariance is not None
    cut = folder / "cut.toml"
    cut.write_text(CUT)
    asked = ["--cutting", str(cut), "--speeds", "2900", "3100", "3", "--max-depth", "0.01"]
    assert run(["lobes", str(folder / "model.json"), *asked, "--out", str(folder / "lobes.csv")]) == DONE


def test_the_band_holds_the_frf_of_the_same_prediction(folder: Path) -> None:
    _frf(folder, "band.csv", "--lines", "20")
    _frf(folder, "frf.h5", "--lines", "20")
    rows = [line.split(",") for line in (folder / "band.csv").read_text().splitlines() if not line.startswith("#")]
    middle, low, high = np.array([row[3:] for row in rows[1:]], dtype=float).T
    assert np.abs(read_frf(folder / "frf.h5").values).ravel() == pytest.approx(middle, rel=1e-4)
    diagonal = np.array([row[1] == row[2] for row in rows[1:]])
    assert np.mean((low <= middle) & (middle <= high), where=diagonal) > 0.95


@pytest.mark.long
def test_lobes_have_a_band_beside_them_and_a_picture(folder: Path) -> None:
    cut = folder / "cut_of_band.toml"
    cut.write_text(CUT)
    learned = ["--learned", str(folder / "postures.json"), "--joints", "5,10,80,10,80,0", "--cutting", str(cut)]
    asked = ["--speeds", "2900", "3100", "2", "--max-depth", "0.02", "--picture", str(folder / "band.png")]
    assert run(["robot", "lobes", ROBOT, *learned, *asked, "--out", str(folder / "limits.csv")]) == DONE
    lobes = read_lobes(folder / "limits.csv")
    rows = [line.split(",") for line in (folder / "limits_band.csv").read_text().splitlines() if line[0] != "#"]
    speed, low, middle, high = np.array(rows[1:], dtype=float).T
    assert speed == pytest.approx(lobes.spindle_speeds_rpm)
    assert np.all((low < middle) & (middle < high))
    assert np.all((low < lobes.depth_limits) & (lobes.depth_limits < high))
    q = np.radians([5, 10, 80, 10, 80, 0])
    truth = modal_model_at(with_joint_factor(read_spatial_robot(ROBOT).robot, "2", 0.85), q, highest_frequency=300.0)
    limits = certified_lobes(truth, read_cutting_process(cut), lobes.spindle_speeds, 0.02).depth_limits
    assert np.all((low < limits) & (limits < high))
    assert (folder / "band.png").stat().st_size > 10_000


PATH = "x_m,y_m,z_m,i,j,k\n1.6,0.1,0.7,0,0,1\n{end},0.1,0.7,0,0,1\n"


def _advice(folder: Path, *more: str) -> list[str]:
    (folder / "cut.toml").write_text(CUT)
    learned = ["--learned", str(folder / "postures.json"), "--cutting", str(folder / "cut.toml")]
    return ["robot", "advice", ROBOT, str(folder / "path.csv"), *learned, *more]


@pytest.mark.long
def test_advice_at_one_point_is_the_band_of_lobes_there(folder: Path) -> None:
    (folder / "path.csv").write_text(PATH.format(end=1.60001))
    asked = ["--speeds", "2900", "3100", "2", "--max-depth", "0.02"]
    exact = ["--speed-error", "0", "--picture", str(folder / "advice.png"), "--out", str(folder / "advice.csv")]
    assert run(_advice(folder, *asked, *exact)) == DONE
    [row] = csv.DictReader((folder / "advice.csv").open(encoding="utf-8"))
    at = ["--at", "1.6", "0.1", "0.7", "--learned", str(folder / "postures.json"), "--out", str(folder / "there.csv")]
    assert run(["robot", "lobes", ROBOT, *at, "--cutting", str(folder / "cut.toml"), *asked]) == DONE
    bands = list(csv.DictReader((folder / "there_band.csv").open(encoding="utf-8")))
    [band] = [each for each in bands if each["spindle_speed_rpm"] == row["spindle_speed_rpm"]]
    for name in ("low", "median", "high"):
        assert float(row[f"limit_{name}_m"]) == pytest.approx(float(band[f"depth_{name}_m"]), rel=2e-3)
    rates = [float(each["spindle_speed_rpm"]) * float(each["depth_low_m"]) for each in bands]
    assert float(row["spindle_speed_rpm"]) == float(bands[int(np.argmax(rates))]["spindle_speed_rpm"])
    assert row["depth_m"] == (row["limit_low_m"] if row["measured"] == "yes" else "")
    assert (folder / "advice.png").stat().st_size > 10_000
    again = read_provenance(folder / "advice.csv")
    assert again["options"]["confidence"] == 0.975


@pytest.mark.parametrize(
    ("path", "robot", "said"),
    [
        (PATH.format(end=9), ROBOT, "does not reach x 5.3"),
        (PATH.format(end=1.7).replace("z_m", "height"), ROBOT, "lacks the columns z_m"),
        (PATH.format(end=1.7), "staubli_rx170", "another robot"),
    ],
)
def test_advice_refuses_in_one_line(
    folder: Path, capsys: pytest.CaptureFixture[str], path: str, robot: str, said: str
) -> None:
    (folder / "path.csv").write_text(path)
    words = _advice(folder, "--speeds", "2900", "3100", "2", "--max-depth", "0.02", "--out", str(folder / "none.csv"))
    assert run([robot if word == ROBOT else word for word in words]) == BAD_INPUT
    assert said in " ".join(capsys.readouterr().err.split())
    assert not (folder / "none.csv").exists()


def test_the_next_postures_are_told(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    models = [str(folder / f"hall_{i}.json") for i in range(1, 5)]
    poses = [word for posture in POSTURES for word in ("--pose", posture)]
    asked = ["--next", "2", "--x", "1.3", "1.9", "4", "--y", "-0.5", "0.5", "4", "--z", "0.6"]
    assert run(["robot", "learn", ROBOT, *models, *poses, *asked, "--out", str(folder / "again.json")]) == DONE
    assert "Measure next" in capsys.readouterr().out


def test_mistakes_end_in_one_line(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    models = [str(folder / "hall_1.json"), str(folder / "hall_2.json")]
    for words, said in (
        (["robot", "learn", ROBOT, *models, "--pose", POSTURES[0], "--out", "p.json"], "1 postures for 2"),
        (["robot", "frf", "staubli_rx170", "--learned", str(folder / "postures.json"), "--out", "m.json"], "robot"),
        (["robot", "frf", ROBOT, "--learned", str(folder / "hall_1.json"), "--out", "m.json"], "learned postures"),
    ):
        assert run(words) == BAD_INPUT
        assert said in " ".join(capsys.readouterr().err.split())
