"""Commands of the page: forms state them, Python says the same, and a saved session repeats them."""

import asyncio
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

import millfrf
from estimation import write_frf
from millfrf.app.command_lines import CommandLine
from millfrf.app.cut_tab import CutTab
from millfrf.app.folder import FolderFile, files_in
from millfrf.app.forms import StepForm
from millfrf.app.own_files import MARK, store_dropped, write_own
from millfrf.app.runs import Run
from millfrf.app.saved_work import read_work, repeat, write_work
from millfrf.app.workspace import Workspace
from millfrf.command_line import run as run_command
from millfrf.commands import STEPS
from millfrf.core import InputError, MillfrfError
from modal_fit import ModalModel, write_modal_model

POLES = 2 * np.pi * np.array([16.0, 31.0]) * (-0.02 + 1j)
SHAPES = 1e-3 * np.array([[1.0, 0.5], [0.7, -0.9]], dtype=complex)
MODEL = ModalModel(POLES, SHAPES, -1j * SHAPES, ("TCP:+X", "TCP:+Y"), ("TCP:+X", "TCP:+Y"))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_frf(tmp_path / "frf.h5", MODEL.frf(np.linspace(5.0, 60.0, 300)))
    (tmp_path / "notes.docx").write_bytes(b"\0")
    (tmp_path / "cut.csv").write_text("t,a\n0,1\n")
    return tmp_path


@pytest.mark.parametrize("name", STEPS)
def test_every_step_has_a_form_whose_fields_are_its_options(name: str) -> None:
    form = StepForm(name)
    assert set(form.fields) == set(form.options)
    assert form.view is not None


def test_a_form_states_the_command_and_python_the_same(folder: Path) -> None:
    form = StepForm("fit", ("band", "out"), {"out": "model.json"})
    with pytest.raises(InputError, match="Sources: choose or type it first"):
        form.command()
    form.offer(files_in(folder))
    assert "frf.h5" in form.fields["sources"].options
    form.fields["sources"].value = ["frf.h5"]
    form.fill({"band": "5, 60", "modes": "2", "responses": "TCP:+X,TCP:+Y"})
    form.fields["refine"].value = True
    form.replace.value = True
    words = ["fit", "frf.h5", "--out", "model.json", "--band", "5", "60", "--modes", "2", "--response", "TCP:+X,TCP:+Y"]
    command = form.command()
    assert command.words == (*words, "--refine", "--force")
    assert command.outputs == ("model.json",)
    call = 'mf.fit("frf.h5", out="model.json", band=(5.0, 60.0), modes=2, responses=("TCP:+X,TCP:+Y",), refine=True)'
    assert call in command.python.replace("\n    ", "")
    form.offer(())
    assert form.fields["sources"].value == []  # the file is gone


def test_the_python_lines_do_what_the_command_does(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    command = CommandLine(("fit", "frf.h5", "--band", "6", "50", "--out", "by_python.json"))
    names: dict[str, object] = {}
    exec(command.python.replace("print(result)", ""), names)
    model = millfrf.open("by_python.json")
    assert model.natural_frequencies == pytest.approx(MODEL.natural_frequencies, rel=1e-4)


def test_a_text_keeps_its_spaces(folder: Path) -> None:
    form = StepForm("report", ("title",), {"out": "r.html"})
    form.offer(files_in(folder))
    form.fields["files"].value = ["frf.h5"]
    form.fill({"title": "Tip of the robot, pose 3"})
    assert form.command().python.splitlines()[1].count('title="Tip of the robot, pose 3"') == 1


def test_a_session_repeats_no_recording(folder: Path) -> None:
    workspace = Workspace(folder)
    workspace.add(CommandLine(("acquire", "session.toml", "--out", "a.h5")))
    assert workspace.commands == ()
    workspace.add(CommandLine(("fit", "frf.h5", "--out", "model.json")))
    assert workspace.visited().commands == workspace.commands != ()


def test_the_limits_follow_the_fields_or_are_not_shown(folder: Path) -> None:
    write_modal_model(folder / "model.json", MODEL)
    (folder / "lobes.csv").write_text("mine")

    async def work() -> None:
        tab = CutTab(Workspace(folder))
        with pytest.raises(InputError, match="choose a model"):
            tab.command()
        tab.model.value, tab.speeds.value = "model.json", "900 1000"
        for _ in range(600):
            await asyncio.sleep(0.1)
            if tab._plot.object is not None:
                break
        assert "of 80 speeds" in tab._said.object
        assert "TCP:+Z is missing" in tab._said.object  # warnings of the limits stand beside them
        tab.cut.engagement.value = "up"
        tab.cut.sliders["radial_depth_m"].value = 50.0  # wider than the cutter
        for _ in range(600):
            await asyncio.sleep(0.1)
            if "radial" in tab._said.object:
                break
        assert "radial" in tab._said.object
        assert tab._plot.object is None
        assert "--force" not in tab.command().words  # a table of the user is not replaced unasked
        tab.name.value = "elsewhere/cut.toml"
        with pytest.raises(InputError, match="in this folder"):
            tab.command()

    asyncio.run(work())


def test_files_are_offered_by_their_kind(folder: Path) -> None:
    assert files_in(folder) == (FolderFile("cut.csv", "other program"), FolderFile("frf.h5", "frf"))


def test_a_saved_session_runs_again_and_names_what_fails(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fitted = CommandLine(("fit", "frf.h5", "--band", "6", "50", "--out", "model.json"))
    work = folder / "work.toml"
    write_work(work, [fitted])
    assert tomllib.loads(work.read_text())["steps"] == [{"command": f"{fitted.text} --force"}]
    for _ in range(2):  # it replaces its own outputs
        assert repeat(work) == (f"{fitted.text} --force",)
    assert len(millfrf.open(folder / "model.json").poles) == 2
    capsys.readouterr()
    assert run_command(["repeat", str(work), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["command"] == "repeat"
    (folder / "frf.h5").unlink()
    with pytest.raises(MillfrfError, match=r"step 1 of 1 failed: millfrf fit .*no file"):
        repeat(work)
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('format = "millfrf.work"\nformat_version = 1\nsteps = []', "steps"),
        ('format = "other"\nformat_version = 1\n[[steps]]\ncommand = "fit"', "millfrf.work"),
        ('format = "millfrf.work"\nformat_version = 1\n[[steps]]\ncommand = "fry eggs"', "no command 'fry eggs'"),
        ('format = "millfrf.work"\nformat_version = 1\n[[steps]]\ncommand = "fit \'a"', "is no command"),
        ('format = "millfrf.work"\nformat_version = 1\n[[steps]]\ncommand = "repeat work.toml"', "cannot repeat"),
    ],
)
def test_what_is_no_session_is_refused(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "work.toml").write_text(text)
    with pytest.raises(InputError, match=words):
        read_work(tmp_path / "work.toml")


def test_the_page_replaces_its_own_files_and_none_of_the_users(tmp_path: Path) -> None:
    own, mine = tmp_path / "own.toml", tmp_path / "mine.toml"
    write_own(own, "a = 1\n", "a test")
    write_own(own, "a = 2\n", "a test")
    assert own.read_text() == f"{MARK}: a test\na = 2\n"
    mine.write_text("a = 3\n")
    with pytest.raises(InputError, match="no file of this page"):
        write_own(mine, "a = 4\n", "a test")
    assert mine.read_text() == "a = 3\n"


@pytest.mark.parametrize("name", ["../../evil.h5", "C:\\temp\\evil.h5", "/etc/evil.h5"])
def test_a_dropped_file_stays_in_the_folder(tmp_path: Path, name: str) -> None:
    assert store_dropped(tmp_path, name, b"x") == tmp_path / "evil.h5"
    store_dropped(tmp_path, name, b"x")
    with pytest.raises(InputError, match="another content"):
        store_dropped(tmp_path, name, b"y")
    for bad in ("..", "", ".hidden"):
        with pytest.raises(InputError, match="no name"):
            store_dropped(tmp_path, bad, b"x")


@pytest.mark.long
def test_a_run_has_output_progress_and_an_end(folder: Path) -> None:
    shares: list[float] = []
    command = CommandLine(("inspect", "frf.h5"))
    run = Run(command, folder, lambda now: shares.append(now.share or 0.0))
    assert asyncio.run(run.run()) == run.exit_code == 0
    assert any("TCP:+X" in line for line in run.lines)
    assert shares
    refused = Run(CommandLine(("fit", "nothing.h5")), folder, lambda _: None)
    assert asyncio.run(refused.run()) == 2
    assert any("--out" in line or "nothing.h5" in line for line in refused.lines)
