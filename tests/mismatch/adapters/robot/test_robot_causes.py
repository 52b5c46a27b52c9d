"""A robot with something concealed, in one or more postures: named with its size, declared a class, or left alone."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from milled_robots import NAME, POSTURES, RATE, ROBOT, heavy_elbow, in_postures, milled

from acquisition import Channel, RecordingWriter, StreamDescription
from estimation import BandRecording
from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.mismatch import RobotDiagnosis, diagnose_robot, number_of, standard_error_of
from millfrf.mismatch.robot.receptance import posed
from millfrf.robot_model import SpatialRobot, modes_at, with_joint_factor, with_payload
from millfrf.robot_model.finite_elements.statics import with_gravity
from millfrf.robot_model.model_updating.changes import with_damping_factor
from modal_fit import read_modal_model


def assert_named(found: RobotDiagnosis, name: str, number: float) -> None:
    assert found.verdict == "explained"
    assert [cause.name for cause in found.physics] == [name]
    assert found.equivalents == ()
    assert number_of(found.physics[0]) == pytest.approx(number, abs=3.5 * standard_error_of(found.physics[0]))
    for each in found.held_out:
        # noise is all that is left, but for a twentieth of what was wrong: the number comes from the other postures
        assert each.after < np.hypot(each.floor, 0.05 * each.before)


@pytest.mark.long
def test_a_softer_joint_is_named_with_its_stiffness_from_one_posture() -> None:
    diagnosis = diagnose_robot(ROBOT, in_postures(with_joint_factor(ROBOT, "3", 0.7), 1))
    assert_named(diagnosis, "joint 3 stiffness", 0.7)
    improved, offset = diagnosis.details.improved_robot()
    q = np.radians(POSTURES[0])
    truth = modes_at(with_joint_factor(ROBOT, "3", 0.7), q).frequencies[:4]
    assert modes_at(improved, q + offset).frequencies[:4] == pytest.approx(truth, rel=0.01)


def write(path: Path, trial: BandRecording) -> Path:
    """A trial as a recording's file."""
    channels = [
        Channel(name, *(("force", "N") if name[0] == "f" else ("acceleration", "m/s^2")), "TCP", "+" + name[1].upper())
        for name in trial.channels
    ]
    with RecordingWriter(path, [StreamDescription("main", RATE, 0.0, tuple(channels))], dtype="float64") as writer:
        writer.append("main", np.hstack([trial.force, trial.response]))
    return path


@pytest.mark.long
def test_one_direction_in_one_posture_leaves_a_class(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One mode sideways: a softer joint 1 looks like softer links; the command says so and writes what it found."""
    truth = with_joint_factor(ROBOT, "1", 0.7)
    trial = milled(truth, POSTURES[0], 0, labels=("TCP:+Y",), seconds=16.0, noise=0.1)
    recording = write(tmp_path / "sideways.h5", trial)
    with h5py.File(recording, "r+") as file:
        file.attrs["complete"] = False
        file.attrs["format_version"] = 2  # as another program writes it: without a copy of the texts
    out = tmp_path / "found"
    pose = ",".join(str(angle) for angle in POSTURES[0])
    options = ["--pose", pose, "--band", "5", "22", "--out", str(out)]
    assert run(["robot", "diagnose", NAME, str(recording), *options]) == DONE
    said = capsys.readouterr()
    assert "cannot be distinguished from" in said.out
    doubt = "sideways.h5: the recording was not closed in order: its end may be missing"
    assert f"warning: {doubt}" in said.err
    content = json.loads((out / "robot_diagnosis.json").read_text())
    assert content["format"] == "millfrf.diagnosis"
    assert content["verdict"] == "class"
    named = {content["physics"][0]["name"], *content["equivalents"]}
    assert named >= {"joint 1 stiffness", "links"}
    assert content["warnings"] == [doubt]
    page = (out / "report.html").read_text()
    assert "cannot be distinguished from" in page
    assert doubt in page
    model = read_modal_model(out / "model_sideways.json")
    lowest = modes_at(truth, np.radians(POSTURES[0])).frequencies[0]
    assert model.natural_frequencies[0] == pytest.approx(lowest, rel=0.02)


def test_what_the_command_refuses(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recording = str(write(tmp_path / "a.h5", milled(ROBOT, POSTURES[0], 0, seconds=4.0)))
    out = ["--out", str(tmp_path / "out")]
    for arguments, message in (
        ([NAME, recording, *out], "0 postures for 1 recordings"),
        ([NAME, recording, "--pose", "ready", "--model-error", "0", "1", "1", *out], "give 3 positive shares"),
        (["chen_2026", recording, "--pose", "P1", *out], "planar"),
        ([NAME, recording, "--pose", "ready", "--band", "1", "2", *out], "below 2 Hz"),
        ([NAME, recording, recording, "--pose", "ready", "--pose", "ready", *out], "different names"),
    ):
        assert run(["robot", "diagnose", *arguments]) == BAD_INPUT
        assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_right_robot_is_left_alone(count: int) -> None:
    diagnosis = diagnose_robot(ROBOT, in_postures(ROBOT, count))
    assert diagnosis.verdict == "none"
    assert diagnosis.physics == ()
    assert diagnosis.before.share < 1
    weighty = diagnose_robot(ROBOT, in_postures(with_gravity(ROBOT), count))
    assert weighty.verdict == "none"  # weight is less than a right model may be off


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize(
    ("name", "number", "truth"),
    [
        ("joint 3 stiffness", 0.7, with_joint_factor(ROBOT, "3", 0.7)),
        ("joint 5 stiffness", 1.8, with_joint_factor(ROBOT, "5", 1.8)),
        ("payload", 12.0, with_payload(ROBOT, 12.0)),
        ("damping", 1.6, with_damping_factor(ROBOT, 1.6)),
    ],
    ids=["joint 3", "joint 5", "payload", "damping"],
)
def test_one_change_is_named_from_several_postures(name: str, number: float, truth: SpatialRobot, count: int) -> None:
    assert_named(diagnose_robot(ROBOT, in_postures(truth, count)), name, number)


@pytest.mark.slow
def test_a_joint_that_stands_elsewhere_is_named() -> None:
    offset = np.array([0.0, 0.0, 4.0, 0.0, 0.0, 0.0])
    diagnosis = diagnose_robot(ROBOT, in_postures(ROBOT, 3, offset))
    assert diagnosis.verdict == "explained"
    assert diagnosis.physics[0].name == "posture of joint 3"
    assert number_of(diagnosis.physics[0]) == pytest.approx(
        np.radians(4.0), abs=3.5 * standard_error_of(diagnosis.physics[0])
    )


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 3])
def test_link_flexibility_that_was_left_out_is_named(count: int) -> None:
    diagnosis = diagnose_robot(ROBOT, in_postures(ROBOT, count), rigid_links=True)
    assert_named(diagnosis, "link flexibility left out", 1.0)


@pytest.mark.slow
def test_three_postures_settle_what_one_leaves_a_class() -> None:
    truth = with_joint_factor(ROBOT, "1", 0.7)
    recordings = [
        posed(
            milled(truth, posture, i, labels=("TCP:+Y",), seconds=16.0, noise=0.1),
            np.radians(posture),
            (5.0, 22.0),
            responses=("TCP:+Y",),
            excitations=("TCP:+Y",),
        )
        for i, posture in enumerate(POSTURES)
    ]
    diagnosis = diagnose_robot(ROBOT, recordings)
    assert diagnosis.verdict == "explained"
    assert diagnosis.physics[0].name == "joint 1 stiffness"


@pytest.mark.slow
def test_two_changes_are_both_named() -> None:
    truth = with_payload(with_joint_factor(ROBOT, "1", 0.6), 10.0)
    diagnosis = diagnose_robot(ROBOT, in_postures(truth, 2))
    assert diagnosis.verdict == "explained"
    numbers = {cause.name: cause for cause in diagnosis.physics}
    assert set(numbers) == {"payload", "joint 1 stiffness"}
    for name, number in (("payload", 10.0), ("joint 1 stiffness", 0.6)):
        assert number_of(numbers[name]) == pytest.approx(number, abs=3.5 * standard_error_of(numbers[name]))


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 3])
def test_what_no_change_stands_for_is_left_unexplained(count: int) -> None:
    diagnosis = diagnose_robot(ROBOT, in_postures(heavy_elbow(), count))
    assert diagnosis.verdict == "unexplained"
