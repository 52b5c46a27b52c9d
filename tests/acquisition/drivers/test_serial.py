"""Serial instruments over pseudo terminals: amplifier, drive, tachometer, and the plug that is pulled."""

import importlib.util
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from acquisition import Block, Channel, DeviceError, Events, Recording, StreamDescription, WithFeeds, record
from acquisition.drivers.amplifier import Amplifier, Command
from acquisition.drivers.modbus import ModbusFeed, Register, SerialLink, TcpLink
from acquisition.drivers.serial_lines import TachometerFeed
from acquisition.errors import DeviceTimeout, Disconnected
from millfrf.core import InputError

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
        assert list(recording.events) == ["devices"]
        assert len(recording.events["devices"].read()[0]) == 0


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
    feed = ModbusFeed(SerialLink(end.port, 115200), 3, registers, interval=0.02)
    feed.open()
    taken = _poll_until(feed, 8)
    feed.close()
    found = {event.series: float(event.values[0]) for event in taken}
    assert found == {"spindle_speed_rpm": 5968.5, "load": -2.0}


def test_a_register_that_is_not_there_is_named_before_the_cut(far_end: MakeEnd) -> None:
    end = far_end(lines.modbus_slave(3, {}))
    feed = ModbusFeed(SerialLink(end.port, 115200), 3, (Register(100, "speed"),), interval=0.01, timeout=0.05)
    with pytest.raises(InputError, match="drive 3 has no holding register 100; see its manual"):
        feed.open()
    with pytest.raises(DeviceTimeout, match=r"drive 4 does not answer; check its address, baud rate 115200, parity n"):
        ModbusFeed(SerialLink(end.port, 115200), 4, (Register(100, "speed"),), timeout=0.05).open()


def test_a_drive_with_parity_is_spoken_to_with_parity() -> None:
    link = SerialLink("COM8", 19200, "even", 1)
    settings = link.client(0.1).comm_params
    assert (settings.parity, settings.stopbits, settings.bytesize, settings.baudrate) == ("E", 1, 8, 19200)
    assert link.reply_duration == pytest.approx(7 * 11 / 19200)
    assert SerialLink("COM8", 19200, "odd", 2).client(0.1).comm_params.parity == "O"
    assert "parity even, 1 stop bits" in link.settings


def test_a_drive_on_the_network_is_read_and_comes_back(tmp_path: Path) -> None:
    drive = lines.TcpDrive(3, {100: 11937, 7: 0xFFFE})
    registers = (Register(100, "rpm", 0.5), Register(7, "load", signed=True, input_register=True))
    feed = ModbusFeed(TcpLink("127.0.0.1", drive.port), 3, registers, interval=0.02, timeout=0.1)
    drives = [drive]

    def pull(item: object) -> None:
        if isinstance(item, Block) and item.first_sample == 500:
            drive.unplug()
        elif isinstance(item, Block) and item.first_sample == 1200:
            drives.append(lines.TcpDrive(3, {100: 12000, 7: 0}, drive.port))

    try:
        record(WithFeeds(Clockwork(50), [feed], retry=0.1), tmp_path / "a.h5", observer=pull)
    finally:
        drives[-1].unplug()
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.complete
        (lost, back), codes = recording.events["devices"].read()
        times, values = recording.events["rpm"].read()
        assert codes.tolist() == [0.0, 1.0]
        assert 0.5 < lost < 1.2 < back < 2.3
        assert set(values[times < lost]) == {5968.5}
        assert set(values[times >= back]) == {6000.0}
        assert recording.events["load"].read()[1][0] == -2.0
    with pytest.raises(Disconnected, match=r"cannot be opened.*; check its name, plug, power"):
        ModbusFeed(TcpLink("127.0.0.1", drive.port), 3, registers, timeout=0.1).open()


SERVERS = {
    "tachometer": lines.tachometer(lambda due: b"5\r\n", 0.02),
    "strict": lines.tachometer(lambda due: b"5\r\n", 0.02),
    "drive": lines.modbus_slave(1, {0: 5}),
    "amplifier": lines.amplifier(TABLE),
}


@pytest.mark.parametrize("kind", list(SERVERS))
def test_a_plug_that_is_pulled_and_put_in_again_does_not_end_the_cut(
    far_end: MakeEnd, tmp_path: Path, kind: str
) -> None:
    port = tmp_path / "ttyUSB"
    ends = [far_end(SERVERS[kind])]
    port.symlink_to(ends[0].port)
    feed = {
        "tachometer": TachometerFeed(str(port), 9600, "speed"),
        "strict": TachometerFeed(str(port), 9600, "speed", period=0.02),
        "drive": ModbusFeed(SerialLink(str(port), 115200), 1, (Register(0, "speed"),), interval=0.02),
        "amplifier": Amplifier(str(port), 9600, OPEN, (Command("RESET", "OK"),), check=(Command("*IDN?", "Charge"),)),
    }[kind]

    def pull(item: object) -> None:
        if isinstance(item, Block) and item.first_sample == 500:
            port.unlink()
            ends[0].unplug()
        elif isinstance(item, Block) and item.first_sample == 1200:
            ends.append(far_end(SERVERS[kind]))
            port.symlink_to(ends[1].port)

    n_blocks = 60 if kind == "strict" else 38  # a clock that steps is held for a second
    record(WithFeeds(Clockwork(n_blocks), [feed], retry=0.1), tmp_path / "a.h5", observer=pull)
    with Recording(tmp_path / "a.h5") as recording:
        assert (recording.complete, recording.stream().n_samples) == (True, 50 * n_blocks)
        log = recording.events["devices"]
        times, codes = log.read()
        texts = log.read_texts()
        assert codes[:2].tolist() == [0.0, 1.0], texts
        assert texts[0].startswith(f"{feed.where}: lost (")
        assert texts[1] == f"{feed.where}: back"
        assert 0.5 < times[0] < 1.1
        assert 1.2 < times[1] < 1.85
        if kind != "amplifier":
            at, values = recording.events["speed"].read()
            assert set(values) == {5.0}
            assert at.max() > 0.05 * n_blocks - 0.3
            assert not ((at > times[0] + 0.05) & (at < times[1] - 0.05)).any()
        if kind == "strict":
            assert "lines are missing, the times go on" in texts[2]
            assert np.abs(np.diff(at[at > times[1]]) - 0.02).max() < 1e-3
    if kind == "amplifier":
        assert ends[1].heard == [b"*IDN?", b"*IDN?", b"RESET"]  # no reset and no range while the cut runs


def test_a_range_stands_in_one_place_and_is_read_back(far_end: MakeEnd, tmp_path: Path) -> None:
    end = far_end(lines.ranged_amplifier({"1": 100.0}))
    commands = (Command("RANGE 1,{fx}", "OK"),)
    asked = (Command("RANGE? 1", "RANGE {fx}"),)

    def turn_the_knob(item: object) -> None:
        if isinstance(item, Block) and item.first_sample == 500:
            end.settings["1"] = 200.0

    made = Amplifier(end.port, 9600, commands, check=asked, check_every=0.1, ranges={"fx": 1000.0})
    record(WithFeeds(Clockwork(20), [made], retry=0.1), tmp_path / "a.h5", observer=turn_the_knob)
    assert end.settings["1"] == 200.0  # nothing is set while the cut runs
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.complete
        texts = recording.events["devices"].read_texts()
        assert "the range of fx is 200, not 1000" in texts[0]
    refused = Amplifier(end.port, 9600, (), check=asked, ranges={"fx": 1000.0})
    with pytest.raises(DeviceError, match="the range of fx is 200, not 1000; set it there or in the session"):
        refused.open()
    with pytest.raises(InputError, match="needs the range of fx; give amplifier and amplifier_range"):
        Amplifier(end.port, 9600, commands)


def test_lines_that_are_not_there_and_bad_patterns_are_said(tmp_path: Path) -> None:
    nowhere = str(tmp_path / "ttyNone")
    for feed in (
        TachometerFeed(nowhere, 9600, "s"),
        ModbusFeed(SerialLink(nowhere, 9600), 1, ()),
        Amplifier(nowhere, 9600, ()),
    ):
        with pytest.raises(Disconnected, match="cannot be opened"):
            feed.open()
    with pytest.raises(InputError, match="not a regular expression"):
        TachometerFeed(nowhere, 9600, "s", pattern="(")
    with pytest.raises(InputError, match="needs a group"):
        TachometerFeed(nowhere, 9600, "s", pattern="x")
    with pytest.raises(InputError, match="comes from two devices"):
        WithFeeds(Clockwork(1), [TachometerFeed(nowhere, 9600, "s"), TachometerFeed(nowhere, 9600, "s")])
