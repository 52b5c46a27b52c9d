"""Recordings: round trips, damage, and what a crash leaves."""

import math
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition import Block, Channel, Paced, Recording, RecordingWriter, ReplaySource, StreamDescription, record
from foundation import FileFormatError, InputError

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


def test_replay_gives_back_the_recording_and_can_be_paced(tmp_path: Path) -> None:
    samples = np.random.default_rng(1).standard_normal((300, 2))
    record(ArraySource(samples, 64), tmp_path / "a.h5", dtype="float64")
    record(Paced(ReplaySource(tmp_path / "a.h5", block_length=37), speed=100.0), tmp_path / "b.h5", dtype="float64")
    with Recording(tmp_path / "b.h5") as again:
        np.testing.assert_array_equal(again.stream().read(), samples)
        pairs = again.clock_pairs("main")
    assert np.diff(pairs[:, 1]).min() > 0
    assert pairs[-1, 1] - pairs[0, 1] >= (300 - 37) / 1000 / 100 * 0.9


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
    _damage(path, kind)
    with pytest.raises(FileFormatError, match=message) as caught:
        Recording(path)
    assert "\n" not in str(caught.value)


def test_unknown_channels_and_streams_are_named(tmp_path: Path) -> None:
    record(ArraySource(np.zeros((10, 2)), 5), tmp_path / "a.h5")
    with Recording(tmp_path / "a.h5") as recording:
        with pytest.raises(InputError, match="no channel qq in stream main; it has fx, ax"):
            recording.stream().read(channels=["qq"])
        with pytest.raises(InputError, match="no stream 'other'"):
            recording.stream("other")
    with pytest.raises(InputError, match="no file"):
        Recording(tmp_path / "none.h5")
