"""Recordings whose HDF5 structures are damaged are recovered from their raw bytes, stream by stream."""

import re
from collections import Counter
from pathlib import Path

import h5py
import numpy as np
import pytest

from acquisition import HOST_AXIS, Channel, EventAxis, Events, Recording, RecordingWriter, StreamDescription, recover
from acquisition.recordings.journal import MAGIC
from millfrf.core import FileFormatError, InputError

CHANNELS = tuple(Channel(f"a{k}", "acceleration", "m/s^2", f"P{k}", "+X") for k in range(3))
STREAMS = (
    StreamDescription("main", 10_240.0, 0.0, CHANNELS),
    StreamDescription("slow", 100.0, 0.5, (Channel("fx", "force", "N", "TCP", "+X"),)),
)
AXES = {"speed": HOST_AXIS, "axis": EventAxis("device", "rsi"), "note": EventAxis("samples", "", True)}
SETUP = "[tool]\nteeth = 2\n[cut]\nktc_pa = 119e6\n"
ROWS = {
    "main": np.random.default_rng(1).standard_normal((21_000, 3)).astype("f4"),
    "slow": np.zeros((210, 1), "f4"),  # equal bytes everywhere
}


def written(path: Path, *, close: bool = True, block_length: int = 4096) -> bytes:
    """Bytes of a recording of two streams and three series of events, closed in order or left by a killed writer."""
    whole = path.with_suffix(".whole")
    with RecordingWriter(
        whole, STREAMS, title="a cut", setup=SETUP, event_axes=AXES, provenance="{}", block_length=block_length
    ) as writer:
        for k in range(30):
            for name, step in (("main", 700), ("slow", 7)):
                writer.append(name, ROWS[name][step * k : step * (k + 1)], step * k)
                writer.append_clock_pair(name, step * (k + 1), float(k))
            at = np.array([float(k)])
            writer.append_events(Events("speed", at, 2.0 * at))
            writer.append_events(Events("axis", at, 3.0 * at, at + 0.5))
            writer.append_events(Events("note", at, at, None, (f"mark {k}",)))
        unclosed = whole.read_bytes()
    closed = whole.read_bytes()
    whole.unlink()
    return closed if close else unclosed


def require_all(path: Path) -> None:
    """Require that a recovered file holds every row, pair, value and text."""
    count = np.arange(30.0)
    with Recording(path) as recording:
        assert (recording.title, recording.setup) == ("a cut", SETUP)
        assert [stream.description for stream in recording.streams.values()] == list(STREAMS)
        for name, rows in ROWS.items():
            np.testing.assert_array_equal(recording.streams[name].read(), rows)
            step = len(rows) // 30
            np.testing.assert_array_equal(recording.clock_pairs(name), np.column_stack([step * (count + 1), count]))
        events = recording.raw_events()
        assert {name: series.axis for name, series in events.items()} == AXES
        for name, factor in (("speed", 2.0), ("axis", 3.0), ("note", 1.0)):
            times, values, arrivals = events[name].read_raw()
            np.testing.assert_array_equal(np.column_stack([times, values]), np.column_stack([count, factor * count]))
            assert (arrivals is None) == (name != "axis")
        assert events["note"].read_texts() == tuple(f"mark {k}" for k in range(30))


@pytest.mark.parametrize("close", [True, False])
def test_a_file_without_any_structure_of_hdf5_is_recovered_whole(tmp_path: Path, close: bool) -> None:
    path = tmp_path / "a.h5"
    content = bytearray(written(path, close=close))
    content[:4096] = bytes(4096)
    for match in re.finditer(rb"OHDR|EAHD|EAIB|EADB|FRHP|FHDB|BTHD|BTLF|GCOL", bytes(content)):
        content[match.start() : match.start() + 16] = bytes(16)
    path.write_bytes(content)
    back = recover(path)
    assert (back.lost, back.damaged_values) == ({"main": 0, "slow": 0}, {})
    assert back.notes
    require_all(back.path)


@pytest.mark.parametrize("block_length", [1, 16, 4096])
def test_small_chunks_are_found_as_well(tmp_path: Path, block_length: int) -> None:
    path = tmp_path / "a.h5"
    content = written(path, block_length=block_length)
    path.write_bytes(bytes(2048) + content[2048:])
    require_all(recover(path).path)


@pytest.mark.parametrize("close", [True, False])
def test_a_damaged_header_costs_nothing(tmp_path: Path, close: bool) -> None:
    """Before: the header of one small series of events cost all samples."""
    path, content = tmp_path / "a.h5", written(tmp_path / "a.h5", close=close)
    places = [match.start() for match in re.finditer(b"OHDR", content)]
    assert len(places) > 25  # of groups and tables
    for place in places:
        path.write_bytes(content[:place] + bytes(16) + content[place + 16 :])
        back = recover(path)
        assert back.notes
        require_all(back.path)
        back.path.unlink()


def flip(content: bytes, place: int, bit: int) -> bytes:
    changed = bytearray(content)
    changed[place] ^= 1 << bit
    return bytes(changed)


def flip_often(path: Path, content: bytes, count: int) -> Counter[str]:
    """Flip single bits of the first 16 kB, and recover the file each time."""
    generator, counted = np.random.default_rng(len(content)), Counter[str]()
    for _ in range(count):
        path.write_bytes(flip(content, int(generator.integers(16_384)), int(generator.integers(8))))
        try:
            back = recover(path)
        except InputError:  # undamaged; there is nothing to recover
            require_all(path)
            counted["undamaged"] += 1
            continue
        require_all(back.path)
        back.path.unlink()
        counted["recovered"] += 1
    return counted


@pytest.mark.long
@pytest.mark.parametrize("close", [True, False])
def test_a_bit_in_the_first_16_kb_costs_nothing(tmp_path: Path, close: bool) -> None:
    counted = flip_often(tmp_path / "a.h5", written(tmp_path / "a.h5", close=close), 80)
    print(dict(counted))
    assert counted.total() == 80
    assert counted["recovered"] > 10


def test_each_series_of_a_file_without_a_journal_is_recovered_on_its_own(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    path.write_bytes(written(path))
    with h5py.File(path, "r+") as file:
        file.attrs["format_version"] = 2
        header = h5py.h5o.get_info(file["events/speed"].id).addr
    content = path.read_bytes().replace(MAGIC, bytes(len(MAGIC)))
    assert content[header : header + 4] == b"OHDR"
    path.write_bytes(content[:header] + bytes(16) + content[header + 16 :])
    with pytest.raises(FileFormatError, match="is damaged"):
        Recording(path)
    back = recover(path)
    assert "the header of events speed is damaged" in back.notes
    assert (back.lost, back.damaged_values) == ({"main": 0, "slow": 0}, {})
    assert back.events == {"axis": 30, "note": 30}
