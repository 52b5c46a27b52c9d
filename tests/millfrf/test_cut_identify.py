"""`millfrf cut identify` from recordings to a cutting file that lobes read, and what it refuses."""

import importlib.util
import json
import math
from pathlib import Path

import numpy as np
import pytest

from acquisition import Channel, RecordingWriter, StreamDescription
from millfrf import cut_identify
from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.cutting import read_cutting_process

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


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cutter without coefficients, and the forces of three feeds, each with its feed in the set-up."""
    where = tmp_path_factory.mktemp("identify")
    (where / "cutter.toml").write_text(CUTTER, encoding="utf-8")
    channels = tuple(Channel(f"F{a.lower()}", "force", "N", "TCP", f"+{a}") for a in "XYZ")
    for number, feed in enumerate(FEEDS):
        force = loops.loop_forces(feed, first_angle=float(number), seed=number)
        stream = StreamDescription("main", loops.RATE, 0.0, channels)
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


def test_python_and_json_give_the_same(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paths = [folder / f"f{number}.h5" for number in range(3)]
    result = cut_identify(folder / "cutter.toml", *paths, depth=0.003, feeds=FEEDS, speed=6000)
    capsys.readouterr()
    assert run([*words(folder), "--json", "--out", str(folder / "again.toml")]) == DONE
    answer = json.loads(capsys.readouterr().out)
    assert answer["coefficients"]["ktc_pa"] == pytest.approx(result.coefficients[0])
    assert answer["method"] == result.method == "waveforms"
    assert math.isclose(answer["runout_m"], result.process.runout)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--feeds", "25e-6,75e-6"], "2 feeds for 3 recordings"),
        (["--feeds", "25um,75um,1"], "are no numbers"),
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
