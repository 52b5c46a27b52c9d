"""Recordings: round trips, damage, and what a crash leaves."""

import math
import subprocess
import sys
import threading
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition import (
    HOST_AXIS,
    Block,
    Channel,
    EventAxis,
    Events,
    Paced,
    Recording,
    RecordingWriter,
    StreamDescription,
    record,
)
from acquisition.drivers.replay import ReplaySource
from millfrf.core import FileFormatError, InputError

CHANNELS = (
    Channel("fx", "force", "N", "TCP", "+X", full_scale=500.0),
    Channel("ax", "acceleration", "m/s^2", "TCP", "+X"),
)
STREAM = StreamDescription("main", 1000.0, 0.25, CHANNELS)


class ArraySource:
    """Samples in memory as a source that may break."""

    title, setup, streams = "array", "[tool]\nteeth = 2\n", (STREAM,)

    def __init__(self, samples: np.ndarray, block: int, break_at: int | None = None) -> None:
        self.samples, self.block, self.break_at = samples, block, break_at
        self.n_samples: int | None = len(samples)
        self.position, self.closed = 0, False

    def open(self) -> None:
        self.position = 0

    def read(self) -> Block | None:
        start = self.position
        if self.break_at is not None and start >= self.break_at:
            raise KeyboardInterrupt
        part = self.samples[start : start + self.block]
        self.position += len(part)
        return Block("main", start, part, 100.0 + start) if len(part) else None

    def close(self) -> None:
        self.closed = True


@settings(max_examples=40)
@given(n=st.integers(1, 700), block=st.integers(1, 300), read_block=st.integers(1, 300))
def test_what_is_recorded_is_read_back_in_any_blocks(
    tmp_path_factory: pytest.TempPathFactory, n: int, block: int, read_block: int
) -> None:
    samples = np.random.default_rng(n).standard_normal((n, 2))
    path = tmp_path_factory.mktemp("r") / "a.h5"
    record(ArraySource(samples, block), path, dtype="float64")
    with Recording(path) as recording:
        stream = recording.stream()
        assert recording.complete is True
        assert (recording.title, recording.setup) == ("array", "[tool]\nteeth = 2\n")
        assert stream.description == STREAM
        np.testing.assert_array_equal(np.concatenate(list(stream.blocks(read_block))), samples)
        np.testing.assert_array_equal(stream.read(0, None, ["ax"])[:, 0], samples[:, 1])
        assert len(recording.clock_pairs("main")) == math.ceil(n / block)


def test_an_interrupted_recording_is_closed_readable_and_not_complete(tmp_path: Path) -> None:
    samples = np.arange(40.0).reshape(20, 2)
    source = ArraySource(samples, 5, break_at=10)
    with pytest.raises(KeyboardInterrupt):
        record(source, tmp_path / "a.h5")
    assert source.closed
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.complete is False
        np.testing.assert_array_equal(recording.stream().read(), samples[:10])


def test_a_killed_writer_leaves_what_it_acknowledged(tmp_path: Path) -> None:
    path = tmp_path / "killed.h5"
    program = f"""
import os, numpy as np
from acquisition import Channel, RecordingWriter, StreamDescription
stream = StreamDescription("main", 1000.0, 0.0, (Channel("fx", "force", "N"),))
writer = RecordingWriter({str(path)!r}, [stream])
for k in range(7):
    writer.append("main", np.full((1000, 1), float(k)))
os._exit(9)
"""
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 9
    with Recording(path) as recording:
        assert recording.complete is False
        np.testing.assert_array_equal(recording.stream().read()[::1000, 0], np.arange(7.0))


def test_a_text_that_hdf5_cannot_hold_is_named_and_leaves_no_file(tmp_path: Path) -> None:
    stream = StreamDescription("main", 1000.0, 0.0, (Channel("fx", "force", "N"),))
    with pytest.raises(InputError, match="setup holds a zero character at place 2"):
        RecordingWriter(tmp_path / "a.h5", [stream], setup="ab\0c")
    assert not (tmp_path / "a.h5").exists()


def test_replay_gives_back_the_recording_and_can_be_paced(tmp_path: Path) -> None:
    samples = np.random.default_rng(1).standard_normal((300, 2))
    record(ArraySource(samples, 64), tmp_path / "a.h5", dtype="float64")
    record(Paced(ReplaySource(tmp_path / "a.h5", block_length=37), speed=100.0), tmp_path / "b.h5", dtype="float64")
    with Recording(tmp_path / "b.h5") as again:
        np.testing.assert_array_equal(again.stream().read(), samples)
        pairs = again.clock_pairs("main")
    assert np.diff(pairs[:, 1]).min() > 0
    assert pairs[-1, 1] - pairs[0, 1] >= (300 - 37) / 1000 / 100 * 0.9


def test_replay_gives_back_events_with_their_texts_in_their_time(tmp_path: Path) -> None:
    axes = {"spindle_speed_rpm": HOST_AXIS, "mark": EventAxis("host", texts=True), "empty": HOST_AXIS}
    with RecordingWriter(tmp_path / "a.h5", [STREAM], event_axes=axes) as writer:
        writer.append("main", np.zeros((1000, 2)))
        writer.append_clock_pairs("main", np.array([[0, 50.0], [1000, 51.0]]))
        writer.append_events(Events("spindle_speed_rpm", 50.02 + np.arange(12) / 10, 6000.0 + np.arange(12)))
        writer.append_events(Events("mark", np.array([50.35]), np.array([1.0]), None, ("entry",)))
    order = []
    source = ReplaySource(tmp_path / "a.h5", block_length=250)
    source.open()
    while (taken := source.read()) is not None:
        order.append(taken.stream if isinstance(taken, Block) else (taken.series, len(taken.times)))
    source.close()
    speed = "spindle_speed_rpm"
    assert order == [
        "main",
        (speed, 3),
        "main",
        (speed, 2),
        ("mark", 1),
        "main",
        (speed, 3),
        "main",
        (speed, 2),
        (speed, 2),
    ]
    record(ReplaySource(tmp_path / "a.h5"), tmp_path / "b.h5")
    with Recording(tmp_path / "a.h5") as first, Recording(tmp_path / "b.h5") as second:
        for name, series in first.events.items():
            np.testing.assert_allclose(second.events[name].read(), series.read(), atol=1e-9)
            assert second.events[name].read_texts() == series.read_texts()


def test_events_and_the_second_writer(tmp_path: Path) -> None:
    path = tmp_path / "e.h5"
    with RecordingWriter(path, [STREAM], event_names=["spindle_speed"]) as writer:
        writer.append_event("spindle_speed", 0.5, 83.0)
        with pytest.raises(InputError, match="exists"):
            RecordingWriter(path, [STREAM])
        with pytest.raises(InputError, match="not announced"):
            writer.append_event("temperature", 0.0, 1.0)
    with Recording(path) as recording:
        time, value = recording.events["spindle_speed"].read()
    assert (time.tolist(), value.tolist()) == ([0.5], [83.0])


@pytest.mark.parametrize(
    ("samples", "message"),
    [(np.full((3, 2), np.nan), "fx holds NaN"), (np.zeros((3, 3)), "expected 2 columns"), (np.zeros(3), "expected 2")],
)
def test_unusable_blocks_are_refused(tmp_path: Path, samples: np.ndarray, message: str) -> None:
    with RecordingWriter(tmp_path / "a.h5", [STREAM]) as writer, pytest.raises(InputError, match=message):
        writer.append("main", samples)


def _damage(path: Path, kind: str) -> None:
    if kind == "text":
        path.write_text("no HDF5")
        return
    with h5py.File(path, "r+") as file:
        clock = file["signals/main"]
        if kind == "format":
            file.attrs["format"] = "something.else"
        elif kind == "version":
            file.attrs["format_version"] = 99
        elif kind == "no rate":
            del clock.attrs["sample_rate"]
        elif kind == "rate":
            clock.attrs["sample_rate"] = -1.0
        elif kind == "channels":
            clock.attrs["channels"] = "[]"
        elif kind == "json":
            clock.attrs["channels"] = "{"
        elif kind == "no signals":
            del file["signals"]


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("text", "not an HDF5 file"),
        ("format", "something.else"),
        ("version", "format_version 99"),
        ("no rate", "lacks the attribute sample_rate"),
        ("rate", "must be positive"),
        ("channels", "2 columns but 0 channels"),
        ("json", "not JSON"),
        ("no signals", "no /signals"),
    ],
)
def test_damaged_files_are_refused_in_one_line(tmp_path: Path, kind: str, message: str) -> None:
    path = tmp_path / "a.h5"
    record(ArraySource(np.zeros((10, 2)), 5), path)
    with h5py.File(path, "r+") as file:
        file.attrs["format_version"] = 2  # without a copy of the texts, which would be compared first
    _damage(path, kind)
    with pytest.raises(FileFormatError, match=message) as caught:
        Recording(path)
    assert "\n" not in str(caught.value)


def test_a_refused_file_leaves_other_threads_free_to_read(tmp_path: Path) -> None:
    """While the error and its traceback are kept, as a notebook does, h5py's lock must be free for other threads."""
    damaged, sound = tmp_path / "damaged.h5", tmp_path / "sound.h5"
    for path in (damaged, sound):
        record(ArraySource(np.zeros((10, 2)), 5), path)
    _damage(damaged, "no rate")
    with pytest.raises(FileFormatError) as caught:
        Recording(damaged)
    reader = threading.Thread(target=lambda: Recording(sound).close(), daemon=True)
    reader.start()
    reader.join(20.0)
    assert caught.value.__traceback__ is not None
    assert not reader.is_alive()


def test_a_file_cut_short_is_refused_at_once(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    record(ArraySource(np.ones((10, 2)), 5), path)
    whole = path.read_bytes()
    for length in (0, 40, 500, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(FileFormatError, match="cut short or damaged"):
            Recording(path)


def test_a_table_larger_than_what_is_stored_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    record(ArraySource(np.ones((10, 2)), 5), path)
    with h5py.File(path, "r+") as file:
        file["signals/main/samples"].resize(10**12, axis=0)
    with pytest.raises(FileFormatError, match="announces 1000000000000 samples but stores at most"):
        Recording(path)


def test_fields_that_older_files_lack_are_not_needed(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "millfrf.recording", 1
        group = file.create_group("signals/main")
        group.attrs["sample_rate"], group.attrs["start_time"] = 512.0, 0.0
        group.attrs["channels"] = '[{"name": "fx", "quantity": "force", "unit": "N"}]'
        group["samples"] = np.ones((5, 1), "f4")
    with Recording(path) as recording:
        assert (recording.complete, recording.setup, recording.title, recording.events) == (None, "", "", {})
        assert recording.stream().read(1, 3).shape == (2, 1)


@pytest.mark.shared_data
def test_recordings_of_the_practice_cases_open(shared_data: Path) -> None:
    path = shared_data.parent / "practice" / "case_00" / "low.h5"
    if not path.is_file():
        pytest.skip(f"no practice recording at {path}")
    with Recording(path) as recording:
        assert recording.complete is None
        assert (recording.stream().n_samples, recording.stream().duration) == (24576, 48.0)
        assert [c.name for c in recording.stream().channels_of("force")] == ["fx", "fy", "fz"]


def test_overwriting_must_be_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    record(ArraySource(np.ones((10, 2)), 5), path)
    with pytest.raises(InputError, match="exists"):
        record(ArraySource(np.ones((4, 2)), 5), path)
    with RecordingWriter(path, [STREAM], overwrite=True) as writer:
        writer.append("main", np.zeros((3, 2)))
    with Recording(path) as recording:
        assert recording.stream().n_samples == 3


def test_rows_that_could_not_be_written_are_not_announced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    writer = RecordingWriter(tmp_path / "a.h5", [STREAM])
    writer.append("main", np.ones((6, 2)))
    monkeypatch.setattr(h5py.Dataset, "__setitem__", interrupted)
    with pytest.raises(KeyboardInterrupt):
        writer.append("main", np.ones((6, 2)))
    monkeypatch.undo()
    writer.close(complete=False)
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.stream().n_samples == 6
        assert recording.complete is False


def test_unknown_channels_and_streams_are_named(tmp_path: Path) -> None:
    record(ArraySource(np.zeros((10, 2)), 5), tmp_path / "a.h5")
    with Recording(tmp_path / "a.h5") as recording:
        with pytest.raises(InputError, match="no channel qq in stream main; it has fx, ax"):
            recording.stream().read(channels=["qq"])
        with pytest.raises(InputError, match="no stream 'other'"):
            recording.stream("other")
    with pytest.raises(InputError, match="no file"):
        Recording(tmp_path / "none.h5")
