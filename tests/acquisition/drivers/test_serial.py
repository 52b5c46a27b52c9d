"""Serial instruments over pseudo terminals: amplifier, drive, tachometer, and the plug that is pulled."""

import importlib.util
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from acquisition import Block, Channel, DeviceError, DeviceTimeout, Disconnected, Recording, StreamDescription, record
from acquisition.drivers.amplifier import Amplifier, Command
from acquisition.drivers.modbus_drive import ModbusFeed, Register
from acquisition.drivers.tachometer_line import TachometerFeed
from acquisition.sources.events import Events
from acquisition.sources.feeds import WithFeeds
from foundation import InputError

if sys.platform == "win32":
    pytest.skip("pseudo terminals need a Unix", allow_module_level=True)
pytest.importorskip("serial")

_spec = importlib.util.spec_from_file_location("lines", Path(__file__).with_name("lines.py"))
assert _spec is not None
assert _spec.loader is not None
lines = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(lines)

STREAM = StreamDescription("main", 1000.0, 0.0, (Channel("fx", "force", "N"),))
MakeEnd = Callable[..., "lines.FarEnd"]


class Clockwork:
    """A sampled source in real time on the host's own clock: sample i is taken at ``started`` + i / 1000 s."""

    title, setup, streams, n_samples = "", "", (STREAM,), None

    def __init__(self, n_blocks: int) -> None:
        self.n_blocks, self.done, self.started = n_blocks, 0, 0.0

    def open(self) -> None:
        self.started, self.done = time.monotonic(), 0

    def read(self) -> Block | None:
        if self.done == self.n_blocks:
            return None
        self.done += 1
        due = self.started + self.done * 0.05
        time.sleep(max(0.0, due - time.monotonic()))
        return Block("main", (self.done - 1) * 50, np.zeros((50, 1)), due)

    def close(self) -> None:
        pass


@pytest.fixture
def far_end() -> Iterator[MakeEnd]:
    ends = []

    def make(serve: Callable[["lines.FarEnd"], None]) -> "lines.FarEnd":
        ends.append(lines.FarEnd(serve))
        return ends[-1]

    yield make
    for end in ends:
        end.unplug()


def _poll_until(feed: TachometerFeed | ModbusFeed, count: int) -> list[Events]:
    taken: list[Events] = []
    latest = time.monotonic() + 5.0
    while len(taken) < count and time.monotonic() < latest:
        taken += feed.poll()
        time.sleep(0.01)
    return taken


TABLE = {b"RANGE 100": b"OK\r\n", b"OPERATE": b"OK\r\n", b"RESET": b"OK\r\n", b"*IDN?": b"Charge 5080\r\n"}
OPEN = (Command("*IDN?", "Charge"), Command("RANGE 100", "OK"), Command("OPERATE", "OK"))


def test_an_amplifier_is_set_by_its_table_and_reset_at_the_end(far_end: MakeEnd, tmp_path: Path) -> None:
    end = far_end(lines.amplifier(TABLE))
    amplifier = Amplifier(end.port, 9600, OPEN, (Command("RESET", "OK"),))
    record(WithFeeds(Clockwork(3), [amplifier]), tmp_path / "a.h5")
    assert end.heard == [b"*IDN?", b"RANGE 100", b"OPERATE", b"RESET"]
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.complete
        assert recording.events == {}


@pytest.mark.parametrize(
    ("command", "kind", "words"),
    [
        (Command("RANGE 999", "OK"), DeviceError, "answered 'ERR 5' to 'RANGE 999', expected 'OK'"),
        (Command("QUIET", "OK", wait=0.2), DeviceTimeout, "did not answer 'QUIET' within 0.2 s; check power"),
    ],
)
def test_an_unexpected_answer_stops_before_recording(
    far_end: MakeEnd, tmp_path: Path, command: Command, kind: type[Exception], words: str
) -> None:
    end = far_end(lines.amplifier({**TABLE, b"QUIET": b""}))
    with pytest.raises(kind, match=words):
        record(WithFeeds(Clockwork(3), [Amplifier(end.port, 9600, (*OPEN, command))]), tmp_path / "a.h5")
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.stream().n_samples == 0


def test_a_tachometer_is_read_and_its_times_are_right(far_end: MakeEnd, tmp_path: Path) -> None:
    baud = 1_000_000
    end = far_end(lines.tachometer(lambda due: f"S={1e3 * due:.4f} rpm\r\n".encode(), 0.02))
    feed = TachometerFeed(end.port, baud, "speed", pattern=r"S=([-\d.]+)", factor=1e-3)
    source = Clockwork(20)
    record(WithFeeds(source, [feed]), tmp_path / "a.h5")
    with Recording(tmp_path / "a.h5") as recording:
        times, sent = recording.events["speed"].read()
    assert len(times) > 30
    assert np.median(np.abs(times - (sent - source.started))) < 1e-3


def test_a_strict_instruments_own_clock_is_followed(far_end: MakeEnd) -> None:
    end = far_end(lines.tachometer(lambda due: b"7.5\r\n", 0.02))
    feed = TachometerFeed(end.port, 9600, "speed", period=0.02)
    feed.open()
    taken = _poll_until(feed, 10)
    feed.close()
    assert [float(event.times[0]) for event in taken[:10]] == pytest.approx(np.arange(1, 11) * 0.02)
    assert all(event.arrivals is not None and event.values[0] == 7.5 for event in taken)


def test_a_drive_is_asked_for_its_registers(far_end: MakeEnd) -> None:
    end = far_end(lines.modbus_slave(3, {100: 11937, 7: 0xFFFE}))
    registers = (Register(100, "spindle_speed_rpm", 0.5), Register(7, "load", signed=True, input_register=True))
    feed = ModbusFeed(end.port, 115200, 3, registers, interval=0.02)
    feed.open()
    taken = _poll_until(feed, 8)
    feed.close()
    found = {event.series: float(event.values[0]) for event in taken}
    assert found == {"spindle_speed_rpm": 5968.5, "load": -2.0}


def test_a_drive_that_does_not_know_the_register_is_named(far_end: MakeEnd) -> None:
    end = far_end(lines.modbus_slave(3, {}))
    feed = ModbusFeed(end.port, 115200, 3, (Register(100, "speed"),), interval=0.01, timeout=0.05)
    feed.open()
    with pytest.raises(DeviceTimeout, match=r"drive 3 on .* does not answer; check address"):
        _poll_until(feed, 1)
    feed.close()


@pytest.mark.parametrize("kind", ["tachometer", "drive", "amplifier"])
def test_a_pulled_plug_ends_the_recording_in_order(far_end: MakeEnd, tmp_path: Path, kind: str) -> None:
    serve = {
        "tachometer": lines.tachometer(lambda due: b"5\r\n", 0.02),
        "drive": lines.modbus_slave(1, {0: 5}),
        "amplifier": lines.amplifier(TABLE),
    }[kind]
    end = far_end(serve)
    feed = {
        "tachometer": TachometerFeed(end.port, 9600, "speed"),
        "drive": ModbusFeed(end.port, 115200, 1, (Register(0, "speed"),), interval=0.02),
        "amplifier": Amplifier(end.port, 9600, OPEN, (Command("RESET", "OK"),)),
    }[kind]
    source = Clockwork(60)

    def pull(item: object) -> None:
        if isinstance(item, Block) and item.first_sample == 500:
            end.unplug()

    with pytest.raises(Disconnected, match=f"{end.port} is gone .*check its plug"):
        record(WithFeeds(source, [feed]), tmp_path / "a.h5", observer=pull)
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.complete is False
        assert recording.ending.startswith("Disconnected: serial line")
        assert recording.stream().n_samples == source.done * 50
        assert 550 <= recording.stream().n_samples <= 1000


def test_lines_that_are_not_there_and_bad_patterns_are_said(tmp_path: Path) -> None:
    nowhere = str(tmp_path / "ttyNone")
    for feed in (TachometerFeed(nowhere, 9600, "s"), ModbusFeed(nowhere, 9600, 1, ()), Amplifier(nowhere, 9600, ())):
        with pytest.raises(Disconnected, match="cannot be opened"):
            feed.open()
    with pytest.raises(InputError, match="not a regular expression"):
        TachometerFeed(nowhere, 9600, "s", pattern="(")
    with pytest.raises(InputError, match="needs a group"):
        TachometerFeed(nowhere, 9600, "s", pattern="x")
    with pytest.raises(InputError, match="comes from two devices"):
        WithFeeds(Clockwork(1), [TachometerFeed(nowhere, 9600, "s"), TachometerFeed(nowhere, 9600, "s")])
