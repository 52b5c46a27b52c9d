"""Truncated and bit-flipped files of every kind: understood or refused in one line; no traceback, no hang, no memory.

Each damaged file is opened by the command line in a process that may take 64 MB and eight times the file's size more
than it had before.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat, wavfile
from scipy.sparse import coo_array

from acquisition import HOST_AXIS, Channel, Events, Recording, RecordingWriter, StreamDescription, open_arrays
from acquisition.recordings import guarded_reading
from acquisition.settings import SETTINGS
from estimation import write_frf_uff
from millfrf.core import FileFormatError
from modal_fit import write_modes_uff
from replay_data import table_one_model

OPENER = """
import contextlib, faulthandler, io, json, os, pathlib, resource, sys
faulthandler.enable()
from millfrf.command_line import run

def open_file(group, file):
    arguments = [group["command"], file]
    if group["command"] == "convert":
        arguments += [file + group["target"]] + (["--map", group["map"]] if group["map"] else [])
    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
        code = run(arguments)
    return code, said.getvalue()

for group in json.load(sys.stdin):
    good, *files = group["files"]
    code, said = open_file(group, good)  # also imports what this kind needs, before memory is counted
    if code:
        print(good, "is not good:", code, said)
    for file in files:
        used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
        most = used + 64_000_000 + 8 * os.path.getsize(file)
        resource.setrlimit(resource.RLIMIT_AS, (most, resource.RLIM_INFINITY))
        faulthandler.dump_traceback_later(60, exit=True)
        code, said = open_file(group, file)
        resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        lines = said.splitlines()
        if code not in (0, 2) or (code == 2 and len(lines) != 1) or "unexpected" in said:
            print(file, code, said[-500:])
"""
CHANNEL_MAP = """sample_rate = 100.0
[[channels]]
name = "fx"
quantity = "force"
unit = "N"
column = 1
"""
ARRAY_MAP = CHANNEL_MAP.replace("column", 'array = "x"\ncolumn')
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


def _npy(path: Path) -> None:
    np.save(path, SAMPLES)


def _uff_frf(path: Path) -> None:
    pytest.importorskip("pyuff")
    write_frf_uff(path, table_one_model().frf(np.arange(1.0, 20.0, 0.5)))


def _uff_geometry(path: Path) -> None:
    pyuff = pytest.importorskip("pyuff")
    rows = np.arange(6.0)
    nodes = {"type": 15, "node_nums": rows + 1, "def_cs": 0 * rows, "disp_cs": 0 * rows + 3, "color": 0 * rows}
    matrix = np.vstack([np.eye(3), np.zeros(3)])
    systems = {"type": 2420, "CS_sys_labels": [3], "CS_types": [1], "CS_colors": [1], "CS_names": ["C"]}
    lines = {"type": 82, "trace_num": 1, "n_nodes": 4, "color": 1, "id": "T", "nodes": np.array([1, 2, 0, 5])}
    sets = [systems | {"CS_matrices": [matrix]}, nodes | {"x": rows + 1, "y": rows, "z": rows**2}, lines]
    pyuff.UFF(str(path)).write_sets(sets, "add")


def _frf_text(path: Path) -> None:
    frf = table_one_model().frf(np.arange(1.0, 20.0, 0.5))
    rows = (f"{f:.5f}\t{h.real:.7e}\t{h.imag:.7e}" for f, h in zip(frf.frequencies, frf.values[:, 0, 0], strict=True))
    path.write_text("Analyser\n\nFrequency\tReal\tImaginary\nHz\tm/N\tm/N\n" + "\n".join(rows) + "\n")


def _frf_mat(path: Path) -> None:
    frf = table_one_model().frf(np.arange(1.0, 20.0, 0.5))
    savemat(path, {"f": frf.frequencies, "H": frf.values[:, 0, 0]}, do_compression=True)


def _mat(path: Path) -> None:
    savemat(path, {"x": SAMPLES})


def _mat_of_all_kinds(path: Path, *, compressed: bool = False) -> None:
    cell = np.empty(3, dtype=object)
    cell[:] = [SAMPLES[:3], "text", np.arange(4, dtype=np.int16)]
    nested = {"gain": 2.0, "name": "Kanäle", "inner": {"list": cell, "flags": np.array([True, False])}}
    sparse = coo_array(([1.0, 2.0], ([0, 3], [1, 2])), shape=(5, 4))
    content = {"x": SAMPLES, "s": nested, "c": cell, "z": SAMPLES[:4, 0] + 1j, "sparse": sparse, "t": "some text"}
    savemat(path, content, do_compression=compressed)


def _hdf5(path: Path) -> None:
    """As MATLAB's version 7.3 and other programs write: old superblock, text of any length, compressed chunks."""
    with h5py.File(path, "w") as file:
        file.create_dataset("x", data=SAMPLES, chunks=(50, 2), compression="gzip")
        file["notes"] = ["one", "two", "three"]
        file["deep/er/y"] = SAMPLES[:, 0]
        file.attrs["title"] = "text of any length"
        file["x"].attrs["MATLAB_class"] = np.bytes_(b"double")


def _mat73(path: Path) -> None:
    _hdf5(path)
    with h5py.File(path, "a") as file:
        file["x2"] = file["x"][:].T
        del file["x"]
        file["x"] = file["x2"][:]


def _tdms(path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    properties = {"wf_increment": 0.01, "unit_string": "N"}
    with nptdms.TdmsWriter(path) as writer:
        for part in (slice(0, 100), slice(100, None)):
            writer.write_segment([nptdms.ChannelObject("g", "x", SAMPLES[part, 0], properties=properties)])


def _recording_of_others(path: Path) -> None:
    """As a lab's own script writes it: text of any length, contiguous samples."""
    with h5py.File(path, "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "millfrf.recording", 1
        file.attrs["title"], file.attrs["setup"] = "a title", "[tool]\nteeth = 2\n"
        group = file.create_group("signals/main")
        group.attrs["sample_rate"], group.attrs["start_time"] = 100.0, 0.0
        group.attrs["channels"] = '[{"name": "fx", "quantity": "force", "unit": "N"}]'
        group["samples"] = SAMPLES[:, :1].astype("f4")
        file["events/speed/time"], file["events/speed/value"] = [0.5, 1.0], [6000.0, 6001.0]


FRF_MAP = '[frf]\nresponses = ["TCP:+X"]\nexcitations = ["TCP:+X"]\n'
TARGETS = {"uff modes": ".out.json", "uff geometry": ".out.toml"}
LOG_MAP = 'recording = "rec.h5"\ndbc = "cell.dbc"\nsignals = [{signal = "Speed"}]\n'
GUARDED = ("mat of all kinds", "mat compressed", "mat 7.3", "hdf5", "recording of others")
KINDS = {
    "recording": ("inspect", ".h5", "", _recording),
    "killed recording": ("inspect", ".h5", "", lambda path: _recording(path, killed=True)),
    "recovered": ("recover", ".h5", "", lambda path: _recording(path, killed=True)),
    "wav": ("convert", ".wav", WITH_OWN_RATE, _wav),
    "csv": ("convert", ".csv", CHANNEL_MAP, _csv),
    "uff": ("convert", ".uff", WITH_OWN_RATE, _uff),
    "uff frf": ("convert", ".uff", "", _uff_frf),
    "uff modes": ("convert", ".uff", "", lambda path: write_modes_uff(path, table_one_model())),
    "uff geometry": ("convert", ".unv", "", _uff_geometry),
    "frf text": ("convert", ".txt", FRF_MAP, _frf_text),
    "frf mat": ("convert", ".mat", FRF_MAP + 'unit = "m/N"', _frf_mat),
    "npy": ("convert", ".npy", CHANNEL_MAP, _npy),
    "npz": ("convert", ".npz", CHANNEL_MAP, _npz),
    "mat": ("convert", ".mat", CHANNEL_MAP, _mat),
    "mat of all kinds": ("convert", ".mat", ARRAY_MAP, _mat_of_all_kinds),
    "mat compressed": ("convert", ".mat", ARRAY_MAP, lambda path: _mat_of_all_kinds(path, compressed=True)),
    "mat 7.3": ("convert", ".mat", "axes = ['channel', 'sample']\n" + ARRAY_MAP, _mat73),
    "hdf5": ("convert", ".h5", ARRAY_MAP, _hdf5),
    "recording of others": ("inspect", ".h5", "", _recording_of_others),
    "tdms": ("convert", ".tdms", CHANNEL_MAP, _tdms),
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


def _open_all(folder: Path, numbers: Mapping[str, range]) -> None:
    groups = []
    for kind, chosen in numbers.items():
        command, suffix, mapping, make = KINDS[kind]
        own = folder / kind.replace(" ", "-")
        own.mkdir()
        whole = own / f"good{suffix}"
        make(whole)
        (own / "map.toml").write_text(mapping)
        files = [own / f"{number}{suffix}" for number in chosen]
        for number, file in zip(chosen, files, strict=True):
            file.write_bytes(_damaged(whole.read_bytes(), number))
        named = [str(file) for file in (whole, *files)]
        group = {"command": command, "map": str(own / "map.toml") if mapping else "", "files": named}
        groups.append(group | {"target": TARGETS.get(kind, ".out.h5")})
    environment = {**os.environ, "MALLOC_ARENA_MAX": "1"}
    done = subprocess.run(
        [sys.executable, "-c", OPENER], input=json.dumps(groups), env=environment, capture_output=True, text=True
    )
    assert (done.stdout, done.returncode) == ("", 0), done.stdout + done.stderr[-3000:]


IMPATIENT = replace(SETTINGS, reading_time=0.5)
needs_linux = pytest.mark.skipif(sys.platform != "linux", reason="limits memory as Linux does")


@pytest.mark.long
@needs_linux
def test_damaged_files_are_understood_or_refused(tmp_path: Path) -> None:
    few = {"hdf5": range(3), "mat of all kinds": range(3)}  # each file in a process of its own
    few |= dict.fromkeys(("npy", "tdms", "uff frf"), range(16))
    _open_all(tmp_path, {kind: range(40) for kind in KINDS if kind not in GUARDED and kind not in few} | few)


@pytest.mark.slow
@needs_linux
@pytest.mark.parametrize("kind", list(KINDS))
def test_many_damaged_files_are_understood_or_refused(tmp_path: Path, kind: str) -> None:
    _open_all(tmp_path, {kind: range(100) if kind in GUARDED else range(40, 640)})


@pytest.mark.parametrize(
    ("program", "words"),
    [
        ("import os; os.abort()", "reading it crashes or does not come to an end"),
        ("import time; time.sleep(60)", "reading it does not come to an end"),
        ("import sys; print('line one', 'the heap is broken', sep='\\n', file=sys.stderr); sys.exit(3)", "the heap is"),
    ],
)
def test_whatever_befalls_the_reading_child_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, program: str, words: str
) -> None:
    (tmp_path / "child.py").write_text(program)
    monkeypatch.setattr(guarded_reading, "_CHILD", tmp_path / "child.py")
    monkeypatch.setattr(guarded_reading, "SETTINGS", IMPATIENT)
    _hdf5(tmp_path / "a.h5")
    with pytest.raises(FileFormatError, match=words) as caught:
        open_arrays(tmp_path / "a.h5")
    assert "\n" not in str(caught.value)


@needs_linux
@pytest.mark.parametrize(
    ("attempt", "words"),
    [
        (lambda *_: os.abort(), "reading it crashes or does not come to an end"),
        (lambda *_: time.sleep(60), "reading it does not come to an end"),
        (lambda *_: "the heap is broken", "damaged: the heap is broken; take a copy"),
    ],
)
def test_whatever_befalls_a_copy_of_the_process_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, attempt: Callable[..., str], words: str
) -> None:
    monkeypatch.setattr(guarded_reading, "attempt", attempt)
    monkeypatch.setattr(guarded_reading, "_can_fork", lambda: True)  # also if an earlier test left a thread
    monkeypatch.setattr(guarded_reading, "SETTINGS", IMPATIENT)
    _hdf5(tmp_path / "a.h5")
    with pytest.raises(FileFormatError, match=words) as caught:
        guarded_reading.check_in_child(tmp_path / "a.h5")
    assert "\n" not in str(caught.value)


@needs_linux
@pytest.mark.parametrize("alone", [True, False])
def test_a_copy_and_a_new_process_judge_a_file_alike(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, alone: bool
) -> None:
    monkeypatch.setattr(guarded_reading, "_can_fork", lambda: alone)
    _recording_of_others(tmp_path / "a.h5")
    guarded_reading.check_in_child(tmp_path / "a.h5")
    heap = bytearray((tmp_path / "a.h5").read_bytes())
    heap[heap.index(b"GCOL") + 88] ^= 64  # leads the library in a circle; the limit of time ends it
    (tmp_path / "a.h5").write_bytes(heap)
    monkeypatch.setattr(guarded_reading, "SETTINGS", IMPATIENT)
    with pytest.raises(FileFormatError, match="does not come to an end"):
        guarded_reading.check_in_child(tmp_path / "a.h5")


@pytest.mark.slow
@needs_linux
def test_a_heap_that_leads_in_a_circle_and_a_tag_that_ends_python_are_refused(tmp_path: Path) -> None:
    """Single flipped bits: the first made the HDF5 library search for ever, the others made scipy crash."""
    _recording_of_others(tmp_path / "a.h5")
    heap = bytearray((tmp_path / "a.h5").read_bytes())
    heap[heap.index(b"GCOL") + 88] ^= 64
    (tmp_path / "a.h5").write_bytes(heap)
    with pytest.raises(FileFormatError, match="is damaged: reading it crashes or does not come to an end"):
        Recording(tmp_path / "a.h5")
    _mat_of_all_kinds(tmp_path / "a.mat")
    whole = (tmp_path / "a.mat").read_bytes()
    for at, bit in ((4260, 4), (3562, 1), (4176, 0)):
        damaged = bytearray(whole)
        damaged[at] ^= 1 << bit
        (tmp_path / "a.mat").write_bytes(damaged)
        with pytest.raises(FileFormatError, match="is damaged"):
            open_arrays(tmp_path / "a.mat")


def test_the_undamaged_files_are_good(tmp_path: Path) -> None:
    _recording(tmp_path / "a.h5")
    with Recording(tmp_path / "a.h5") as recording:
        np.testing.assert_allclose(recording.stream().read(), SAMPLES, rtol=1e-6, atol=1e-6)
