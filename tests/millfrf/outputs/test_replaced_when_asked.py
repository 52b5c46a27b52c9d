"""No command replaces what is there unasked: it is refused before anything is read, and `--force` replaces it."""

import re
from pathlib import Path
from typing import Annotated

import pytest
from writing_commands import COMMANDS, Writing

from millfrf.command_line import CONTINUED, call, flags_of, run
from millfrf.commands import STEPS, function_of, words_of
from millfrf.core import InputError, keeping_files, writing_whole_file, writing_whole_folder
from millfrf.core.steps import Writes, outputs_of, step

OLD = "a result that somebody may need"
BAD_INPUT = 2


def _contents(folder: Path) -> dict[str, str]:
    return {str(path.relative_to(folder)): path.read_text() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("command", COMMANDS, ids=[one.name for one in COMMANDS])
def test_each_output_is_refused_before_any_input_is_read(
    command: Writing, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)  # no input is there: whoever reads first complains of that
    for name in command.outputs:
        output = tmp_path / name
        output.parent.mkdir(exist_ok=True)
        output.write_text(OLD)
        assert run(command.words) == BAD_INPUT
        said = capsys.readouterr()
        assert said.out == ""
        assert re.fullmatch(rf"millfrf: {re.escape(name)} exists; replace it with --force, or choose .*\n", said.err)
        assert _contents(tmp_path) == {name: OLD}
        output.unlink()


def test_every_command_that_names_an_output_has_the_option() -> None:
    for words in STEPS:
        writes = bool(outputs_of(function_of(words))) or words == "convert"
        assert ("force" in flags_of(words)) == (writes and words not in CONTINUED), words


@pytest.mark.parametrize("command", [one for one in COMMANDS if one.arguments.endswith("--out out")])
def test_a_folder_of_results_is_known_by_its_files(command: Writing) -> None:
    words = words_of(command.words)
    [files] = [option.marker.files for option in outputs_of(function_of(words)) if option.name == "out"]
    assert {f"out/{name}" for name in files} == set(command.outputs)


def test_force_replaces_and_without_it_the_old_file_stays(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "stiffness.csv"
    typed = ["robot", "stiffness", "staubli_rx170", "--table", str(out)]
    assert run(typed) == 0
    first = out.read_text()
    out.write_text(OLD)
    assert run(typed) == BAD_INPUT
    assert out.read_text() == OLD
    assert run([*typed, "--force"]) == 0
    assert out.read_text() == first


def test_names_that_the_program_chooses_are_free(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.html").write_text(OLD)
    assert run(["robot", "show", "staubli_rx170"]) == 0
    assert "wrote robot-2.html" in capsys.readouterr().out
    assert (tmp_path / "robot.html").read_text() == OLD
    assert run(["robot", "show", "staubli_rx170", "--force"]) == 0
    assert (tmp_path / "robot.html").read_text() != OLD


def test_a_file_that_comes_up_while_a_command_computes_stays(tmp_path: Path) -> None:
    @step
    def late(*, out: Annotated[Path, Writes(suffixes=(".txt",))]) -> None:
        """Write a file that somebody else writes meanwhile.

        Parameters
        ----------
        out
            File to write.
        """
        with writing_whole_file(out) as temporary:
            temporary.write_text("new")
            out.write_text(OLD)

    out = tmp_path / "a.txt"
    with pytest.raises(InputError, match="exists; replace it with --force"):
        call("late", late, [], {"out": out})
    assert out.read_text() == OLD
    call("late", late, [], {"out": out}, force=True)
    assert out.read_text() == "new"


def test_no_file_of_a_folder_is_moved_where_one_must_stay(tmp_path: Path) -> None:
    (tmp_path / "z.txt").write_text(OLD)

    def write() -> None:
        with writing_whole_folder(tmp_path) as folder:
            (folder / "a.txt").write_text("new")
            (folder / "z.txt").write_text("new")

    with pytest.raises(InputError, match=r"z\.txt exists"), keeping_files(""):
        write()
    assert _contents(tmp_path) == {"z.txt": OLD}


def test_what_a_command_made_itself_it_may_complete(tmp_path: Path) -> None:
    with keeping_files(""):
        for text in ("first", "second"):
            with writing_whole_file(tmp_path / "a.txt") as temporary:
                temporary.write_text(text)
    assert (tmp_path / "a.txt").read_text() == "second"
