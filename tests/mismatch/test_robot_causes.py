"""A robot with something concealed, in one or more postures: named with its size, declared a class, or left alone."""

import json
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from acquisition import RecordingWriter, StreamDescription
from estimation import BandRecording, channels_of
from foundation import TIP, InputError
from millfrf.__main__ import BAD_INPUT, DONE, run
from mismatch.adapters.robot import PosedRecording, RobotDiagnosis, diagnose_robot, posed
from mismatch.adapters.robot.robot_receptance import RobotModes, predicted_lines, robot_modes
from mismatch.models.model_shape import LabError
from modal_fit import read_modal_model
from robot_model import (
    SpatialRobot,
    cell_structure_at,
    frf_at,
    modes_at,
    read_spatial_robot,
    with_damping_factor,
    with_gravity,
    with_joint_factor,
    with_payload,
)

NAME = "kuka_kr90_r3100"
ROBOT = read_spatial_robot(NAME).robot
POSTURES = np.array([[0, -10, 100, 0, 90, 0], [20, 25, 70, 40, 60, 0], [-15, 45, 30, 80, -50, 0]])
BAND = (5.0, 45.0)
RATE = 160.0
NOTHING = np.zeros(6)


def milled(
    truth: SpatialRobot,
    posture: np.ndarray,
    seed: int,
    *,
    labels: tuple[str, ...] = TIP,
    seconds: float = 12.0,
    noise: float = 0.02,
) -> BandRecording:
    """Broad forces at the tip and the accelerations they cause, exactly by all modes; noise on both; posture in deg."""
    rng = np.random.default_rng(seed)
    columns = [TIP.index(label) for label in labels]
    n = int(seconds * RATE)
    lines = np.fft.rfftfreq(n, 1 / RATE)
    pushed = np.zeros((len(lines), 3), dtype=complex)
    pushed[:, columns] = np.fft.rfft(200 * rng.normal(size=(n, len(columns))), axis=0)
    pushed[lines > 0.45 * RATE] = 0
    moved = np.einsum("kpq,kq->kp", frf_at(truth, np.radians(posture), lines).values, pushed)
    force = np.fft.irfft(pushed, n=n, axis=0)[:, columns]
    response = np.fft.irfft(moved * (2j * np.pi * lines[:, None]) ** 2, n=n, axis=0)[:, columns]
    noisy = [part + noise * part.std(axis=0) * rng.normal(size=part.shape) for part in (force, response)]
    channels = [
        channels_of(quantity, labels, [quantity[0] + label[-1].lower() for label in labels])
        for quantity in ("force", "acceleration")
    ]
    return BandRecording(f"posture {seed + 1}", RATE, noisy[0], noisy[1], *channels)


def in_postures(
    truth: SpatialRobot, count: int, offset: np.ndarray = NOTHING, seconds: float = 12.0
) -> list[PosedRecording]:
    """Recordings of a robot whose joints stand ``offset`` (deg) beside where they are said to stand."""
    trials = [milled(truth, posture + offset, i, seconds=seconds) for i, posture in enumerate(POSTURES[:count])]
    return [posed(trial, np.radians(q), BAND) for trial, q in zip(trials, POSTURES[:count], strict=True)]


def heavy_elbow() -> SpatialRobot:
    """Something that no candidate stands for: the elbow's body weighs more than twice as much."""
    bodies = list(ROBOT.bodies)
    bodies[1] = replace(bodies[1], mass=2.2 * bodies[1].mass)
    return replace(ROBOT, bodies=tuple(bodies))


def assert_named(found: RobotDiagnosis, name: str, number: float) -> None:
    assert found.verdict == "explained"
    assert [cause.name for cause in found.causes] == [name]
    assert found.equivalents == ()
    assert found.causes[0].number == pytest.approx(number, abs=3.5 * found.causes[0].standard_error)
    for one in found.held_out:
        # noise is all that is left, but for a twentieth of what was wrong: the number comes from the other postures
        assert one.after < np.hypot(one.free, 0.05 * one.before)


def test_a_softer_joint_is_named_with_its_stiffness_from_one_posture() -> None:
    found = diagnose_robot(ROBOT, in_postures(with_joint_factor(ROBOT, "3", 0.7), 1))
    assert_named(found, "joint 3 stiffness", 0.7)
    improved, offset = found.improved_robot()
    q = np.radians(POSTURES[0])
    truth = modes_at(with_joint_factor(ROBOT, "3", 0.7), q).frequencies[:4]
    assert modes_at(improved, q + offset).frequencies[:4] == pytest.approx(truth, rel=0.01)


def write(path: Path, trial: BandRecording) -> Path:
    """A trial as a recording's file."""
    channels = (*trial.excitations, *trial.responses)
    with RecordingWriter(path, [StreamDescription("main", RATE, 0.0, channels)], dtype="float64") as writer:
        writer.append("main", np.hstack([trial.force, trial.response]))
    return path


def test_one_direction_in_one_posture_leaves_a_class(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One mode sideways: a softer joint 1 looks like softer links; the command says so and writes what it found."""
    truth = with_joint_factor(ROBOT, "1", 0.7)
    trial = milled(truth, POSTURES[0], 0, labels=("TCP:+Y",), seconds=16.0, noise=0.1)
    recording = write(tmp_path / "sideways.h5", trial)
    with h5py.File(recording, "r+") as file:
        file.attrs["complete"] = False
    out = tmp_path / "found"
    pose = ",".join(str(angle) for angle in POSTURES[0])
    options = ["--pose", pose, "--band", "5", "22", "--out", str(out)]
    assert run(["robot", "diagnose", NAME, str(recording), *options]) == DONE
    said = capsys.readouterr()
    assert "cannot be told from" in said.out
    doubt = "sideways.h5: the recording was not closed in order: its end may be missing"
    assert f"warning: {doubt}" in said.err
    content = json.loads((out / "robot_diagnosis.json").read_text())
    assert content["format"] == "millfrf.robot_diagnosis"
    assert content["verdict"] == "class"
    named = {content["causes"][0]["name"], *content["equivalents"]}
    assert named >= {"joint 1 stiffness", "links"}
    assert content["warnings"] == [doubt]
    page = (out / "report.html").read_text()
    assert "Verdict" in page
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


def test_recordings_that_do_not_fit_are_refused() -> None:
    trial = milled(ROBOT, POSTURES[0], 0, seconds=4.0)
    with pytest.raises(InputError, match="50 are the least"):
        posed(trial, NOTHING, (17.0, 18.0))
    with pytest.raises(InputError, match="TABLE"):
        posed(trial, NOTHING, BAND, responses=("TABLE:+X", *TIP[1:]))
    with pytest.raises(InputError, match="no recording"):
        diagnose_robot(ROBOT, [])
    housing = posed(trial, np.radians(POSTURES[0]), BAND, responses=("HOUSING:+X", "HOUSING:+Y", "HOUSING:+Z"))
    with pytest.raises(InputError, match="--sensor"):
        diagnose_robot(ROBOT, [housing])


def some_modes(robot: SpatialRobot = ROBOT) -> tuple[RobotModes, PosedRecording]:
    recording = in_postures(ROBOT, 1, seconds=6.0)[0]
    return robot_modes(robot, recording, NOTHING, np.zeros(3), 6), recording


def test_receptance_at_tip_and_housing_is_that_of_the_robot() -> None:
    modes, recording = some_modes()
    lines = np.array([3.0, 17.0, 40.0])
    assert modes.receptance(lines) == pytest.approx(frf_at(ROBOT, recording.q, lines).values, rel=1e-9, abs=1e-15)
    sensor = np.array([0.06, -0.04, 0.25])
    housing = replace(recording, responses=("HOUSING:+X", "HOUSING:+Y", "HOUSING:+Z"))
    found = robot_modes(ROBOT, housing, NOTHING, sensor, 6).receptance(lines)
    structure = cell_structure_at(ROBOT, recording.q, sensor, highest_frequency=1e5)
    assert found == pytest.approx(structure.receptance(lines)[:, 3:], rel=1e-6, abs=1e-13)


def test_slopes_are_the_derivative() -> None:
    modes, recording = some_modes()
    error, rng = LabError(0.01, 0.15, 0.05), np.random.default_rng(3)
    lines = recording.lines
    u = 0.3 * rng.normal(size=modes.size)
    here = modes.moved(u, error)
    slopes = here.slopes(modes, lines.frequencies, lines.force_here, error)

    def displacement(x: np.ndarray) -> np.ndarray:
        return np.einsum("kpq,kq->kp", modes.moved(x, error).receptance(lines.frequencies), lines.force_here)

    for column in rng.choice(modes.size, 12, replace=False):
        aside = 1e-5 * np.eye(modes.size)[column]
        numeric = (displacement(u + aside) - displacement(u - aside)) / 2e-5
        assert np.abs(slopes[:, :, column] - numeric).max() <= 1e-6 * max(np.abs(numeric).max(), 1e-12)


def test_deviations_lead_from_one_robot_to_another_whatever_the_order_and_the_signs() -> None:
    error = LabError(0.01, 0.15, 0.05)
    modes, _ = some_modes()
    softer, _ = some_modes(with_joint_factor(ROBOT, "1", 0.55))  # its two lowest modes have crossed
    shown = modes.moved(modes.deviations(softer, error), error)
    assert np.sort(shown.natural[:6]) == pytest.approx(np.sort(softer.natural[:6]), rel=1e-9)
    lines = np.linspace(5, 40, 30)
    other = softer.aligned(modes)
    signs = np.sign(np.sum(other.shapes[:6] * shown.shapes[:6], axis=1))
    assert other.shapes[:6] == pytest.approx(signs[:, None] * shown.shapes[:6], abs=1e-12)
    assert other.receptance(lines) == pytest.approx(softer.receptance(lines), rel=1e-9, abs=1e-15)


def test_prediction_meets_a_recording_without_noise() -> None:
    trial = milled(ROBOT, POSTURES[0], 0, noise=0.0)
    recording = posed(trial, np.radians(POSTURES[0]), BAND)
    predicted = predicted_lines(robot_modes(ROBOT, recording, NOTHING, np.zeros(3), 6), recording.lines)
    rest = np.linalg.norm(recording.lines.measured - predicted)
    assert rest < 0.02 * np.linalg.norm(recording.lines.measured)


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_right_robot_is_left_alone(count: int) -> None:
    found = diagnose_robot(ROBOT, in_postures(ROBOT, count))
    assert found.verdict == "none"
    assert found.causes == ()
    assert found.excess_before < 1
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
    found = diagnose_robot(ROBOT, in_postures(ROBOT, 3, offset))
    assert found.verdict == "explained"
    assert found.causes[0].name == "posture of joint 3"
    assert found.causes[0].number == pytest.approx(np.radians(4.0), abs=3.5 * found.causes[0].standard_error)


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 3])
def test_link_flexibility_that_was_left_out_is_named(count: int) -> None:
    found = diagnose_robot(ROBOT, in_postures(ROBOT, count), rigid_links=True)
    assert_named(found, "link flexibility left out", 1.0)


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
    found = diagnose_robot(ROBOT, recordings)
    assert found.verdict == "explained"
    assert found.causes[0].name == "joint 1 stiffness"


@pytest.mark.slow
def test_two_changes_are_both_named() -> None:
    truth = with_payload(with_joint_factor(ROBOT, "1", 0.6), 10.0)
    found = diagnose_robot(ROBOT, in_postures(truth, 2))
    assert found.verdict == "explained"
    numbers = {cause.name: cause for cause in found.causes}
    assert set(numbers) == {"payload", "joint 1 stiffness"}
    for name, number in (("payload", 10.0), ("joint 1 stiffness", 0.6)):
        assert numbers[name].number == pytest.approx(number, abs=3.5 * numbers[name].standard_error)


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 3])
def test_what_no_change_stands_for_is_left_unexplained(count: int) -> None:
    found = diagnose_robot(ROBOT, in_postures(heavy_elbow(), count))
    assert found.verdict == "unexplained"
