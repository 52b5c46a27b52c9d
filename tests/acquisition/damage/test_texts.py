"""Texts of a recording have a copy with a checksum: a difference is named, and recovery takes the copy."""

import re
from collections import Counter
from pathlib import Path

import h5py
import numpy as np
import pytest

from acquisition import HOST_AXIS, Channel, Events, Recording, RecordingWriter, StreamDescription, recover
from millfrf.command_line import run
from millfrf.core import FileFormatError

SETUP = "[tool]\nteeth = 2\n[coefficients]\nktc_pa = 119e6\n[pose]\njoints_deg = [0.0, -90.0, 90.0]\n" + "# note\n" * 30
CHANNELS = (Channel("fx", "force", "N", "TCP", "+X"), Channel("ax", "acceleration", "m/s^2", "TCP", "+X"))
STREAM = StreamDescription("main", 1024.0, 0.25, CHANNELS)
ROWS = np.random.default_rng(3).standard_normal((2_000, 2)).astype("f4")
TEXTS = {"title": "a cut of steel", "setup": SETUP, "recorded_at": "2026-05-04T10:00:00Z", "provenance": '{"by": "x"}'}


def write(path: Path, *, complete: bool = True) -> bytes:
    """Write a recording with a list of missing samples, and return its bytes."""
    with RecordingWriter(path, [STREAM], event_axes={"speed": HOST_AXIS}, overwrite=True, **TEXTS) as writer:
        writer.append("main", ROWS[:1000])
        writer.append_with_missing("main", np.full((5, 2), np.nan), "a cable was loose")
        writer.append("main", ROWS[1005:])
        writer.append_clock_pair("main", 2_000, 2.0)
        writer.append_events(Events("speed", np.array([0.5]), np.array([6000.0])))
        writer.close(complete=complete, ending="" if complete else "stopped by hand")
    return path.read_bytes()


def stated(path: Path) -> dict[str, object]:
    """Everything that a reader takes from the texts of a recording."""
    with Recording(path) as recording:
        missing = [(rows.first, rows.end, rows.reason) for rows in recording.missing("main")]
        texts = {name: getattr(recording, name) for name in TEXTS}
        axes = {name: series.axis for name, series in recording.events.items()}
        return texts | {
            "streams": [stream.description for stream in recording.streams.values()],
            "events": axes,
            "missing": missing,
            "end": (recording.complete, recording.ending, recording.format_version),
        }


EDITS = {
    "title": lambda file: file.attrs.modify("title", "a cut of iron"),
    "setup": lambda file: file.attrs.modify("setup", SETUP.replace("teeth = 2", "teeth = 3")),
    "recorded_at": lambda file: file.attrs.modify("recorded_at", "2025-05-04T10:00:00Z"),
    "provenance": lambda file: file.attrs.modify("provenance", "{}"),
    "complete": lambda file: file.attrs.modify("complete", np.bool_(False)),
    "ending": lambda file: file.attrs.modify("ending", np.array(b"out of steel", "S240")),
    "sample_rate of /signals/main": lambda file: file["signals/main"].attrs.modify("sample_rate", 2048.0),
    "start_time of /signals/main": lambda file: file["signals/main"].attrs.modify("start_time", 0.5),
    "channels of /signals/main": lambda file: file["signals/main"].attrs.modify(
        "channels", file["signals/main"].attrs["channels"].replace("+X", "+Z", 1)
    ),
    "time_axis of /events/speed": lambda file: file["events/speed"].attrs.modify("time_axis", "samples"),
    "clock of /events/speed": lambda file: file["events/speed"].attrs.modify("clock", "can0"),
    "/events/other": lambda file: file.create_group("events/other"),
    "/events/speed": lambda file: file["events"].pop("speed"),
    "start_time of /signals/main is missing": lambda file: file["signals/main"].attrs.pop("start_time"),
    "list of missing samples": lambda file: file["signals/main/missing"].write_direct(
        np.array([(1000, 3, b"a cable was loose", 7)], file["signals/main/missing"].dtype)
    ),
    "copy of its texts is damaged": lambda file: file["journal"].write_direct(
        np.full(200, 65, "u1"), None, np.s_[:200]
    ),
}


@pytest.mark.parametrize("place", EDITS)
def test_a_changed_text_is_named_and_recovery_takes_the_copy(
    tmp_path: Path, place: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.h5"
    write(path)
    sound = stated(path)
    with h5py.File(path, "r+") as file:
        EDITS[place](file)
    with pytest.raises(FileFormatError, match=re.escape(place)) as caught:
        stated(path)
    assert len(str(caught.value).splitlines()) == 1
    remedy = str(caught.value).rpartition("millfrf ")[2].split()
    assert run(remedy) == 0
    assert place in capsys.readouterr().out
    back = stated(tmp_path / "a.recovered.h5")
    for name in ("title", "setup", "recorded_at", "streams", "events"):
        assert back[name] == sound[name], name
    with Recording(tmp_path / "a.recovered.h5") as recording:
        np.testing.assert_array_equal(recording.stream().read(1005), ROWS[1005:])


def test_both_values_of_a_long_text_are_shown(tmp_path: Path) -> None:
    write(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        EDITS["setup"](file)
    with pytest.raises(FileFormatError, match=r"setup is .*teeth = 3.* in the file, but .*teeth = 2.* in the copy"):
        Recording(tmp_path / "a.h5")


def test_a_writer_killed_while_it_closes_leaves_a_readable_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """How the recording ended is written to the journal, and then to the attributes."""
    modify, held = h5py.AttributeManager.modify, []

    def noting(attributes: h5py.AttributeManager, name: str, value: object) -> None:
        held.append((tmp_path / "a.h5").read_bytes())
        modify(attributes, name, value)

    monkeypatch.setattr(h5py.AttributeManager, "modify", noting)
    write(tmp_path / "a.h5")
    (content,) = held
    assert b'"complete": true' in content
    (tmp_path / "b.h5").write_bytes(content)
    with Recording(tmp_path / "b.h5") as recording:
        assert recording.complete is False
        np.testing.assert_array_equal(recording.stream().read(1005), ROWS[1005:])
    assert recover(tmp_path / "b.h5").lost == {"main": 0}


def text_bytes(content: bytes) -> list[int]:
    """Places of the bytes of all texts of the file, and of their copy."""
    needles = [text.encode() for text in (SETUP, "a cut of steel", "2026-05-04T10:00:00Z", "loose", "stopped by hand")]
    needles += [b'"force"', b"m/s^2", b"+X", b"host", b"attributes", b"chunk_rows", b"119e6", b'"complete": ']
    return [
        at for needle in needles for match in re.finditer(re.escape(needle), content) for at in range(*match.span())
    ]


def outcome(path: Path, sound: dict[str, object]) -> str:
    """What becomes of a file with one changed bit; it is refused in one line, or states what the sound file states."""
    try:
        read, refusal = stated(path), ""
    except FileFormatError as error:
        read, refusal = {}, str(error)
    if not refusal:
        assert read == sound
        return "harmless"
    assert len(refusal.splitlines()) == 1
    assert "millfrf recover" in refusal
    back = recover(path)
    again = stated(back.path)
    for name in ("title", "setup", "recorded_at", "provenance", "streams", "events"):
        assert again[name] == sound[name], name
    with Recording(back.path) as recording:
        np.testing.assert_array_equal(recording.stream().read(1005), ROWS[1005:])
    assert back.notes
    back.path.unlink()
    return "named and recovered"


def flip_texts(folder: Path, count: int) -> Counter[str]:
    """Flip single bits of the texts of a recording that was closed in order, and of one that was stopped."""
    counted = Counter[str]()
    for complete in (True, False):
        content = write(folder / "a.h5", complete=complete)
        sound, places = stated(folder / "a.h5"), text_bytes(content)
        generator = np.random.default_rng(count + complete)
        for place in generator.choice(places, count // 2):
            changed = bytearray(content)
            changed[place] ^= 1 << int(generator.integers(8))
            (folder / "b.h5").write_bytes(changed)
            counted[outcome(folder / "b.h5", sound)] += 1
    return counted


@pytest.mark.parametrize("count", [pytest.param(30), pytest.param(500, marks=pytest.mark.long)])
def test_no_changed_bit_of_a_text_is_silent(tmp_path: Path, count: int) -> None:
    counted = flip_texts(tmp_path, count)
    print(dict(counted))
    assert counted["named and recovered"] > 0.9 * count
