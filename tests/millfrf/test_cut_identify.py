"""`millfrf cut identify` from recordings to a cutting file that lobes read, and what it refuses."""

import importlib.util
import json
import math
from pathlib import Path

import numpy as np
import pytest
import scipy

from acquisition import Channel, RecordingWriter, StreamDescription
from millfrf import cut_identify
from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.cutting import read_cutting_process
from modal_fit import write_modal_model
from replay_data import table_one_model

_SPEC = importlib.util.spec_from_file_location(
    "loop_forces_of_cuts", Path(__file__).parents[1] / "mismatch" / "adapters" / "cut" / "loop_forces.py"
)
assert _SPEC is not None
assert _SPEC.loader is not None
loops = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(loops)

CUTTER = """[cutting]
teeth = 2
diameter_m = 0.016
immersion = "slot"
helix_angle_deg = 28.64788976
"""
FEEDS = (25e-6, 75e-6, 125e-6)
CHANNELS = tuple(Channel(f"F{a.lower()}", "force", "N", "TCP", f"+{a}") for a in "XYZ")
W0 = 2 * math.pi * 800.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cutter without coefficients, and the forces of three feeds, each with its feed in the set-up."""
    where = tmp_path_factory.mktemp("identify")
    (where / "cutter.toml").write_text(CUTTER, encoding="utf-8")
    for number, feed in enumerate(FEEDS):
        force = loops.loop_forces(feed, first_angle=float(number), seed=number)
        stream = StreamDescription("main", loops.RATE, 0.0, CHANNELS)
        setup = f"[cut]\nfeed_per_tooth_m = {feed}\nspindle_speed_rpm = 6000.0\n"
        with RecordingWriter(where / f"f{number}.h5", (stream,), setup=setup) as writer:
            writer.append("main", force.astype(np.float32))
    return where


def words(folder: Path, *options: str) -> list[str]:
    files = [str(folder / name) for name in ("cutter.toml", "f0.h5", "f1.h5", "f2.h5")]
    return ["cut", "identify", *files, "--depth", "0.003", *options]


def test_from_forces_to_a_cutting_file(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, picture = folder / "cut.toml", folder / "cut.png"
    assert run([*words(folder), "--out", str(out), "--picture", str(picture)]) == DONE
    text = capsys.readouterr().out
    assert "Ktc (MPa)" in text
    assert "runout 6." in text
    process = read_cutting_process(out)
    assert process.ktc == pytest.approx(900e6, rel=0.01)
    assert process.krc == pytest.approx(1 / 3, rel=0.02)
    assert process.kte == pytest.approx(16e3, rel=0.03)
    assert 0 < process.ktc_std < 0.01 * process.ktc
    assert '"step": "cut identify"' in out.read_text(encoding="utf-8")
    assert picture.stat().st_size > 10_000


def test_exponents_from_forces_to_lobes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With the radius of the edges the power law is found, and lobes, simulation and a second reading take it."""
    (tmp_path / "cutter.toml").write_text(f"{CUTTER}edge_radius_m = 8e-6\n", encoding="utf-8")
    powers, true = (0.25, 0.4, 0.3), np.array([350e6, 150e6, 60e6, 0.0, 0.0, 0.0])
    files = [str(tmp_path / "cutter.toml")]
    for number, feed in enumerate(FEEDS):
        force = loops.loop_forces(
            feed, first_angle=float(number), seed=number, coefficients=true, powers=powers, round_edge=8e-6
        )
        setup = f"[cut]\nfeed_per_tooth_m = {feed}\nspindle_speed_rpm = 6000.0\n"
        stream = StreamDescription("main", loops.RATE, 0.0, CHANNELS)
        files.append(str(tmp_path / f"f{number}.h5"))
        with RecordingWriter(files[-1], (stream,), setup=setup) as writer:
            writer.append("main", force.astype(np.float32))
    out = tmp_path / "cut.toml"
    assert run(["cut", "identify", *files, "--depth", "0.003", "--out", str(out)]) == DONE
    text = capsys.readouterr().out
    assert "the forces need coefficients that fall with the chip thickness (F-tests" in text
    assert "exponent of Ktc" in text
    assert "Kienzle's kc1.1" in text
    process = read_cutting_process(out)
    assert process.chip_law.exponents == pytest.approx(powers, abs=0.01)
    assert process.chip_law.edge_radius == 8e-6
    at_reference = 350e6 * (process.chip_law.reference / 1e-3) ** -0.25
    assert process.ktc == pytest.approx(at_reference, rel=0.005)
    assert len(process.covariance) == 9
    write_modal_model(tmp_path / "tip.json", table_one_model())
    given = [str(tmp_path / "tip.json"), "--cutting", str(out)]
    speeds = ["--speeds", "900", "1100", "2", "--max-depth", "0.01"]
    assert run(["lobes", *given, *speeds, "--out", str(tmp_path / "lobes.csv")]) == DONE
    assert "with exponents 0.249" in capsys.readouterr().out
    assert run(["inspect", str(out)]) == DONE
    assert "with exponents 0.249" in capsys.readouterr().out


def test_python_and_json_give_the_same(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paths = [folder / f"f{number}.h5" for number in range(3)]
    result = cut_identify(folder / "cutter.toml", *paths, depth=0.003, feeds=FEEDS, speed=6000)
    capsys.readouterr()
    assert run([*words(folder), "--json", "--out", str(folder / "again.toml")]) == DONE
    answer = json.loads(capsys.readouterr().out)
    assert answer["coefficients"]["ktc_pa"] == pytest.approx(result.coefficients[0])
    assert answer["method"] == result.method == "waveforms"
    assert math.isclose(answer["runout_m"], result.process.runout)


def test_taps_on_the_dynamometer_to_coefficients(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Taps are recorded and estimated by `millfrf tap`; cuts and taps pass the same ringing filter."""
    ring = scipy.signal.bilinear([W0**2], [1.0, 0.06 * W0, W0**2], loops.RATE)
    rng = np.random.default_rng(3)
    for axis in range(3):
        applied = np.zeros((int(4.5 * loops.RATE), 3))
        for start in range(5000, len(applied) - 8000, 8000):
            applied[start : start + 10, axis] = 300 * np.sin(np.pi * (np.arange(10) + 0.5) / 10)
        hammer = Channel("hammer", "force", "N", "TCP", "+" + "XYZ"[axis])
        shown = scipy.signal.lfilter(*ring, applied, axis=0) + 0.3 * rng.standard_normal(applied.shape)
        stream = StreamDescription("main", loops.RATE, 0.0, (hammer, *CHANNELS))
        with RecordingWriter(folder / f"tap{axis}.h5", (stream,)) as writer:
            writer.append("main", np.column_stack([applied[:, axis], shown]).astype(np.float32))
    for number, feed in enumerate(FEEDS):
        force = loops.loop_forces(feed, first_angle=float(number), seed=number)
        shown = scipy.signal.lfilter(*ring, force, axis=0)[1000:]
        with RecordingWriter(
            folder / f"d{number}.h5", (StreamDescription("main", loops.RATE, 0.0, CHANNELS),)
        ) as writer:
            writer.append("main", shown.astype(np.float32))
    taps = [str(folder / f"tap{axis}.h5") for axis in range(3)]
    named = ["--excitation", "hammer", "--response", "Fx", "--response", "Fy", "--response", "Fz"]
    assert run(["tap", *taps, *named, "--out", str(folder / "dynamometer.h5")]) == DONE
    files = [str(folder / name) for name in ("cutter.toml", "d0.h5", "d1.h5", "d2.h5")]
    given = ["--depth", "0.003", "--speed", "6000", "--feeds", "25e-6,75e-6,125e-6", "--json"]
    given += ["--dynamometer", str(folder / "dynamometer.h5"), "--out", str(folder / "tapped.toml")]
    capsys.readouterr()
    assert run(["cut", "identify", *files, *given]) == DONE
    answer = json.loads(capsys.readouterr().out)
    assert answer["method"] == "waveforms"
    assert answer["misfit"] < 0.03
    assert answer["coefficients"]["ktc_pa"] == pytest.approx(900e6, rel=0.02)
    assert "dynamometer.h5" in (folder / "tapped.toml").read_text(encoding="utf-8")
    assert run(["cut", "identify", *files, *given, "--force", "--highest", "4000"]) == BAD_INPUT
    assert "the FRF of the dynamometer ends at" in capsys.readouterr().err


def test_sweeps_in_three_immersions_at_one_feed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As for an FRF: engagement, depth and sweep are those of each set-up; the zero of the sensors drifts by 40 N."""
    (tmp_path / "cutter.toml").write_text(CUTTER, encoding="utf-8")
    sweeps = (("slot", (0.0, math.pi), 2e-3), ("down", (math.pi / 2, math.pi), 3e-3), ("up", (0.0, math.pi / 2), 3e-3))
    for number, (immersion, angles, depth) in enumerate(sweeps):
        force = loops.loop_forces(
            1e-4, immersion=angles, depth=depth, rpm=5000.0, last_rpm=6500.0, seconds=4.0, first_angle=1.0 * number
        )
        force += np.linspace(-20.0, 20.0, len(force))[:, None] * [1.0, -0.5, 0.3]
        cut = f'immersion = "{immersion}"\nradial_depth_m = 0.008\ndepth_m = {depth}\nfeed_per_tooth_m = 1e-4\n'
        speed = 'speed_profile = "linear sweep"\nfirst_spindle_speed_rpm = 5000\nlast_spindle_speed_rpm = 6500\n'
        setup = f"[cut]\n{cut}{speed}sweep_duration_s = 4.0\n"
        stream = StreamDescription("main", loops.RATE, 0.0, CHANNELS)
        with RecordingWriter(tmp_path / f"s{number}.h5", (stream,), setup=setup) as writer:
            writer.append("main", force.astype(np.float32))
    files = [str(tmp_path / name) for name in ("cutter.toml", "s0.h5", "s1.h5", "s2.h5")]
    assert run(["cut", "identify", *files, "--out", str(tmp_path / "cut.toml"), "--json"]) == DONE
    answer = json.loads(capsys.readouterr().out)
    result, errors = (np.array(list(answer[key].values())) for key in ("coefficients", "standard_errors"))
    assert result[:3] == pytest.approx(loops.COEFFICIENTS[:3], rel=0.03)
    assert (np.abs(result - loops.COEFFICIENTS) < 4 * errors).all()
    assert [cut["depth_m"] for cut in answer["cuts"]] == [2e-3, 3e-3, 3e-3]
    assert answer["cuts"][1]["start_angle_deg"] == pytest.approx(90.0)


@pytest.mark.parametrize("shape", ['shape = "ball"', "helix_angles_deg = [28.0, 33.0]"])
def test_a_cutter_of_another_shape_is_refused(folder: Path, shape: str, capsys: pytest.CaptureFixture[str]) -> None:
    """It was computed as a cylinder with one helix, and its coefficients were written without a word."""
    (folder / "shaped.toml").write_text(f"{CUTTER}\n[cutter]\n{shape}\n", encoding="utf-8")
    files = [str(folder / name) for name in ("shaped.toml", "f0.h5", "f1.h5", "f2.h5")]
    assert run(["cut", "identify", *files, "--depth", "0.003", "--out", str(folder / "none.toml")]) == BAD_INPUT
    assert "cut with a square end mill whose teeth have one helix angle" in capsys.readouterr().err
    assert not (folder / "none.toml").exists()


def test_a_depth_that_nothing_states_is_asked_for(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = [str(folder / name) for name in ("cutter.toml", "f0.h5", "f1.h5", "f2.h5")]
    assert run(["cut", "identify", *files, "--out", str(folder / "none.toml")]) == BAD_INPUT
    assert "no depth is stated; give --depth" in capsys.readouterr().err


def test_a_cut_that_chatters_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    force = loops.loop_forces(125e-6, seed=2)
    time = np.arange(len(force)) / loops.RATE
    # a line off the spindle's orders, with its side line at the tooth passing
    for frequency, size in ((733.0, 100.0), (733.0 - 2 * 100.3, 60.0)):
        force += size * np.cos(2 * np.pi * frequency * time)[:, None]
    setup = "[cut]\nfeed_per_tooth_m = 125e-6\nspindle_speed_rpm = 6000.0\n"
    with RecordingWriter(
        folder / "c.h5", (StreamDescription("main", loops.RATE, 0.0, CHANNELS),), setup=setup
    ) as writer:
        writer.append("main", force.astype(np.float32))
    files = [str(folder / name) for name in ("cutter.toml", "f0.h5", "f1.h5", "c.h5")]
    assert run(["cut", "identify", *files, "--depth", "0.003", "--out", str(folder / "none.toml")]) == BAD_INPUT
    assert "c: the cut chatters (hopf)" in capsys.readouterr().err
    assert not (folder / "none.toml").exists()


@pytest.mark.parametrize(("share", "zero"), [(0.0, 0.0), (0.2, 0.0), (0.0, 20.0)])
def test_mean_forces_and_waveforms_that_contradict_each_other(tmp_path: Path, share: float, zero: float) -> None:
    """A tool that yields, or an amplifier, changes the waveforms alone; a zero that is off the means alone."""
    (tmp_path / "cutter.toml").write_text(CUTTER, encoding="utf-8")
    paths = []
    for number, feed in enumerate((25e-6, 50e-6, 75e-6, 100e-6, 125e-6)):
        force = loops.loop_forces(feed, first_angle=float(number), seed=number)
        force = force.mean(axis=0) + (1 + share) * (force - force.mean(axis=0))
        force[:, 0] += zero
        setup = f"[cut]\nfeed_per_tooth_m = {feed}\nspindle_speed_rpm = 6000.0\n"
        paths.append(tmp_path / f"f{number}.h5")
        with RecordingWriter(paths[-1], (StreamDescription("main", loops.RATE, 0.0, CHANNELS),), setup=setup) as writer:
            writer.append("main", force.astype(np.float32))
    result = cut_identify(tmp_path / "cutter.toml", *paths, depth=0.003)
    assert (np.abs(result.coefficients - loops.COEFFICIENTS) < 2.5 * result.errors).all()
    wrong = share > 0 or zero > 0
    assert result.method == ("mean forces" if wrong else "waveforms")
    assert any("mean forces and waveforms contradict each other" in text for text in result.warnings) is wrong


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--feeds", "25e-6,75e-6"], "2 feeds for 3 recordings"),
        (["--feeds", "25um,75um,1"], "are no numbers"),
        (["--feeds", "0.025,0.075,0.125"], "is outside of 0 to 0.005 m: is it in mm?"),
        (["--speed", "6000rpm"], "--speed 6000rpm: give a number without unit, in rpm"),
        (["--axes", "-X,-Y,-Z"], "--axes="),
        (["--feeds", "25e-6,0,1e-4"], "feed per tooth 0.0 m must be positive"),
        (["--axes", "X,X,Z"], "name each measured direction (X, Y, Z) once"),
        (["--highest", "50"], "above the highest compared frequency"),
    ],
)
def test_options_that_cannot_be(
    folder: Path, options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*words(folder, *options), "--out", str(folder / "none.toml")]) == BAD_INPUT
    assert message in capsys.readouterr().err
    assert not (folder / "none.toml").exists()
