"""No wrong sample is given back without being named: power failures, flipped bits, zeroed bytes, bad sectors."""

import json
import re
import shutil
import sys
from collections import Counter
from pathlib import Path

import h5py
import numpy as np
import pytest
from power_failures import PAGE, SECTOR, image, logged_recording, true_rows

from acquisition import HOST_AXIS, Channel, Events, Recording, RecordingWriter, StreamDescription, convert, recover
from acquisition.recordings.journal import MAGIC
from millfrf.core import FileFormatError, InputError

linux = pytest.mark.skipif(sys.platform != "linux", reason="logs writes with the dynamic linker of Linux")
CHANNELS = tuple(Channel(f"a{k}", "acceleration", "m/s^2") for k in range(4))
TRUE = true_rows()


def judged(path: Path, truth: np.ndarray = TRUE) -> tuple[int, int]:
    """Recover a file; all rows given back are true or named. Returns their number, and that of the lost ones."""
    back = recover(path)
    with Recording(back.path) as recording:
        rows = recording.stream().read()
        named = np.zeros(len(rows), dtype=bool)
        for each in recording.missing("main"):
            named[each.first : each.end] = True
        pairs, (times, values, _) = recording.clock_pairs("main"), recording.events["speed"].read_raw()
    wrong = ~(rows == truth[: len(rows)]).all(axis=1)
    assert np.isnan(rows[named]).all()
    assert not wrong[~named].any()
    stated = np.zeros(len(truth), dtype=bool)
    for each in back.damaged["main"]:
        stated[each.first : each.end] = True
    assert stated[: len(rows)][named].all()
    np.testing.assert_array_equal(pairs[:, 1], pairs[:, 0] / 10_240.0)
    np.testing.assert_array_equal(values, 2.0 * times)
    back.path.unlink()
    return len(rows), back.lost["main"]


def fail_often(folder: Path, recordings: int, images: int, size_of_page: int) -> Counter[str]:
    """Fail the power at random moments of several recordings; what was synced comes back whole."""
    counted: Counter[str] = Counter()
    for seed in range(recordings):
        own = folder / str(seed)
        own.mkdir()
        steps = logged_recording(own, seed, 3.0, 16 if seed % 2 else 4096)
        generator = np.random.default_rng(seed)
        for _ in range(images):
            content, synced = image(steps, generator, size_of_page)
            path = own / "failed.h5"
            path.write_bytes(content)
            n_rows, lost = judged(path)
            assert n_rows >= synced
            counted["with a lost tail" if lost else "whole"] += 1
    return counted


@pytest.mark.long
@linux
@pytest.mark.parametrize("size_of_page", [PAGE, SECTOR])
def test_a_power_failure_gives_back_no_wrong_row(tmp_path: Path, size_of_page: int) -> None:
    counted = fail_often(tmp_path, 1, 12, size_of_page)
    assert counted["whole"] + counted["with a lost tail"] == 12


@linux
@pytest.mark.slow
@pytest.mark.parametrize(("size_of_page", "recordings"), [(PAGE, 10), (SECTOR, 40)])
def test_many_power_failures_give_back_no_wrong_row(tmp_path: Path, size_of_page: int, recordings: int) -> None:
    counted = fail_often(tmp_path, recordings, 25, size_of_page)
    print(size_of_page, dict(counted))
    assert counted["whole"] + counted["with a lost tail"] == 25 * recordings


def unclosed(path: Path, n_rows: int = 60_000) -> None:
    """A recording whose writer was killed."""
    whole = path.with_suffix(".whole")
    with RecordingWriter(
        whole, [StreamDescription("main", 10_240.0, 0.0, CHANNELS)], event_axes={"speed": HOST_AXIS}
    ) as writer:
        for at in range(0, n_rows, 700):
            stop = min(at + 700, n_rows)
            writer.append("main", TRUE[at:stop], at)
            writer.append_clock_pair("main", stop, stop / 10_240.0)
            writer.append_events(Events("speed", np.array([float(stop)]), np.array([2.0 * stop])))
        shutil.copyfile(whole, path)
    whole.unlink()


def spoiled(content: bytes, kind: str, generator: np.random.Generator) -> bytes:
    """One flipped bit, 64 bytes of zeros, or a sector of 4096 bytes that reads as zeros."""
    changed = bytearray(content)
    at = int(generator.integers(0, len(content)))
    if kind == "bit":
        changed[at] ^= 1 << int(generator.integers(0, 8))
    elif kind == "zeros":
        changed[at : at + 64] = bytes(len(changed[at : at + 64]))
    else:
        at -= at % 4096
        changed[at : at + 4096] = bytes(len(changed[at : at + 4096]))
    return bytes(changed)


def outcome(path: Path) -> str:
    """What becomes of a damaged file of 60 000 rows; a refusal is one line."""
    try:
        n_rows, lost = judged(path)
    except FileFormatError as error:
        return "refused" if len(str(error).splitlines()) == 1 else str(error)
    if n_rows + lost < 60_000:
        return f"{n_rows} rows and {lost} lost of 60000"
    return "rows lost and named" if lost else "nothing lost"


def damage_often(folder: Path, kind: str, count: int) -> Counter[str]:
    """Damage an unclosed file in many ways; each copy is refused in one line, or gives back nothing wrong unnamed."""
    unclosed(folder / "good.h5")
    content = (folder / "good.h5").read_bytes()
    generator = np.random.default_rng(len(kind))
    counted: Counter[str] = Counter()
    for k in range(count):
        path = folder / f"{kind}{k}.h5"
        path.write_bytes(spoiled(content, kind, generator))
        counted[outcome(path)] += 1
        path.unlink()
    return counted


@pytest.mark.long
@pytest.mark.parametrize("kind", ["bit", "zeros", "sector"])
def test_damaged_bytes_give_back_no_wrong_row(tmp_path: Path, kind: str) -> None:
    counted = damage_often(tmp_path, kind, 15)
    assert set(counted) <= {"refused", "nothing lost", "rows lost and named"}
    assert counted["rows lost and named"] > 7


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["bit", "zeros", "sector"])
def test_150_damages_give_back_no_wrong_row(tmp_path: Path, kind: str) -> None:
    counted = damage_often(tmp_path, kind, 150)
    print(kind, dict(counted))
    assert set(counted) <= {"refused", "nothing lost", "rows lost and named"}
    assert counted["rows lost and named"] > 100


def test_a_torn_index_costs_nothing(tmp_path: Path) -> None:
    """Before: a power failure that tore the index of the samples or of their blocks cost all samples."""
    unclosed(tmp_path / "good.h5")
    content = (tmp_path / "good.h5").read_bytes()
    places = [match.start() for match in re.finditer(b"EAHD|EAIB", content)]  # of the indices of chunks
    assert len(places) == 16  # of samples, blocks, clock, its sums, three columns of events, and the journal
    path = tmp_path / "torn.h5"
    for place in places:
        path.write_bytes(content[:place] + bytes(16) + content[place + 16 :])
        recovered = recover(path)
        assert (recovered.lost, recovered.damaged_values) == ({"main": 0}, {}), place
        recovered.path.unlink()
        assert judged(path) == (60_000, 0)


def test_a_closed_file_with_a_bad_sector_is_refused_and_recovered_around_it(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with RecordingWriter(
        path, [StreamDescription("main", 10_240.0, 0.0, CHANNELS)], event_axes={"speed": HOST_AXIS}
    ) as writer:
        for at in range(0, 50_000, 1000):
            writer.append("main", TRUE[at : at + 1000], at)
    with pytest.raises(InputError, match="every block is sound; there is nothing to recover"):
        recover(path)
    content = bytearray(path.read_bytes())
    spot = content.index(TRUE[20_500].tobytes())
    content[spot : spot + 512] = bytes(512)
    path.write_bytes(content)
    with Recording(path) as recording:
        np.testing.assert_array_equal(recording.stream().read(0, 20_000), TRUE[:20_000])
        with pytest.raises(FileFormatError, match=r"samples 20000 to 20999 of main are damaged \(they do not match"):
            recording.stream().read(19_990, 20_010)
    back = recover(path)
    assert [(each.first, each.end) for each in back.damaged["main"]] == [(20_000, 21_000)]
    assert back.samples == {"main": 50_000}
    with Recording(back.path) as recording:
        rows = recording.stream().read()
        assert np.isnan(rows[20_000:21_000]).all()
        np.testing.assert_array_equal(rows[21_000:], TRUE[21_000:50_000])
        (gone,) = recording.missing("main")
    assert (gone.first, gone.end, gone.reason) == (20_000, 21_000, "they do not match their checksum")


def test_a_recovered_file_can_be_converted_and_keeps_what_is_missing(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with RecordingWriter(path, [StreamDescription("main", 10_240.0, 0.0, CHANNELS)]) as writer:
        writer.append("main", TRUE[:1000])
        writer.append_with_missing("main", np.full((50, 4), np.nan), "they cannot be read")
        writer.append("main", TRUE[1050:3000])
    convert(path, tmp_path / "b.h5")
    with Recording(tmp_path / "b.h5") as recording:
        np.testing.assert_array_equal(recording.stream().read(1050, 3000), TRUE[1050:3000])
        assert [(each.first, each.end) for each in recording.missing("main")] == [(1000, 1050)]
    convert(path, tmp_path / "sound.h5", span=(0.2, 0.25))
    with Recording(tmp_path / "sound.h5") as recording:
        assert recording.missing("main") == ()
        np.testing.assert_array_equal(recording.stream().read(), TRUE[2048:2560])


def test_nan_rows_of_an_old_file_are_kept_as_missing(tmp_path: Path) -> None:
    """Files of version 1 have no checksums; other programs put NaN where samples are missing."""
    path = tmp_path / "a.h5"
    unclosed(path)
    with h5py.File(tmp_path / "old.h5", "w") as old, Recording(path, accept_cut=True) as recording:
        old.attrs.update({"format": "millfrf.recording", "format_version": 1, "complete": False})
        group = old.create_group("signals/main")
        group.attrs.update({"sample_rate": 10_240.0, "start_time": 0.0})
        group.attrs["channels"] = json.dumps([each.to_json() for each in CHANNELS])
        rows = recording.stream().read().astype("f4")
        rows[300:310, 1] = np.nan
        group.create_dataset("samples", data=rows, chunks=(4096, 4))
    back = recover(tmp_path / "old.h5")
    assert not back.has_checksums
    assert back.damaged == {"main": ()}
    with Recording(back.path) as recording:
        np.testing.assert_array_equal(recording.stream().read(), rows)
        (gone,) = recording.missing("main")
        assert (gone.first, gone.end) == (300, 310)
        assert "NaN" in gone.reason


def _with_reasons(path: Path, *, close: bool) -> bytes:
    """A recording in which rows are missing for two stated reasons, and one row is NaN without a reason."""
    with RecordingWriter(path, [StreamDescription("main", 10_240.0, 0.0, CHANNELS)]) as writer:
        writer.append("main", TRUE[:1000])
        writer.append_with_missing("main", np.full((50, 4), np.nan), "the device lost them")
        writer.append("main", TRUE[1050:5000])
        writer.append_with_missing("main", np.full((1, 4), np.nan), "the cable was loose")
        writer.append("main", TRUE[5001:20_000])
        unclosed = path.read_bytes()
    return path.read_bytes() if close else unclosed


STATED = [(1000, 1050, "the device lost them"), (5000, 5001, "the cable was loose")]


@pytest.mark.parametrize("source", ["table", "journal", "unclosed"])
def test_a_recovery_keeps_the_stated_reasons_of_missing_samples(source: str, tmp_path: Path) -> None:
    """Before: the reason of all was "NaN or infinite as they were recorded"."""
    path = tmp_path / "a.h5"
    content = _with_reasons(path, close=source != "unclosed")
    if source == "table":
        content = content.replace(MAGIC, bytes(len(MAGIC)))  # no frame is found
    elif source == "journal":
        with h5py.File(path, "r+") as file:
            del file["signals/main/missing"]
        content = path.read_bytes()
    spot = content.index(TRUE[12_000].tobytes())
    path.write_bytes(content[:spot] + bytes(512) + content[spot + 512 :])
    back = recover(path)
    assert back.lost == {"main": 4096}
    with Recording(back.path) as recording:
        missing = [(rows.first, rows.end, rows.reason) for rows in recording.missing("main")]
        rows = recording.stream().read()
    lost = back.damaged["main"][0]
    assert missing == [*STATED, (lost.first, lost.end, "they do not match their checksum")]
    np.testing.assert_array_equal(
        np.flatnonzero(np.isnan(rows).any(axis=1)), np.r_[1000:1050, 5000, lost.first : lost.end]
    )


def test_a_recovery_says_of_which_samples_no_reason_is_stated(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    path.write_bytes(_with_reasons(path, close=True).replace(MAGIC, bytes(len(MAGIC))))
    with h5py.File(path, "r+") as file:
        file["signals/main/missing"].resize(1, axis=0)
        file.attrs["format_version"], file.attrs["complete"] = 2, False
    with Recording(recover(path).path) as recording:
        stated, unstated = recording.missing("main")
    assert (stated.first, stated.end, stated.reason) == STATED[0]
    assert (unstated.first, unstated.end, unstated.reason) == (5000, 5001, "NaN or infinite as they were recorded")
