"""Recordings survive: kill -9 at random moments, a full disk, a second writer; `recover` brings everything back."""

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest

from acquisition import Channel, Recording, RecordingWriter, StreamDescription, recover
from millfrf.command_line import run
from millfrf.core import FileFormatError, InputError

STREAM = StreamDescription("main", 1000.0, 0.0, (Channel("fx", "force", "N"),))
WRITERS = Path(__file__).with_name("killed_writers.py")
posix = pytest.mark.skipif(os.name != "posix", reason="needs fork and signals")


class Killer:
    """Has writers started, kills each after a while, and says what it had acknowledged."""

    def __init__(self) -> None:
        pipe = subprocess.PIPE
        self._starter = subprocess.Popen([sys.executable, str(WRITERS)], stdin=pipe, stdout=pipe, text=True)
        assert self._starter.stdout is not None
        self._starter.stdout.readline()

    def kill_after(self, seconds: float, path: Path, seed: int) -> int:
        assert self._starter.stdin is not None
        assert self._starter.stdout is not None
        self._starter.stdin.write(f"{path}\t{seed}\n")
        self._starter.stdin.flush()
        acknowledged, killed = 0, False
        for line in self._starter.stdout:
            if line.startswith("end"):
                return acknowledged
            if line.startswith("pid"):
                child = int(line.split()[1])
            else:
                acknowledged = int(line)
            if not killed and acknowledged:  # its first block is there: the file is open
                time.sleep(seconds)
                os.kill(child, signal.SIGKILL)
                killed = True
        raise AssertionError("the starter of the writers ended")

    def close(self) -> None:
        self._starter.communicate()


@pytest.fixture
def killer() -> Iterator[Killer]:
    killer = Killer()
    yield killer
    killer.close()


def _kill_and_recover(killer: Killer, folder: Path, seed: int) -> None:
    path = folder / f"{seed}.h5"
    acknowledged = killer.kill_after(random.Random(seed).uniform(0.0, 0.12), path, seed)
    back = recover(path)
    assert back.lost == {"one": 0, "two": 0}
    with Recording(back.path) as recording, h5py.File(back.path) as plain:
        assert recording.complete is False
        assert "recovered" in recording.ending
        assert plain["signals/one/samples"].shape[0] == back.samples["one"]
        for rate, name in ((1, "one"), (2, "two")):
            rows = recording.stream(name).read()
            assert len(rows) >= acknowledged
            np.testing.assert_array_equal(rows, np.arange(len(rows))[:, None] * rate + np.arange(3))
            assert recording.clock_pairs(name)[:, 0].max() >= acknowledged
        times, values, _ = recording.events["speed"].read_raw()
        assert times[-1] >= acknowledged
        np.testing.assert_array_equal(values, 2 * times)
        marks = recording.events["mark"]
        assert marks.read_raw()[0][-1] >= acknowledged
        assert marks.read_texts() == tuple(f"at {time:.0f}" for time in marks.read_raw()[0])
    path.unlink()
    back.path.unlink()


@posix
def test_ten_kills_lose_nothing_acknowledged(killer: Killer, tmp_path: Path) -> None:
    for seed in range(10):
        _kill_and_recover(killer, tmp_path, seed)


@posix
@pytest.mark.slow
def test_three_hundred_kills_lose_nothing_acknowledged(killer: Killer, tmp_path: Path) -> None:
    for seed in range(100, 400):
        _kill_and_recover(killer, tmp_path, seed)


FULL = """
import sys, numpy as np
from acquisition import Channel, RecordingWriter, StreamDescription
from millfrf.core import DiskFull
stream = StreamDescription("main", 1000.0, 0.0, (Channel("fx", "force", "N"),))
kept = 0
try:
    with RecordingWriter(sys.argv[1], [stream], event_names=["speed"], spare_bytes=500_000) as writer:
        while True:
            writer.append("main", np.full((1000, 1), float(kept)))
            kept += 1
            writer.append_event("speed", kept, kept)
except DiskFull as error:
    print(kept, error)
"""


def _in_small_file_system(program: str, folder: Path) -> subprocess.CompletedProcess[str]:
    script = f'mount -t tmpfs -o size=3m none "{folder}" && "$0" -c "$1" "{folder}/a.h5" && cp "{folder}/a.h5" "$2"'
    command = ["unshare", "-rm", "sh", "-c", script, sys.executable, program, str(folder.parent / "kept.h5")]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        pytest.skip("no unshare: a small file system cannot be mounted")


def test_a_full_disk_ends_the_recording_with_a_closed_file_and_one_line(tmp_path: Path) -> None:
    small = tmp_path / "small"
    small.mkdir()
    done = _in_small_file_system(FULL, small)
    if "mount" in done.stderr or "unshare" in done.stderr:
        pytest.skip(f"a small file system cannot be mounted here: {done.stderr.strip()}")
    assert done.returncode == 0, done.stderr
    kept, line = done.stdout.split(maxsplit=1)
    assert done.stderr == ""
    assert line.startswith("the disk of ")
    assert line.count("\n") == 1
    with h5py.File(tmp_path / "kept.h5"), Recording(tmp_path / "kept.h5") as recording:
        assert recording.complete is False
        assert recording.ending.startswith("DiskFull: the disk of")
        assert int(kept) > 400
        np.testing.assert_array_equal(recording.stream().read()[::1000, 0], np.arange(int(kept)))


@posix
def test_a_file_that_may_not_grow_is_recovered(tmp_path: Path) -> None:
    limited = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000, 1_000_000))\n"
    path = tmp_path / "a.h5"
    done = subprocess.run([sys.executable, "-c", limited + FULL, str(path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    kept, line = done.stdout.split(maxsplit=1)
    assert f"save what is there onto another disk: millfrf recover {path} --out " in line
    for file in (path, recover(path).path):  # as a killed writer leaves it, it can be read at once
        with Recording(file) as recording:
            assert recording.complete is False
            rows = recording.stream().read()[:, 0]
        assert len(rows) >= 1000 * int(kept) > 100_000
        np.testing.assert_array_equal(rows, np.arange(len(rows)) // 1000)


def test_too_little_room_is_said_before_recording(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="free; make room first"):
        RecordingWriter(tmp_path / "a.h5", [STREAM], spare_bytes=1 << 60)
    assert not list(tmp_path.iterdir())


def test_a_file_cut_by_a_power_failure_gives_back_its_whole_chunks(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    program = f"""
import os, numpy as np
from acquisition import Channel, RecordingWriter, StreamDescription
stream = StreamDescription("main", 1000.0, 0.0, (Channel("fx", "force", "N"),))
writer = RecordingWriter({str(path)!r}, [stream], block_length=500)
for k in range(200):
    writer.append("main", np.full((1000, 1), float(k)))
os._exit(9)
"""
    subprocess.run([sys.executable, "-c", program], check=False)
    os.truncate(path, int(path.stat().st_size * 0.97))
    with pytest.raises(FileFormatError, match="millfrf recover"):
        Recording(path)
    back = recover(path)
    assert 0 < back.lost["main"] < 20_000
    with Recording(back.path) as recording:
        rows = recording.stream().read()[:, 0]
    assert len(rows) == 200_000 - back.lost["main"]
    np.testing.assert_array_equal(rows, np.arange(len(rows)) // 1000)


def test_nothing_else_may_write_or_recover_while_a_writer_lives(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with RecordingWriter(path, [STREAM]) as writer:
        writer.append("main", np.ones((10, 1)))
        with pytest.raises(InputError, match="being written by another program"):
            RecordingWriter(path, [STREAM], overwrite=True)
        with pytest.raises(InputError, match="still being written"):
            recover(path)
        writer.append("main", np.ones((10, 1)))
    with Recording(path) as recording:
        assert recording.stream().n_samples == 20
    with pytest.raises(InputError, match="nothing to recover"):
        recover(path)
    assert [file.name for file in tmp_path.iterdir()] == ["a.h5"]


@posix
def test_the_command_recovers_and_says_what(killer: Killer, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.h5"
    killer.kill_after(0.02, path, 1)
    assert run(["recover", str(path)]) == 0
    assert "a.recovered.h5" in capsys.readouterr().out
    assert run(["recover", str(path)]) == 0
    assert "a.recovered-2.h5" in capsys.readouterr().out
    assert run(["recover", str(path), "--out", str(tmp_path / "a.recovered.h5")]) == 2
    assert "exists; replace it with --force" in capsys.readouterr().err
    assert run(["recover", str(tmp_path / "none.h5")]) == 2
