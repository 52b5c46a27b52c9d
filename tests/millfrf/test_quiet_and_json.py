"""`--quiet` leaves warnings and the answer; `--json` prints one document, with everything else on standard error."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from estimation import write_frf
from millfrf.command_line import call, flags_of, run
from millfrf.commands import STEPS
from millfrf.core import MillfrfWarning, writing_whole_file
from millfrf.core.steps import step
from millfrf.core.terminal import aside, manner, note, plain, say, say_concern, say_written, speaking, tell, warn
from modal_fit import ModalModel, write_modal_model

CUT = """[cutting]
teeth = 2
diameter_m = 0.0127
ktc_pa = 119e6
krc = 0.17
kac = 0.33
start_angle_deg = 90.0
exit_angle_deg = 180.0
"""
UNITS = re.compile(r"_(hz|m|s|n|rad|deg|rpm|n_m|m_per_n|m_rad)$")


@pytest.fixture
def model() -> ModalModel:
    """Two modes of the tip."""
    f, zeta = np.array([20.0, 33.0]), np.array([0.03, 0.05])
    poles = 2 * np.pi * f * (-zeta + 1j * np.sqrt(1 - zeta**2))
    right = np.array([[1.0, 0.2, 0.1], [0.1, 1.0, 0.3]], dtype=complex)
    left = right / (2j * poles.imag[:, None] * 20.0)
    places = ("TCP:+X", "TCP:+Y", "TCP:+Z")
    return ModalModel(poles, right, left, places, places, "receptance", "m/N", band=(10.0, 60.0))


@pytest.fixture
def bench(tmp_path: Path, model: ModalModel, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A model, its FRF and a cutting file."""
    write_modal_model(tmp_path / "model.json", model)
    write_frf(tmp_path / "frf.h5", model.frf(np.linspace(10.0, 60.0, 201)))
    (tmp_path / "cut.toml").write_text(CUT)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def _document(text: str) -> Any:
    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is no JSON")

    return json.loads(text, parse_constant=refuse)


LOBES = "lobes model.json --cutting cut.toml --speeds 600 1200 3 --max-depth 0.01 --method zero-order --out l.csv"
COMMANDS = {
    "inspect": "inspect model.json",
    "inspect frf": "inspect frf.h5",
    "lobes": LOBES,
    "fit": "fit frf.h5 --band 12 50 --out fitted.json",
    "convert": "convert frf.h5 frf.uff",
    "robot list": "robot list",
    "robot modes": "robot modes staubli_rx170 --count 2",
    "robot frf": "robot frf staubli_rx170 --lines 20 --out tip.json",
    "robot stiffness": "robot stiffness staubli_rx170",
}


@pytest.mark.parametrize("words", COMMANDS)
def test_one_document_and_nothing_else_on_standard_output(
    words: str, bench: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*COMMANDS[words].split(), "--json"]) == 0
    said = capsys.readouterr()
    stated = _document(said.out)
    assert (stated["format"], stated["format_version"]) == ("millfrf.answer", 1)
    assert COMMANDS[words].startswith(stated["command"])
    assert all(f"warning: {each}" in said.err + "\n" for each in stated["warnings"])
    assert all((bench / name).is_file() for name in stated["written"])
    assert len(stated) > 5, "no answer of its own"


def test_numbers_are_those_of_the_files(bench: Path, capsys: pytest.CaptureFixture[str], model: ModalModel) -> None:
    assert run([*LOBES.split(), "--json"]) == 0
    stated = _document(capsys.readouterr().out)
    rows = [line.split(",") for line in (bench / "l.csv").read_text().splitlines() if line[0].isdigit()]
    assert [f"{each['spindle_speed_rpm']:.10g}" for each in stated["limits"]] == [row[0] for row in rows]
    assert stated["lowest_depth_limit_m"] == pytest.approx(min(float(row[1]) for row in rows), rel=1e-6)
    assert stated["written"] == ["l.csv", "l.csv-metadata.json"]
    assert run(["inspect", "model.json", "--json"]) == 0
    modes = _document(capsys.readouterr().out)["modes"]
    assert [each["frequency_hz"] for each in modes] == pytest.approx(model.natural_frequencies.tolist())
    assert [each["damping_ratio"] for each in modes] == pytest.approx([0.03, 0.05])


def test_a_refusal_prints_no_document(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["inspect", "missing.h5", "--json"]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("millfrf: ")


def test_quiet_leaves_warnings_and_the_answer(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(LOBES.split()) == 0
    loud = capsys.readouterr()
    assert run([*LOBES.split(), "--quiet", "--force"]) == 0
    quiet = capsys.readouterr()
    assert quiet.out == loud.out.replace("wrote l.csv: ", "l.csv: ")
    assert [line for line in quiet.err.splitlines() if line.startswith("warning")] == loud.err.splitlines()
    assert run(["convert", "frf.h5", "out.uff", "--quiet"]) == 0
    assert capsys.readouterr().out == ""


def test_every_command_can_be_quiet_and_answers_in_json() -> None:
    assert all({"quiet", "json"} <= set(flags_of(words)) for words in STEPS)


def test_lines_of_each_kind(capsys: pytest.CaptureFixture[str]) -> None:
    def speak() -> tuple[str, str]:
        say_written(["b"])
        say_written(["c", "d"], "e")
        warn(["f", "f"])
        say("g")
        say_concern("h")
        note("i ...")
        aside("j")
        said = capsys.readouterr()
        return said.out, said.err

    with speaking():
        assert speak() == ("wrote b\nwrote c and d: e\ng\nwarning: h\ni ...\n", "warning: f\nnote: j\n")
    with speaking(quiet=True):
        assert speak() == ("c and d: e\ng\nwarning: h\n", "warning: f\n")
    with speaking(as_json=True) as manner:
        out, shown = speak()
        assert out == ""
        assert "wrote c and d: e" in shown
        assert manner.warnings == ["f", "h"]
        tell(lambda: {"depth_m": np.float64(np.nan)})
        assert plain(manner.answers) == {"depth_m": None}
    tell(lambda: pytest.fail("made though nobody asked"))


def test_outside_of_a_command_nothing_is_printed_and_warnings_are_python_s(capsys: pytest.CaptureFixture[str]) -> None:
    say("a")
    note("b")
    aside("c")
    say_written(["d"])
    with pytest.warns(MillfrfWarning, match="e"):
        warn(["e"])
    said = capsys.readouterr()
    assert (said.out, said.err) == ("", "")


def test_what_ends_with_a_code_still_answers(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    @step
    def plan() -> None:
        """Write a file, and end with a code."""
        with writing_whole_file(tmp_path / "a.txt") as temporary:
            temporary.write_text("a")
        tell(lambda: {"left": 2})
        manner().exit_code = 1

    assert call("plan", plan, [], {}, json=True) == 1
    stated = _document(capsys.readouterr().out)
    assert stated["left"] == 2
    assert stated["written"] == [str(tmp_path / "a.txt")]


@pytest.mark.parametrize("words", ["inspect", "lobes", "fit", "robot modes", "robot stiffness"])
def test_keys_of_numbers_end_in_their_unit_or_have_none(
    words: str, bench: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*COMMANDS[words].split(), "--json"]) == 0
    plain_numbers = {"format_version", "damping_ratio", "damping_ratio_standard_error", "compliance", "torque_n_m"}
    plain_numbers |= {"explained_by_response", "explained_by_excitation"}

    def check(key: str, value: Any) -> None:
        if isinstance(value, dict):
            for name, each in value.items():
                check(name, each)
        elif isinstance(value, list):
            for each in value:
                check(key, each)
        elif isinstance(value, float):
            assert UNITS.search(key) or key in plain_numbers, key

    for key, value in _document(capsys.readouterr().out).items():
        if key != "deflection_under_m_rad":
            check(key, value)


@pytest.mark.parametrize("options", ["", " --json"])
def test_a_reader_that_stops_early_ends_no_command(bench: Path, options: str) -> None:
    """As under ``| head``: the pipe closes before the first line, and the model is written nevertheless."""
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "wb") as closed:
        words = [sys.executable, "-m", "millfrf", *f"fit frf.h5 --out fitted.json{options}".split()]
        ended = subprocess.run(words, stdout=closed, stderr=subprocess.PIPE, text=True, cwd=bench, check=False)
    assert (ended.returncode, "Broken pipe" in ended.stderr) == (0, False)
    assert (bench / "fitted.json").exists()
