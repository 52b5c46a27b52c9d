"""Every writing command on a disk that fails, and while other programs remove or replace what it writes.

`failing_disk.c` is preloaded: writes or syncs fail, take half of their bytes, or the disk is pulled. What a command
says that it wrote is there, whole; all else is as it was before; each failure is one line and exit code 1.
"""

import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from whole_files import read_whole
from writing_commands import COMMANDS, Writing

from acquisition import Channel, Recording, RecordingWriter, StreamDescription, recover
from millfrf.command_line import run
from millfrf.commands import STEPS, function_of, words_of
from millfrf.core.steps import outputs_of

Trial = Callable[..., dict[str, Any]]
OLD = "an older result, which stays where the new one does not come\n"
LONG = ("diagnose", "cut diagnose")
QUICK = ("convert csv", "fit", "report")
EIO, ENOSPC = 5, 28


@dataclass(frozen=True)
class Fault:
    """What fails, the number of the call from which on it does, the error, and what must be said."""

    kind: str
    said: tuple[str, ...]
    first: int = 1
    error: int = EIO
    keeps_old: bool = True

    @property
    def name(self) -> str:
        """Name for the list of tests."""
        return f"{self.kind} {self.first} {'full' if self.error == ENOSPC else ''}".strip()

    def variables(self, folder: Path) -> dict[str, str]:
        """Settings of ``failing_disk.c``."""
        numbers = {"FAULT_FROM": str(self.first), "FAULT_ERRNO": str(self.error)}
        return {"FAULT": self.kind, "FAULT_FOLDER": str(folder), **numbers}


FAILED = ("failed (Input/output error)", "failed (a write failed)")  # HDF5 does not always name the cause
FAULTS = (
    Fault("write", FAILED),
    Fault("write", FAILED, first=2),
    Fault("write", FAILED, first=5),
    Fault("write", ("no room for ",), first=2, error=ENOSPC),
    Fault("sync", FAILED),
    # a new folder of results is synced before it gets its name, a file has its name already
    Fault("folder", ("was written, but its disk failed to keep the name", *FAILED), keeps_old=False),
    Fault("pulled", FAILED),
    Fault("pulled", FAILED, first=3),
    Fault("removed", ("removed or replaced by another program", "removed, replaced or changed"), keeps_old=False),
    Fault("replaced", ("removed or replaced by another program", "removed, replaced or changed"), keeps_old=False),
)


@pytest.fixture
def bench(inputs: Path, tmp_path: Path) -> Path:
    folder = tmp_path / "bench"
    shutil.copytree(inputs, folder)
    return folder


@pytest.fixture(autouse=True)
def _needs_the_library(failing_disk: Path | None) -> None:
    if failing_disk is None:
        pytest.skip("the failing disk needs gcc on Linux")


def _written(said: str) -> str:
    """What a command says that it wrote."""
    return "\n".join(line for line in said.splitlines() if "wrote " in line)


def _judge(command: Writing, bench: Path, fault: Fault, done: dict[str, Any]) -> None:
    said = done["said"]
    line = said.splitlines()[-1]
    if done["code"] == 0:  # it needs fewer calls than the fault lets pass
        assert fault.first > 1, said
    else:
        assert done["code"] == 1, done
        assert line.startswith("millfrf: "), said
        assert any(words in line for words in fault.said), said
    assert "Traceback" not in said
    assert "does not foresee" not in said
    for name in command.outputs:
        path = bench / name
        is_old = path.exists() and path.read_text(encoding="utf-8", errors="replace") == OLD
        if name in _written(said) or done["code"] == 0:
            assert not is_old, said
        if fault.keeps_old and done["code"] and name not in _written(said) and len(command.outputs) == 1:
            assert is_old, said
        if fault.kind not in ("removed", "replaced") and not is_old:
            read_whole(path)
    if fault.kind != "pulled":
        assert not list(bench.rglob(".millfrf-*"))


def _fail(command: Writing, bench: Path, trial: Trial, fault: Fault) -> None:
    for name in command.outputs:
        (bench / name).parent.mkdir(exist_ok=True)
        (bench / name).write_text(OLD, encoding="utf-8")
    done = trial(bench, [*command.words, "--force"], fault=fault.variables(bench))
    _judge(command, bench, fault, done)


def _ids(listed: list[Any]) -> list[str]:
    return [member.name for member in listed]


@pytest.mark.parametrize("fault", FAULTS, ids=_ids(list(FAULTS)))
def test_a_table_on_a_failing_disk(fault: Fault, bench: Path, trial: Trial) -> None:
    [command] = [command for command in COMMANDS if command.name == "convert csv"]
    _fail(command, bench, trial, fault)


FURTHER = (
    Writing("robot show", "robot show staubli_rx170 --out out.html", ("out.html",)),
    Writing(
        "robot learn",
        "robot learn staubli_rx170 model_tip.json model_tip.json --pose ready --pose 0,-30,110,0,70,0 --out out.json",
        ("out.json",),
    ),
    Writing("new mapping", "new mapping table.csv --out out.toml", ("out.toml",)),
    Writing("new cut", "new cut --out out.toml", ("out.toml",)),
    Writing("new session", "new session --out out.toml", ("out.toml",)),
    Writing("new campaign", "new campaign up.h5 down.h5 --out out.toml", ("out.toml",)),
    Writing("new schemas", "new schemas --out out", ("out/cut.schema.json",)),
)
"""Commands that write few kilobytes, which no other trial needs."""

ELSEWHERE = {
    "acquire": "below",
    "campaign": "tests/millfrf/campaign/core/test_kills.py",
    "demo": "writes with the commands above",
    "new robot": "writes as robot update and robot identify do",
    "watch": "writes as acquire does",
    "robot diagnose": "writes as diagnose does",
    "robot update": "writes as robot identify does",
}
SHORT = [command for command in (*COMMANDS, *FURTHER) if command.name not in LONG]


def test_every_command_that_writes_is_tried() -> None:
    writing = {words for words in STEPS if words == "convert" or outputs_of(function_of(words))}
    assert writing == {words_of(command.words) for command in (*COMMANDS, *FURTHER)} | set(ELSEWHERE)


@pytest.mark.long
@pytest.mark.parametrize("command", SHORT, ids=_ids(SHORT))
def test_every_command_on_failing_disks(command: Writing, bench: Path, trial: Trial) -> None:
    for fault in FAULTS:
        _fail(command, bench, trial, fault)


@pytest.mark.slow
@pytest.mark.parametrize("name", LONG)
def test_diagnoses_on_failing_disks(name: str, bench: Path, trial: Trial) -> None:
    [command] = [command for command in COMMANDS if command.name == name]
    for fault in FAULTS:
        _fail(command, bench, trial, fault)


@pytest.mark.long
@pytest.mark.parametrize("command", SHORT, ids=_ids(SHORT))
def test_writes_that_take_half_of_their_bytes_are_completed(command: Writing, bench: Path, trial: Trial) -> None:
    done = trial(bench, command.words, fault={"FAULT": "short", "FAULT_FOLDER": str(bench)})
    assert done["code"] == 0, done
    for name in command.outputs:
        read_whole(bench / name)


STREAM = StreamDescription("main", 1000.0, 0.0, (Channel("fx", "force", "N"),))


def _session(folder: Path, rows: int, speed: float) -> None:
    """A session that replays counted samples."""
    with RecordingWriter(folder / "whole.h5", [STREAM], overwrite=True) as writer:
        writer.append("main", np.arange(float(rows))[:, None])
    (folder / "s.toml").write_text(f'[device]\ndriver = "replay"\nfile = "whole.h5"\nspeed = {speed}\n')


ACQUIRE = ["acquire", "s.toml", "--out", "rec.h5"]
CLOSED = "; rec.h5 holds the "
RECOVERED = "save what is there onto another disk: millfrf recover rec.h5 --out"


def _kept_rows(path: Path) -> int:
    """Number of samples in a recording, which must be those that were replayed."""
    with Recording(path) as recording:
        assert recording.complete is False
        rows = recording.stream().read()[:, 0]
    np.testing.assert_array_equal(rows, np.arange(len(rows)))
    return len(rows)


@pytest.mark.parametrize("first", [1, 2, 3, 4, 5, 6, 8, 11, 15, 20, 30, 55, 80, 130])
@pytest.mark.parametrize("kind", ["write", "pulled"])
def test_a_recording_onto_a_disk_whose_writes_fail(kind: str, first: int, tmp_path: Path, trial: Trial) -> None:
    """Before: a traceback, "does not foresee" or a crash of the program at its end."""
    _session(tmp_path, 100_000, 1e9)
    done = trial(tmp_path, ACQUIRE, fault=Fault(kind, (), first).variables(tmp_path))
    assert done["code"] == 1, done
    assert "wrote" not in done["said"]
    line = done["said"].splitlines()[-1]
    assert line.startswith("millfrf: ")
    assert "failed (Input/output error)" in line
    assert done["said"].count("\n") == 2, done["said"]
    if (tmp_path / "rec.h5").exists():
        assert RECOVERED in line or CLOSED in line
        rows = _kept_rows(recover(tmp_path / "rec.h5").path)
        assert rows % 4096 == 0 or rows == 100_000
        assert rows or first < 20


def test_one_write_that_fails_closes_the_recording(tmp_path: Path, trial: Trial) -> None:
    _session(tmp_path, 100_000, 1e9)
    seen = set()
    for first in range(4, 60, 5):
        fault = Fault("write", (), first).variables(tmp_path) | {"FAULT_UNTIL": str(first)}
        before = [path.read_bytes() for path in tmp_path.glob("rec.h5")]
        done = trial(tmp_path, [*ACQUIRE, "--force"], fault=fault)
        assert done["code"] == 1, done
        line = done["said"].splitlines()[-1]
        assert "failed (Input/output error)" in line
        if "cannot write rec.h5" in line:  # while the empty recording was made
            assert [path.read_bytes() for path in tmp_path.glob("rec.h5")] == before
            continue
        seen.add(CLOSED in line)
        if CLOSED in line:
            with Recording(tmp_path / "rec.h5") as recording:
                assert "DiskError: the disk of rec.h5 failed" in recording.ending
            said = float(line.partition(CLOSED)[2].split()[0])
            assert _kept_rows(tmp_path / "rec.h5") >= 1000 * said - 5
        else:
            assert RECOVERED in line
    assert seen


def test_syncs_that_fail_end_a_recording(tmp_path: Path, trial: Trial) -> None:
    """Before: exit 0, "wrote rec.h5" and "nothing looks wrong"."""
    _session(tmp_path, 200_000, 20.0)
    done = trial(tmp_path, ACQUIRE, fault=Fault("sync", (), 2).variables(tmp_path))
    assert done["code"] == 1, done
    assert "wrote" not in done["said"]
    line = done["said"].splitlines()[-1]
    assert "did not keep what was written (Input/output error); the recording ends here, copy it" in line
    assert 4096 <= _kept_rows(tmp_path / "rec.h5") < 100_000
    with Recording(tmp_path / "rec.h5") as recording:
        assert recording.ending.startswith("NotKept: the disk of rec.h5 did not keep")


def test_a_last_sync_that_fails_is_stored(tmp_path: Path, trial: Trial) -> None:
    _session(tmp_path, 5000, 1e9)
    done = trial(tmp_path, ACQUIRE, fault=Fault("sync", (), 2).variables(tmp_path))
    assert (done["code"], "wrote" in done["said"]) == (1, False)
    assert _kept_rows(tmp_path / "rec.h5") == 5000
    with Recording(tmp_path / "rec.h5") as recording:
        assert "Input/output error" in recording.ending


@pytest.mark.parametrize("kind", ["sync", "folder"])
def test_a_recording_that_cannot_begin_leaves_nothing(kind: str, tmp_path: Path, trial: Trial) -> None:
    _session(tmp_path, 5000, 1e9)
    done = trial(tmp_path, ACQUIRE, fault=Fault(kind, (), 1).variables(tmp_path))
    assert done["code"] == 1, done
    assert not (tmp_path / "rec.h5").exists()
    assert not list(tmp_path.glob(".millfrf-*"))


@pytest.mark.parametrize("error", [ENOSPC, 30])
def test_a_full_or_read_only_disk_leaves_no_stub(error: int, tmp_path: Path, trial: Trial) -> None:
    """Before: HDF5's text, and an empty file."""
    _session(tmp_path, 5000, 1e9)
    done = trial(tmp_path, ACQUIRE, fault=Fault("write", (), 1, error).variables(tmp_path))
    assert done["code"] in (1, 2), done
    assert "HDF5" not in done["said"]
    assert "errno" not in done["said"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["s.toml", "whole.h5"]


def _running(folder: Path, seconds: float) -> subprocess.Popen[str]:
    """A recording that runs, and has written its first samples."""
    _session(folder, int(10_000 * seconds), 10.0)
    words = [sys.executable, "-m", "millfrf", *ACQUIRE]
    process = subprocess.Popen(words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    path, end = folder / "rec.h5", time.monotonic() + 60
    while time.monotonic() < end:
        if path.exists():
            with Recording(path) as recording:
                if recording.stream().n_samples:
                    return process
        time.sleep(0.05)
    raise AssertionError(process.communicate())


def test_no_command_replaces_a_running_recording(
    inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Before: exit 0, and the recorder said "wrote rec.h5" of the other data."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(inputs, tmp_path, dirs_exist_ok=True)
    process = _running(tmp_path, 8.0)
    busy = "millfrf: rec.h5 is being written by another program; choose another name or wait for it\n"
    for words in (
        ["convert", "up.h5", "rec.h5"],
        ["convert", "frf_tip.uff" if Path("frf_tip.uff").exists() else "given.uff", "rec.h5"],
        ["estimate", "up.h5", "down.h5", "central.h5", "--segment", "4", "--out", "rec.h5"],
        ["recover", "killed.h5", "--out", "rec.h5"],
        ["acquire", "s.toml", "--out", "rec.h5"],
        ["predict", "model_tip.json", "steady.h5", "--out", "rec.h5"],
    ):
        assert run([*words, "--force"]) == 2, words
        assert capsys.readouterr().err == busy, words
    out, complaints = process.communicate(timeout=60)
    assert (process.returncode, complaints) == (0, "")
    assert "wrote rec.h5" in out
    with Recording(tmp_path / "rec.h5") as recording:
        np.testing.assert_array_equal(recording.stream().read()[:, 0], np.arange(80_000))
    assert run(["convert", "up.h5", "rec.h5", "--force"]) == 0


def _removed(path: Path) -> None:
    path.unlink()


def _replaced(path: Path) -> None:
    other = path.with_name("other")
    other.write_text(OLD)
    other.replace(path)


def _moved(path: Path) -> None:
    path.rename(path.with_name("moved.h5"))


@pytest.mark.parametrize("action", [_removed, _replaced, _moved])
def test_a_recording_that_is_taken_away_is_saved_and_said(action: Callable[[Path], None], tmp_path: Path) -> None:
    """Before: "wrote rec.h5", though no such file was there."""
    process = _running(tmp_path, 3.0)
    action(tmp_path / "rec.h5")
    out, complaints = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "wrote" not in out
    cause = "millfrf: rec.h5 was removed or replaced by another program while it was recorded; the recording"
    kept = "moved.h5" if action is _moved else "rec.saved.h5"
    assert complaints == f"{cause} {'has another name now' if action is _moved else f'was saved as {kept}'}\n"
    with Recording(tmp_path / kept) as recording:
        np.testing.assert_array_equal(recording.stream().read()[:, 0], np.arange(30_000))
    assert (tmp_path / "rec.h5").exists() is (action is _replaced)


def test_a_reader_does_not_keep_a_recording_from_being_replaced(tmp_path: Path) -> None:
    _session(tmp_path, 1000, 1.0)
    with Recording(tmp_path / "whole.h5"):
        assert run(["convert", str(tmp_path / "whole.h5"), str(tmp_path / "copy.h5")]) == 0
        with Recording(tmp_path / "copy.h5"):
            assert run(["convert", str(tmp_path / "whole.h5"), str(tmp_path / "copy.h5"), "--force"]) == 0
