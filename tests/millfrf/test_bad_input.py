"""Bad input: one clear line on standard error, exit code 2, and no file left behind."""

import importlib.metadata
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from acquisition import Channel, RecordingWriter, StreamDescription
from estimation import write_frf
from millfrf.command_line import BAD_INPUT, DONE, FAILED, run
from millfrf.core import write_json
from modal_fit import write_modal_model
from replay_data import table_one_model

RATE = 256.0
CUT = """[cutting]
teeth = 2
diameter_m = 0.0127
edge_angle_deg = 90.0
ktc_pa = 119e6
krc = 0.17
kac = 0.33
start_angle_deg = 90.0
exit_angle_deg = 180.0
feed_per_tooth_m = 0.00015
"""
MAPPING = """sample_rate = 256.0
[[channels]]
name = "fx"
array = "force"
quantity = "force"
unit = "{unit}"
node = "TCP"
direction = "+X"
[[channels]]
name = "ax"
array = "motion"
quantity = "acceleration"
unit = "m/s^2"
node = "TCP"
direction = "+X"
"""

CHANNELS = tuple(Channel(f"f{a}", "force", "N", "TCP", f"+{a.upper()}") for a in "xyz") + (
    Channel("ax", "acceleration", "m/s^2", "TCP", "+X"),
)


def recording(path: Path, seed: int, rate: float = RATE, dependent: bool = False) -> Path:
    """Three forces and one acceleration, 8 s; ``dependent`` forces are one signal in fixed shares."""
    rng = np.random.default_rng(seed)
    force = rng.standard_normal((int(8 * rate), 3))
    if dependent:
        force = force[:, :1] * np.array([1.0, 0.6, 0.3])
    samples = np.column_stack([force, force @ np.array([0.5, 0.2, 0.1])])
    path.unlink(missing_ok=True)
    with RecordingWriter(path, (StreamDescription("main", rate, 0.0, CHANNELS),)) as writer:
        writer.append("main", samples)
    return path


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    """A folder with one good file of every kind."""
    recording(tmp_path / "a.h5", 1)
    recording(tmp_path / "b.h5", 2)
    model = table_one_model()
    write_modal_model(tmp_path / "model.json", model)
    write_frf(tmp_path / "frf.h5", model.frf(np.arange(1.0, 60.0, 0.125)))
    (tmp_path / "cut.toml").write_text(CUT, encoding="utf-8")
    (tmp_path / "text.txt").write_text("nothing\n", encoding="utf-8")
    (tmp_path / "map.toml").write_text(MAPPING.format(unit="N"), encoding="utf-8")
    return tmp_path


def wrong_version(bench: Path) -> None:
    with h5py.File(bench / "a.h5", "r+") as file:
        file.attrs["format_version"] = 99


def wrong_model_version(bench: Path) -> None:
    content = json.loads((bench / "model.json").read_text(encoding="utf-8"))
    write_json(bench / "model.json", content | {"format_version": 7})


def not_a_number(bench: Path) -> None:
    with h5py.File(bench / "a.h5", "r+") as file:
        file.attrs["format_version"] = 1  # as another program writes it: without checksums
        file["signals/main/samples"][100, 1] = np.nan


def other_rate(bench: Path) -> None:
    recording(bench / "b.h5", 2, rate=512.0)


def one_signal(bench: Path) -> None:
    recording(bench / "a.h5", 1, dependent=True)


def unequal(bench: Path) -> None:
    np.savez(bench / "data.npz", force=np.zeros(100), motion=np.zeros(99))


def good_arrays(bench: Path) -> None:
    np.savez(bench / "data.npz", force=np.zeros(100), motion=np.zeros(100))


def unknown_unit(bench: Path) -> None:
    good_arrays(bench)
    (bench / "map.toml").write_text(MAPPING.format(unit="furlong"), encoding="utf-8")


def missing_array(bench: Path) -> None:
    np.savez(bench / "data.npz", force=np.zeros(100))


def nothing(bench: Path) -> None:
    """The bench as it is."""


def broken_toml(bench: Path) -> None:
    (bench / "cut.toml").write_text("[cutting]\nteeth = = 2\n", encoding="utf-8")


def no_teeth(bench: Path) -> None:
    (bench / "cut.toml").write_text(CUT.replace("teeth = 2", "teeth = 0"), encoding="utf-8")


def no_plan(bench: Path) -> None:
    (bench / "plan.toml").write_text(CUT, encoding="utf-8")


def odd_plan(bench: Path) -> None:
    (bench / "plan.toml").write_text(CUT + "[plan]\nband = [1, 2]\n", encoding="utf-8")


def truncated(bench: Path) -> None:
    whole = (bench / "a.h5").read_bytes()
    (bench / "a.h5").write_bytes(whole[: len(whole) // 2])


LOBES = ["lobes", "model.json", "--cutting", "cut.toml", "--speeds", "600", "2000", "20", "--out", "out.csv"]
ESTIMATE = ["estimate", "a.h5", "b.h5", "--out", "out.h5", "--segment", "1"]
CONVERT = ["convert", "data.npz", "out.h5", "--map", "map.toml"]
CALIBRATE = ["calibrate", "model.json", "--tip", "a.h5", "--sensor", "frf.h5", "--out", "out.json"]
FIT = ["fit", "frf.h5", "--out", "out.json"]

CASES: list[tuple[str, Callable[[Path], None], list[str], str]] = [
    ("no such file", nothing, ["estimate", "none.h5", "--out", "out.h5"], "none.h5"),
    ("wrong kind of file", nothing, ["estimate", "text.txt", "--out", "out.h5"], "text.txt"),
    ("model where an FRF is due", nothing, ["fit", "model.json", "--band", "10", "30", "--out", "out.json"], "model"),
    ("recording version", wrong_version, ESTIMATE, "99"),
    ("model version", wrong_model_version, [*LOBES, "--max-depth", "0.01"], "7"),
    ("missing channel", nothing, [*ESTIMATE, "--response", "az"], "az"),
    ("not a number", not_a_number, ESTIMATE, "fy"),
    ("truncated file", truncated, ESTIMATE, "a.h5"),
    ("sample rates differ", other_rate, ESTIMATE, "512"),
    ("fewer tests than inputs", one_signal, ["estimate", "a.h5", "--out", "out.h5", "--segment", "1"], "immersion"),
    ("unequal lengths", unequal, CONVERT, "99"),
    ("unknown unit", unknown_unit, CONVERT, "furlong"),
    ("missing array", missing_array, CONVERT, "motion"),
    ("empty band", nothing, [*FIT, "--band", "30", "10"], "30"),
    ("band outside", nothing, [*FIT, "--band", "100", "200"], "too few"),
    ("unknown method", nothing, [*FIT, "--band", "10", "30", "--method", "magic"], "magic"),
    ("unknown estimator", nothing, [*ESTIMATE, "--estimator", "h9"], "h9"),
    ("too few responses for H2", nothing, [*ESTIMATE, "--estimator", "h2"], "H2"),
    ("unknown window", nothing, [*ESTIMATE, "--window", "square"], "square"),
    ("segment too long", nothing, [*ESTIMATE[:-1], "100"], "segment"),
    ("negative depth", nothing, [*LOBES, "--max-depth", "-0.01"], "-0.01"),
    ("broken TOML", broken_toml, [*LOBES, "--max-depth", "0.01"], "cut.toml"),
    ("no teeth", no_teeth, [*LOBES, "--max-depth", "0.01"], "teeth"),
    ("speeds in reverse", nothing, [*LOBES[:5], "2000", "600", "20", *LOBES[-2:], "--max-depth", "0.01"], "2000"),
    ("wrong suffix", nothing, ["fit", "frf.h5", "--band", "10", "30", "--out", "out.xml"], ".json"),
    ("no such folder", nothing, ["fit", "frf.h5", "--band", "10", "30", "--out", "none/out.json"], "none"),
    ("unknown option", nothing, [*FIT, "--bend", "10", "30"], "--bend"),
    ("plan without a plan", no_plan, ["plan", "plan.toml"], "[plan]"),
    ("plan with an unknown key", odd_plan, ["plan", "plan.toml"], "band_hz"),
    ("recordings and an FRF together", nothing, ["fit", "a.h5", *FIT[1:], "--band", "10", "30"], "one FRF"),
    ("cut too short to judge", nothing, ["chatter", "a.h5", "--cutting", "cut.toml", "--speed", "60"], "needed"),
    ("speed not stated", nothing, ["chatter", "a.h5", "--cutting", "cut.toml"], "--speed"),
    ("speed that is none", nothing, ["chatter", "a.h5", "--cutting", "cut.toml", "--speed", "-5"], "-5"),
    ("UFF that is none", nothing, ["convert", "text.txt", "out.uff"], "text.txt"),
    ("unknown command", nothing, ["fity"], "fity"),
    ("report of nothing usable", nothing, ["report", "text.txt", "--out", "out.html"], "text.txt"),
    ("recording where an FRF is due", nothing, CALIBRATE, "a.h5"),
]


@pytest.mark.parametrize(("spoil", "command", "mentioned"), [case[1:] for case in CASES], ids=[c[0] for c in CASES])
def test_bad_input_is_one_line_and_leaves_nothing(
    bench: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    spoil: Callable[[Path], None],
    command: list[str],
    mentioned: str,
) -> None:
    monkeypatch.chdir(bench)
    spoil(bench)
    before = {path.name for path in bench.iterdir()}
    assert run(command) == BAD_INPUT
    message = capsys.readouterr().err.strip().splitlines()
    assert len(message) == 1
    assert mentioned in message[0]
    assert {path.name for path in bench.iterdir()} == before


@pytest.mark.long
def test_the_same_commands_succeed_on_good_input(bench: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """So that each refusal above is the fault of what was spoilt."""
    monkeypatch.chdir(bench)
    good_arrays(bench)
    assert run(CONVERT) == DONE
    assert run([*ESTIMATE, "--force"]) == DONE
    assert run([*FIT, "--band", "10", "30", "--force"]) == DONE
    assert run([*LOBES, "--max-depth", "0.01", "--force"]) == DONE
    assert run(["report", "out.csv", "cut.toml", "model.json", "--out", "out.html"]) == DONE
    for source, target in (("frf.h5", "a.uff"), ("a.uff", "b.h5.h5"), ("model.json", "m.uff"), ("m.uff", "m.json")):
        assert run(["convert", source, target]) == DONE
    assert run(["fit", "b.h5.h5", "--out", "again.json", "--band", "10", "30"]) == DONE
    assert run(["plan", str(Path(__file__).resolve().parents[2] / "examples" / "plan.toml")]) == DONE
    for name in ("a.h5", "frf.h5", "model.json", "out.csv", "cut.toml"):
        assert run(["inspect", name]) == DONE


def test_a_run_that_fails_on_good_input_has_exit_code_1(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rng = np.random.default_rng(0)
    shutil.copy(bench / "frf.h5", bench / "noise.h5")
    with h5py.File(bench / "noise.h5", "r+") as file:
        shape = file["values"].shape
        file["values"][...] = rng.standard_normal(shape) + 1j * rng.standard_normal(shape)
        del file.attrs["content_sha256"]
    arguments = [str(bench / "noise.h5"), "--band", "10", "30", "--max-order", "8", "--out", str(bench / "out.json")]
    assert run(["fit", *arguments]) == FAILED
    assert "no pole is stable" in capsys.readouterr().err
    assert not (bench / "out.json").exists()


def test_the_version_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--version"]) == 0
    assert capsys.readouterr().out == f"millfrf {importlib.metadata.version('millfrf')}\n"
