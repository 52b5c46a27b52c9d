"""`millfrf chatter` of a microphone, a dynamometer alone, a table of another program, and a tachometer."""

from math import pi
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from scipy.io import wavfile

from acquisition import Channel, RecordingWriter, StreamDescription
from millfrf.command_line import BAD_INPUT, run
from millfrf.cutting import MillingProcess
from replay_data import MillingCell, dynamometer, table_one_model, tip_accelerometers

RATE, RPM = 2048.0, 800.0
PROCESS = MillingProcess(2, 0.0127, pi / 2, 119e6, 0.17, 0.33, pi / 2, pi, 0.15e-3)
DEPTHS = {"stable": 1.2e-3, "hopf": 3.0e-3}
TYPED = ["--teeth", "2", "--speed", "800"]


def samples_of(kind: str) -> np.ndarray:
    """Three forces and three accelerations of a cut."""
    sensors = dynamometer(0.01) + tip_accelerometers(0.01)
    speed = RPM * pi / 30
    cell = MillingCell(table_one_model(), PROCESS, DEPTHS[kind], speed, 25.0, sample_rate=RATE, sensors=sensors, seed=3)
    return cell.samples()


def record(path: Path, channels: tuple[Channel, ...], samples: np.ndarray) -> str:
    with RecordingWriter(path, [StreamDescription("main", RATE, 0.0, channels)]) as writer:
        writer.append("main", samples)
    return str(path)


FORCES = tuple(Channel(f"f{axis}", "force", "N", "TABLE", f"+{axis.upper()}") for axis in "xyz")


@pytest.mark.parametrize("kind", DEPTHS)
def test_forces_alone_are_judged(kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["chatter", record(tmp_path / "cut.h5", FORCES, samples_of(kind)[:, :3]), *TYPED]) == 0
    said = capsys.readouterr()
    assert f"cut.h5: {kind}: " in said.out
    # forces have their strongest line one tooth passing above the mode at 17 Hz, whose speeds would be wrong
    assert "try a spindle speed of" not in said.out
    assert ("43.93 or 17.26 Hz is the frequency of the chatter" in said.err) == (kind == "hopf")


@pytest.mark.parametrize("kind", DEPTHS)
def test_a_sound_is_judged_and_drawn(kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    heard = samples_of(kind)[:, 4]
    wavfile.write(tmp_path / "phone.wav", int(RATE), (heard / np.abs(heard).max() * 3e4).astype(np.int16))
    drawn = tmp_path / "phone.png"
    assert run(["chatter", str(tmp_path / "phone.wav"), *TYPED, "--picture", str(drawn)]) == 0
    assert f"phone.wav: {kind}: " in capsys.readouterr().out
    assert imread(drawn)[..., :3].std() > 0.05
    assert sorted(path.name for path in tmp_path.iterdir()) == ["phone.png", "phone.wav"]


def test_a_table_of_another_program_is_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    samples = samples_of("hopf")[:, 3:5]
    table = np.column_stack([np.arange(len(samples)) / RATE, samples, np.ones(len(samples))])
    head = "Time (s),Accel X (m/s^2),Accel Y (m/s^2),Index"
    np.savetxt(tmp_path / "cut.csv", table, delimiter=",", header=head, comments="")
    assert run(["chatter", str(tmp_path / "cut.csv"), *TYPED]) == 0
    assert "cut.csv: hopf: " in capsys.readouterr().out


def test_a_channel_of_the_speed_is_used(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    samples = samples_of("stable")[:, :3]
    speed = np.full((len(samples), 1), RPM * pi / 30)
    channels = (*FORCES, Channel("spindle", "angular_velocity", "rad/s"))
    assert run(["chatter", record(tmp_path / "cut.h5", channels, np.hstack([samples, speed])), "--teeth", "2"]) == 0
    assert "cut.h5: stable: " in capsys.readouterr().out


def test_a_sensor_at_the_housing_is_not_compared_with_the_chip(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    housing = tuple(Channel(f"a{axis}", "acceleration", "m/s^2", "HOUSING", f"+{axis.upper()}") for axis in "xy")
    path = record(tmp_path / "cut.h5", housing, 1e-3 * samples_of("hopf")[:, 3:5])
    cut = "[cutting]\nteeth = 2\ndiameter_m = 0.0127\nktc_pa = 119e6\nkrc = 0.17\nkac = 0.33\nstart_angle_deg = 90.0\n"
    (tmp_path / "cut.toml").write_text(cut + "exit_angle_deg = 180.0\nfeed_per_tooth_m = 0.00015\n", encoding="utf-8")
    assert run(["chatter", path, "--cutting", str(tmp_path / "cut.toml"), "--speed", "800"]) == 0
    assert "cut.h5: hopf: " in capsys.readouterr().out


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        (["--speed", "800"], "give --cutting CUT.toml or --teeth N"),
        (["--teeth", "2"], "give --speed RPM; if 2 teeth pass at one of its strongest lines, it is"),
        (["--teeth", "2", "--speed", "40000"], "2 teeth pass at 1333 Hz, above half the sample rate of 2048 Hz"),
        (["--teeth", "2", "--speed", "800", "--response", "sound"], "sound"),
    ],
)
def test_what_is_missing_is_asked_for(
    typed: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = record(tmp_path / "cut.h5", FORCES, samples_of("stable")[:, :3])
    assert run(["chatter", path, *typed]) == BAD_INPUT
    assert said in capsys.readouterr().err


def test_the_proposed_speeds_contain_the_right_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = record(tmp_path / "cut.h5", FORCES, samples_of("stable")[:, :3])
    assert run(["chatter", path, "--teeth", "2"]) == BAD_INPUT
    line = capsys.readouterr().err.split("it is ")[1].split(" rpm")[0]
    assert any(abs(float(word) / RPM - 1) < 0.02 for word in line.split(", "))


def test_a_column_in_per_cent_is_no_obstacle(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    samples = samples_of("stable")[:, 3:4]
    table = np.column_stack([np.arange(len(samples)) / RATE, samples, 40 + samples])
    np.savetxt(tmp_path / "cut.csv", table, delimiter=",", header="Time (s),Accel X (m/s^2),Load S (%)", comments="")
    assert run(["chatter", str(tmp_path / "cut.csv"), *TYPED]) == 0
    assert "cut.csv: stable: " in capsys.readouterr().out


def test_a_cut_is_judged_at_the_speed_of_its_lines(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = record(tmp_path / "cut.h5", FORCES, samples_of("stable")[:, :3])
    assert run(["chatter", path, "--teeth", "2", "--speed", "840"]) == 0
    said = capsys.readouterr()
    assert "cut.h5: stable: " in said.out
    assert "the spindle turned at 800.0 rpm, stated are 840.0 rpm" in said.err
