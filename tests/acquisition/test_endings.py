"""Whatever ends `millfrf acquire` early: one line with the device and the remedy, and a closed file that says why."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from acquisition import Channel, Recording, RecordingWriter, StreamDescription
from millfrf.command_line import run
from millfrf.core import MillfrfError
from millfrf.steps.convert import convert_files
from millfrf.steps.recording.acquire import open_session, record_session

RunWithDaqmx = Callable[..., subprocess.CompletedProcess[str]]
SESSION = """
[device]
driver = "ni"
sample_rate_hz = 25600
timeout_s = 0.2
buffer_s = 0.3
[[channels]]
name = "fx"
quantity = "force"
unit = "N"
terminal = "cDAQ1Mod1/ai0"
units_per_volt = 100
"""
ENDINGS = """
import os, signal, sys, time
from millfrf.command_line import run

def acquire(name):
    print(name, run(["acquire", "s.toml", "--out", name + ".h5"]))
    print("end of", name, file=sys.stderr, flush=True)

os.environ["SIM_DAQMX_FAIL_AT"] = "9000"
os.environ["SIM_DAQMX_FAIL_CODE"] = "-201003"
acquire("gone")
os.environ["SIM_DAQMX_FAIL_CODE"] = "-200284"
acquire("silent")
del os.environ["SIM_DAQMX_FAIL_AT"]
recorder = os.getpid()
if os.fork() == 0:
    while not os.path.exists("late.h5") or os.path.getsize("late.h5") < 40_000:
        time.sleep(0.05)
    os.kill(recorder, signal.SIGSTOP)
    time.sleep(1.0)
    os.kill(recorder, signal.SIGCONT)
    os._exit(0)
acquire("late")
sys.modules["nidaqmx"] = None
acquire("missing")
"""
SAID = {
    "gone": "cDAQ1Mod1: the device is gone; check its plug and its power, then start again; gone.h5 holds the 0.30 s",
    "silent": "cDAQ1Mod1: no samples came in time; check the sample clock and the chassis; silent.h5 holds the 0.30 s",
    "late": "cDAQ1Mod1: samples were lost, the computer did not keep up; close other programs; ",
    "missing": "cDAQ1Mod1: the package nidaqmx is not installed; install NI-DAQmx from ni.com",
}
KINDS = {"gone": "Disconnected", "silent": "DeviceTimeout", "late": "Overrun"}


@pytest.mark.long
def test_a_failing_device_is_one_line_and_a_closed_file(with_daqmx: RunWithDaqmx, tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(SESSION)
    done = with_daqmx(ENDINGS)
    assert done.returncode == 0, done.stderr
    assert [line for line in done.stdout.splitlines() if not line.startswith("stream")] == [f"{n} 1" for n in SAID]
    lines = [line for line in done.stderr.splitlines() if line.strip()]
    assert len(lines) == 2 * len(SAID), done.stderr
    for (name, words), line, end in zip(SAID.items(), lines[::2], lines[1::2], strict=True):
        assert line.startswith(f"millfrf: {words}")
        assert end == f"end of {name}"
    assert int(lines[4].split(" samples a channel are missing after sample ")[0].split()[-1]) > 10_000
    for name, kind in KINDS.items():
        with h5py.File(tmp_path / f"{name}.h5"), Recording(tmp_path / f"{name}.h5") as recording:
            assert recording.complete is False
            assert recording.ending.startswith(f"{kind}: cDAQ1Mod1: ")
            rows = recording.stream().read()[:, 0]
        np.testing.assert_allclose(rows, 100.0 * (np.arange(len(rows)) % 65536) / 16384, rtol=1e-6)
        assert len(rows) == 7680 if name != "late" else len(rows) >= 2560
    assert not (tmp_path / "missing.h5").exists()


def _replayed(folder: Path, n_samples: int) -> Path:
    stream = StreamDescription("main", 1000.0, 0.0, (Channel("fx", "force", "N"),))
    with RecordingWriter(folder / "whole.h5", [stream]) as writer:
        writer.append("main", np.arange(float(n_samples))[:, None])
    session = folder / "s.toml"
    session.write_text('[device]\ndriver = "replay"\nfile = "whole.h5"\nspeed = 1e9\n')
    return session


@pytest.mark.long
def test_a_full_disk_is_one_line_and_a_closed_file(tmp_path: Path) -> None:
    session, small = _replayed(tmp_path, 2_000_000), tmp_path / "small"
    small.mkdir()
    script = 'mount -t tmpfs -o size=20m none "$1" && "$0" -m millfrf acquire "$2" --out "$1/a.h5"; code=$?; '
    script += 'cp "$1/a.h5" "$3" && exit $code'
    arguments = [sys.executable, str(small), str(session), str(tmp_path / "kept.h5")]
    try:
        done = subprocess.run(["unshare", "-rm", "sh", "-c", script, *arguments], capture_output=True, text=True)
    except FileNotFoundError:
        pytest.skip("no unshare: a small file system cannot be mounted")
    if "mount" in done.stderr or "unshare" in done.stderr:
        pytest.skip(f"a small file system cannot be mounted here: {done.stderr.strip()}")
    assert done.returncode == 1
    [line] = done.stderr.splitlines()
    assert line.startswith("millfrf: the disk of ")
    assert "make room for the next one; " in line
    with h5py.File(tmp_path / "kept.h5"), Recording(tmp_path / "kept.h5") as recording:
        assert recording.complete is False
        assert recording.ending.startswith("DiskFull: ")
        rows = recording.stream().read()[:, 0]
    assert 400_000 < len(rows) < 2_000_000
    np.testing.assert_array_equal(rows, np.arange(len(rows)))


def test_a_second_writer_is_refused_and_the_first_goes_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    session, out = _replayed(tmp_path, 3000), tmp_path / "a.h5"

    def second(block: object) -> None:
        assert run(["acquire", str(session), "--out", str(out)]) == 2
        assert run(["acquire", str(session), "--out", str(out), "--force"]) == 2
        assert run(["inspect", str(out)]) == 0
        assert run(["recover", str(out)]) == 2

    tally = record_session(open_session(session), out, watchers=[second])
    assert tally.samples == {"main": 3000}
    said, complained = capsys.readouterr()
    refused, forced, unneeded = complained.splitlines()
    assert refused.endswith("a.h5 exists; replace it with --force, or choose another name")
    assert "a.h5" in forced
    assert "written" in forced
    assert "warning: the recording is still being written" in said
    assert unneeded.endswith("is still being written; stop its writer first")
    with Recording(out) as recording:
        assert (recording.complete, recording.stream().n_samples) == (True, 3000)


def test_recording_and_conversion_report_the_samples_written(tmp_path: Path) -> None:
    counts: dict[str, list[int]] = {"recorded": [], "converted": []}
    record_session(open_session(_replayed(tmp_path, 9000)), tmp_path / "a.h5", progress=counts["recorded"].append)
    convert_files([tmp_path / "a.h5"], tmp_path / "b.csv", None, counts["converted"].append)
    for count in counts.values():
        assert count[-1] == 9000
        assert np.all(np.diff([0, *count]) > 0)


@pytest.mark.skipif(os.name != "posix", reason="needs signals")
def test_a_second_ctrl_c_ends_at_once_and_says_what_is_kept(tmp_path: Path) -> None:
    import signal

    def impatient(block: object) -> None:
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)

    with pytest.raises(MillfrfError, match=r"stopped at once; .*a\.h5 holds the 4\.10 s before"):
        record_session(open_session(_replayed(tmp_path, 9000)), tmp_path / "a.h5", watchers=[impatient])
    with Recording(tmp_path / "a.h5") as recording:
        assert (recording.complete, recording.stream().n_samples) == (False, 4096)
        assert recording.ending.startswith("KeyboardInterrupt")
