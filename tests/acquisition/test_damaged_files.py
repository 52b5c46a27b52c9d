"""Truncated and bit-flipped files of every kind: understood or refused in one line; no traceback, no hang, no memory.

Each damaged file is opened by the command line in a process whose memory is limited, many files a process.
"""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat, wavfile

from acquisition import HOST_AXIS, Channel, Events, Recording, RecordingWriter, StreamDescription

OPENER = """
import io, resource, sys, contextlib, pathlib, faulthandler
faulthandler.enable()
from millfrf.__main__ import run
import acquisition.conversion.convert, acquisition.conversion.can_log, millfrf.inspection  # before memory is counted
import scipy.io.wavfile, pyuff, nptdms, can.io, cantools, scipy.signal
resource.setrlimit(resource.RLIMIT_AS, (6_000_000_000, 6_000_000_000))
command, map_file, *files = sys.argv[1:]
for file in files:
    arguments = [command, file]
    if command == "convert":
        arguments += [file + ".out.h5"] + (["--map", map_file] if map_file else [])
    faulthandler.dump_traceback_later(20, exit=True)
    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
        code = run(arguments)
    lines = [line for line in said.getvalue().splitlines() if line.startswith("millfrf:")]
    if code not in (0, 2) or (code == 2 and len(lines) != 1) or "unexpected" in said.getvalue():
        print(pathlib.Path(file).name, code, said.getvalue())
"""
CHANNEL_MAP = """sample_rate = 100.0
[[channels]]
name = "fx"
quantity = "force"
unit = "N"
column = 1
"""
WITH_OWN_RATE = CHANNEL_MAP.replace("sample_rate = 100.0\n", "")
SAMPLES = np.random.default_rng(0).standard_normal((200, 2))


def _recording(path: Path, *, killed: bool = False) -> None:
    channels = (Channel("fx", "force", "N", "TCP", "+X"), Channel("ax", "acceleration", "m/s^2", "TCP", "+X"))
    stream = StreamDescription("main", 100.0, 0.0, channels)
    whole = path.with_name("whole.h5")
    with RecordingWriter(whole, [stream], block_length=64, event_axes={"speed": HOST_AXIS}) as writer:
        for k in range(4):
            writer.append("main", SAMPLES[50 * k : 50 * k + 50])
            writer.append_clock_pair("main", 50 * k + 50, 0.5 * k)
            writer.append_events(Events("speed", np.array([0.5 * k]), np.array([1.0])))
        if killed:
            path.write_bytes(whole.read_bytes())
    if not killed:
        path.write_bytes(whole.read_bytes())


def _wav(path: Path) -> None:
    wavfile.write(path, 100, (1000 * SAMPLES).astype(np.int16))


def _csv(path: Path) -> None:
    path.write_text("t,f,a\n" + "\n".join(f"{k / 100},{x:.5f},{y:.5f}" for k, (x, y) in enumerate(SAMPLES)))


def _uff(path: Path) -> None:
    pyuff = pytest.importorskip("pyuff")
    common = {"type": 58, "func_type": 1, "ref_node": 0, "ref_dir": 0, "rsp_node": 1, "rsp_dir": 1, "binary": 0}
    axis = {"abscissa_spacing": 1, "abscissa_inc": 0.01, "abscissa_min": 0.0, "x": np.arange(200) / 100}
    names = {f"id{k}": "none" for k in range(1, 6)}
    kinds = {"ordinate_spec_data_type": 8, "abscissa_spec_data_type": 17, "orddenom_spec_data_type": 0}
    pyuff.UFF(str(path)).write_sets(
        {**common, **axis, **names, **kinds, "data": SAMPLES[:, 0], "ord_data_type": 4}, "add"
    )


def _can(path: Path) -> None:
    can = pytest.importorskip("can")
    pytest.importorskip("cantools")
    _recording(path.with_name("rec.h5"))
    path.with_name("cell.dbc").write_text(
        'VERSION ""\nBU_: PLC\nBO_ 256 Spindle: 8 PLC\n SG_ Speed : 0|16@1+ (1,0) [0|1] "" PLC\n'
    )
    with can.Logger(path) as writer:
        for k in range(30):
            writer(can.Message(1.7e9 + 0.1 * k, 256, is_extended_id=False, data=bytes([k] * 8), channel=0))


def _npz(path: Path) -> None:
    np.savez(path, x=SAMPLES)


def _mat(path: Path) -> None:
    savemat(path, {"x": SAMPLES})


LOG_MAP = 'recording = "rec.h5"\ndbc = "cell.dbc"\nsignals = [{signal = "Speed"}]\n'
KINDS = {
    "recording": ("inspect", ".h5", "", _recording),
    "killed recording": ("inspect", ".h5", "", lambda path: _recording(path, killed=True)),
    "recovered": ("recover", ".h5", "", lambda path: _recording(path, killed=True)),
    "wav": ("convert", ".wav", WITH_OWN_RATE, _wav),
    "csv": ("convert", ".csv", CHANNEL_MAP, _csv),
    "uff": ("convert", ".uff", WITH_OWN_RATE, _uff),
    "npz": ("convert", ".npz", CHANNEL_MAP, _npz),
    "mat": ("convert", ".mat", CHANNEL_MAP, _mat),
    "blf": ("convert", ".blf", LOG_MAP, _can),
    "asc": ("convert", ".asc", LOG_MAP, _can),
}


def _damaged(whole: bytes, number: int) -> bytes:
    """Cut short, one bit flipped, some bytes overwritten, or a piece left out, in turn."""
    generator = np.random.default_rng(number)
    at = int(generator.integers(0, len(whole)))
    early = int(generator.integers(0, min(len(whole), 400)))  # headers are where it hurts
    spot = early if number % 2 else at
    if number % 4 == 0:
        return whole[:at]
    changed = bytearray(whole)
    if number % 4 in (1, 2):
        changed[spot] ^= 1 << int(generator.integers(0, 8))
    elif number % 8 == 3:
        changed[spot : spot + 8] = generator.bytes(8)
    else:
        del changed[spot : spot + int(generator.integers(1, 40))]
    return bytes(changed)


def _open_all(folder: Path, kind: str, numbers: range) -> None:
    command, suffix, mapping, make = KINDS[kind]
    whole = folder / f"good{suffix}"
    make(whole)
    (folder / "map.toml").write_text(mapping)
    files = []
    for number in numbers:
        files.append(folder / f"{number}{suffix}")
        files[-1].write_bytes(_damaged(whole.read_bytes(), number))
    arguments = [command, str(folder / "map.toml") if mapping else "", str(whole), *map(str, files)]
    done = subprocess.run([sys.executable, "-c", OPENER, *arguments], capture_output=True, text=True, timeout=500)
    assert (done.stdout, done.returncode) == ("", 0), done.stdout + done.stderr[-3000:]


@pytest.mark.skipif(sys.platform != "linux", reason="limits memory as Linux does")
@pytest.mark.parametrize("kind", list(KINDS))
def test_damaged_files_are_understood_or_refused(tmp_path: Path, kind: str) -> None:
    _open_all(tmp_path, kind, range(40))


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="limits memory as Linux does")
@pytest.mark.parametrize("kind", list(KINDS))
def test_many_damaged_files_are_understood_or_refused(tmp_path: Path, kind: str) -> None:
    _open_all(tmp_path, kind, range(40, 640))


def test_the_undamaged_files_are_good(tmp_path: Path) -> None:
    _recording(tmp_path / "a.h5")
    with Recording(tmp_path / "a.h5") as recording:
        np.testing.assert_allclose(recording.stream().read(), SAMPLES, rtol=1e-6, atol=1e-6)
