"""Updates of a robot by recordings of a cell that shares no code with the robot model: two of the trial's cases."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomlkit

from acquisition import Channel, RecordingWriter, StreamDescription

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # benchmarks are no installed package

from benchmarks.robot_update_trial.cases import KINDS, draw_case
from benchmarks.robot_update_trial.independent_cell import cell_at, read_tables, recorded
from benchmarks.robot_update_trial.run_trial import NOISE, RATE, ROBOT, SECONDS, run_case
from millfrf.command_line import run
from millfrf.robot_model.files.robot_files import robot_text

SEED = 11
WITHIN = 1.2
"""Error on the posture that was never given, over the noise, up to which an update may say that it explains."""


def _run(kind: str, folder: Path) -> dict[str, Any]:
    number = KINDS.index(kind)
    return run_case(draw_case(number, SEED), number, SEED, folder)


@pytest.mark.long
def test_joints_of_an_independent_cell_are_named_and_predict_another_posture(tmp_path: Path) -> None:
    result = _run("stiffness", tmp_path)
    assert result["verdict"] == "explained"
    assert result["wrong_names"] == []
    assert set(result["named"]) == set(result["expected"])
    assert result["unseen"]["updated"] < WITHIN < 5 < result["unseen"]["filed"]
    for each in result["numbers"]:
        if each["told"] and each["name"].endswith("stiffness"):
            assert each["x"] == pytest.approx(each["expected"], abs=4 * each["error"])


@pytest.mark.long
def test_a_right_file_is_left_as_it_is(tmp_path: Path) -> None:
    result = _run("nothing wrong", tmp_path)
    assert result["verdict"] == "none"
    assert result["named"] == []
    assert result["unseen"]["updated"] < WITHIN


@pytest.mark.slow
def test_a_heavier_body_is_no_number_of_the_update(tmp_path: Path) -> None:
    result = _run("foreign: heavier body", tmp_path)
    assert result["wrong_names"] == []
    assert result["verdict"] != "explained" or result["unseen"]["updated"] < WITHIN


@pytest.mark.slow
def test_recordings_of_an_independent_cell_update_the_file_on_the_command_line(tmp_path: Path) -> None:
    case, generator = draw_case(2, 21), np.random.default_rng(1)
    channels = tuple(Channel(f"f{d}", "force", "N", "TCP", f"+{d}") for d in "XYZ")
    channels += tuple(Channel(f"x{d}", "displacement", "m", "TCP", f"+{d}") for d in "XYZ")
    files, poses = [], []
    for number, q in enumerate(case.postures[:3]):
        samples = recorded(cell_at(read_tables(robot_text(ROBOT)), q, case.truth), SECONDS, RATE, NOISE, generator)
        file = tmp_path / f"posture_{number}.h5"
        with RecordingWriter(file, [StreamDescription("main", RATE, 0.0, channels)], dtype="float64") as writer:
            writer.append("main", np.hstack(samples))
        files.append(str(file))
        poses += ["--pose", ",".join(f"{angle:.6f}" for angle in np.degrees(q))]
    out = tmp_path / "updated.toml"
    assert run(["robot", "update", ROBOT, *files, *poses, "--band", "6", "110", "--out", str(out)]) == 0
    numbers = {each["name"]: each["value"] for each in tomlkit.parse(out.read_text())["update"]["numbers"]}
    for name, wanted in case.expected.items():
        assert numbers[name] == pytest.approx(wanted, abs=0.06)
