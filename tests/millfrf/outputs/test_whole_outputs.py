"""Outputs appear complete or not at all: when their writer is killed, and when there is no room for them."""

import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from whole_files import read_whole
from writing_commands import COMMANDS, Writing

Trial = Callable[..., dict[str, Any]]
OLD = "an older result, which stays where the new one does not come\n"
QUICK = ("convert npz", "convert csv", "estimate")
KILLED = ("estimate",)
LONG = ("diagnose", "cut diagnose")
SMALL = 2048
"""Bytes: smaller than any output but a few texts."""


def _named(names: tuple[str, ...]) -> list[Writing]:
    return [each for each in COMMANDS if each.name in names]


def _ids(commands: list[Writing]) -> list[str]:
    return [each.name for each in commands]


@pytest.fixture
def bench(inputs: Path, tmp_path: Path) -> Path:
    folder = tmp_path / "bench"
    shutil.copytree(inputs, folder)
    return folder


def _lay_old(command: Writing, folder: Path) -> None:
    """Put an older result where the command writes."""
    for name in command.outputs:
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(OLD, encoding="utf-8")


def _names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def _leftovers(folder: Path) -> list[str]:
    return sorted(str(path) for path in folder.rglob(".millfrf-*"))


def _judge(command: Writing, folder: Path, *, must_be_old: bool) -> int:
    """Check that each output is the old one or whole; how many are new."""
    new = 0
    for path in (folder / name for name in command.outputs):
        if not path.exists() or path.read_bytes() == OLD.encode():
            continue
        assert not must_be_old, f"{path.name} was replaced"
        read_whole(path)
        new += 1
    return new


def _full(command: Writing, bench: Path, trial: Trial, largest: int) -> None:
    _lay_old(command, bench)
    before = _names(bench)
    done = trial(bench, [*command.words, "--force"], largest_file=largest)
    assert done["code"] == 1, done
    last = done["said"].splitlines()[-1]
    assert last.startswith("millfrf: no room for "), done["said"]
    if largest:  # with none at all, files that libraries make beside are the first to fail
        assert last.startswith(("millfrf: no room for out", "millfrf: no room for poles")), done["said"]
    assert "Traceback" not in done["said"], done["said"]
    _judge(command, bench, must_be_old=len(command.outputs) == 1 or command.name in LONG)
    assert _names(bench) == before


def _kill(command: Writing, bench: Path, trial: Trial, moments: int, seed: int) -> int:
    """Kill the command at random moments, half of them while it writes; how many kills met unfinished files."""
    generator = np.random.default_rng(seed)
    whole = trial(bench, [*command.words, "--force"])
    assert whole["code"] == 0, whole
    met = 0
    for number in range(moments):
        for name in command.outputs:
            (bench / name).unlink(missing_ok=True)
        _lay_old(command, bench)
        for leftover in _leftovers(bench):  # else it is taken for the writing that is waited for
            shutil.rmtree(leftover, ignore_errors=True)
        at = float(generator.uniform())
        how = {"kill_in_writing": 0.05 * at**2} if number % 2 else {"kill_after": at * whole["seconds"]}
        trial(bench, [*command.words, "--force"], **how)
        _judge(command, bench, must_be_old=False)
        met += bool(_leftovers(bench))
    for name in command.outputs:
        (bench / name).unlink(missing_ok=True)
    said = trial(bench, [*command.words, "--force"])
    assert said["code"] == 0, said
    assert not _leftovers(bench)
    return met


@pytest.mark.long
@pytest.mark.parametrize("command", _named(QUICK), ids=_ids(_named(QUICK)))
def test_a_full_disk_leaves_the_old_results(command: Writing, bench: Path, trial: Trial) -> None:
    _full(command, bench, trial, SMALL)


@pytest.mark.slow
@pytest.mark.parametrize("command", list(COMMANDS), ids=_ids(list(COMMANDS)))
def test_every_command_on_a_full_disk(command: Writing, bench: Path, trial: Trial) -> None:
    whole = trial(bench, [*command.words, "--force"])
    assert whole["code"] == 0, whole
    largest = max((bench / name).stat().st_size for name in command.outputs)
    for name in command.outputs:
        (bench / name).unlink()
    for share in (0.0, 0.5, 0.95):
        _full(command, bench, trial, int(share * largest))


@pytest.mark.long
@pytest.mark.parametrize("command", _named(KILLED), ids=_ids(_named(KILLED)))
def test_a_kill_leaves_no_partial_file(command: Writing, bench: Path, trial: Trial) -> None:
    _kill(command, bench, trial, 2, 1)


@pytest.mark.slow
def test_three_hundred_kills_leave_no_partial_file(inputs: Path, tmp_path: Path, trial: Trial) -> None:
    met = 0
    for seed, command in enumerate(COMMANDS):
        bench = tmp_path / command.name
        shutil.copytree(inputs, bench)
        met += _kill(command, bench, trial, 2 if command.name in LONG else 11, seed)
    assert met > 50, "the kills hardly ever met a command that was writing"


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 64 kB, where this process may make one."""
    folder = tmp_path / "disk"
    folder.mkdir()
    made = shutil.which("mount") is not None and sys.platform == "linux"
    if not made or subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", folder], check=False).returncode:
        pytest.skip("only root may mount a small disk; the trials with bounded file sizes stand for it")
    yield folder
    subprocess.run(["umount", folder], check=True)


@pytest.mark.long
@pytest.mark.parametrize("name", ["out.h5", "out.json"])
def test_estimate_and_fit_onto_a_disk_of_64_kb(name: str, bench: Path, small_disk: Path, trial: Trial) -> None:
    """Before: HDF5 lost a table that it flushed late, said nothing, and crashed the program when it ended."""
    words = ["estimate", "up.h5", "down.h5", "central.h5", "--segment", "4"]
    if name == "out.json":
        words = ["fit", "frf_tip.h5", "--band", "12", "60"]
        (small_disk / "filler").write_bytes(bytes(40_000))
    held = _names(small_disk)
    done = trial(bench, [*words, "--out", str(small_disk / name)])
    assert done["code"] == 1, done
    assert f"no room for {small_disk / name}" in done["said"]
    assert _names(small_disk) == held


def test_what_a_killed_run_left_is_removed_by_the_next_and_said(bench: Path, trial: Trial) -> None:
    words = ["convert", "up.h5", "out.csv"]
    assert trial(bench, words, kill_in_writing=0.01)["code"] == -9
    assert len(_leftovers(bench)) > 0
    after = trial(bench, words)
    assert after["code"] == 0
    assert "note: removed" in after["said"]
    assert "unfinished out.csv of a run that was killed" in after["said"]
    assert not _leftovers(bench)
