"""Serial instruments over pseudo terminals: amplifier, drive, tachometer, and the plug that is pulled."""

import importlib.util
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition import Block, Channel, DeviceError, Events, Recording, StreamDescription, WithFeeds, record
from acquisition.drivers.modbus import ModbusFeed, ModbusTable, RegisterTable
from acquisition.drivers.serial_lines import Amplifier, AmplifierTable, CommandTable, TachometerFeed, TachometerTable
from acquisition.sources.source import DeviceTimeout, Disconnected
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
SPINDLE, LOAD = (
    RegisterTable(address=100, series="spindle_speed_rpm", factor=0.5),
    RegisterTable(address=7, series="load", signed=True, input_register=True),
)


def command(send: str, expect: str = "", wait_s: float = 1.0) -> CommandTable:
    return CommandTable(send=send, expect=expect, wait_s=wait_s)


def amplifier_on(port: str, ranges: dict[str, float] | None = None, **settings: Any) -> Amplifier:
    return Amplifier(AmplifierTable(port=port, baud=9600, **settings), ranges or {})


def tachometer_on(port: str, baud: int = 9600, series: str = "speed", **settings: Any) -> TachometerFeed:
    return TachometerFeed(TachometerTable(port=port, baud=baud, series=series, **settings))


def drive_on(port: str, slave: int, *registers: RegisterTable, **settings: Any) -> ModbusFeed:
    return ModbusFeed(ModbusTable(port=port, baud=115200, slave=slave, registers=registers, **settings))


def network_drive(port: int, *registers: RegisterTable, **settings: Any) -> ModbusFeed:
    table = ModbusTable(host="127.0.0.1", tcp_port=port, slave=3, registers=registers, timeout_s=0.1, **settings)
    return ModbusFeed(table)


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
OPEN = (command("*IDN?", "Charge"), command("RANGE 100", "OK"), command("OPERATE", "OK"))
RESET = (command("RESET", "OK"),)


def test_an_amplifier_is_set_by_its_table_and_reset_at_the_end(far_end: MakeEnd, tmp_path: Path) -> None:
    end = far_end(lines.amplifier(TABLE))
    amplifier = amplifier_on(end.port, on_open=OPEN, on_close=RESET)
    record(WithFeeds(Clockwork(3), [amplifier]), tmp_path / "a.h5")
    assert end.heard == [b"*IDN?", b"RANGE 100", b"OPERATE", b"RESET"]
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.complete
        assert list(recording.events) == ["devices"]
        assert len(recording.events["devices"].read()[0]) == 0


@pytest.mark.parametrize(
    ("refused", "kind", "words"),
    [
        (command("RANGE 999", "OK"), DeviceError, "answered 'ERR 5' to 'RANGE 999', expected 'OK'"),
        (command("QUIET", "OK", 0.2), DeviceTimeout, "did not answer 'QUIET' within 0.2 s; check power"),
    ],
)
def test_an_unexpected_answer_stops_before_recording(
    far_end: MakeEnd, tmp_path: Path, refused: CommandTable, kind: type[Exception], words: str
) -> None:
    end = far_end(lines.amplifier({**TABLE, b"QUIET": b""}))
    with pytest.raises(kind, match=words):
        record(WithFeeds(Clockwork(3), [amplifier_on(end.port, on_open=(*OPEN, refused))]), tmp_path / "a.h5")
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.stream().n_samples == 0


def test_a_tachometer_is_read_and_its_times_are_right(far_end: MakeEnd, tmp_path: Path) -> None:
    baud = 1_000_000
    end = far_end(lines.tachometer(lambda due: f"S={1e3 * due:.4f} rpm\r\n".encode(), 0.02))
    feed = tachometer_on(end.port, baud, pattern=r"S=([-\d.]+)", factor=1e-3)
    source = Clockwork(20)
    record(WithFeeds(source, [feed]), tmp_path / "a.h5")
    with Recording(tmp_path / "a.h5") as recording:
        times, sent = recording.events["speed"].read()
    assert len(times) > 30
    assert np.median(np.abs(times - (sent - source.started))) < 1e-3


def test_a_strict_instruments_own_clock_is_followed(far_end: MakeEnd) -> None:
    end = far_end(lines.tachometer(lambda due: b"7.5\r\n", 0.02))
    feed = tachometer_on(end.port, period_s=0.02)
    feed.open()
    taken = _poll_until(feed, 10)
    feed.close()
    assert [float(event.times[0]) for event in taken[:10]] == pytest.approx(np.arange(1, 11) * 0.02)
    assert all(event.arrivals is not None and event.values[0] == 7.5 for event in taken)


def test_a_drive_is_asked_for_its_registers(far_end: MakeEnd) -> None:
    end = far_end(lines.modbus_slave(3, {100: 11937, 7: 0xFFFE}))
    feed = drive_on(end.port, 3, SPINDLE, LOAD, interval_s=0.02)
    feed.open()
    taken = _poll_until(feed, 8)
    feed.close()
    result = {event.series: float(event.values[0]) for event in taken}
    assert result == {"spindle_speed_rpm": 5968.5, "load": -2.0}


def test_a_register_that_is_not_there_is_named_before_the_cut(far_end: MakeEnd) -> None:
    end = far_end(lines.modbus_slave(3, {}))
    feed = drive_on(end.port, 3, SPINDLE, interval_s=0.01, timeout_s=0.05)
    with pytest.raises(InputError, match="drive 3 has no holding register 100; see its manual"):
        feed.open()
    with pytest.raises(DeviceTimeout, match=r"drive 4 does not answer; check its address, baud rate 115200, parity n"):
        drive_on(end.port, 4, SPINDLE, timeout_s=0.05).open()


def test_a_drive_with_parity_is_spoken_to_with_parity() -> None:
    def drive(parity: str, stop_bits: int) -> ModbusTable:
        common = {"port": "COM8", "baud": 19200, "slave": 1, "registers": (LOAD,)}
        return ModbusTable(**common, parity=parity, stop_bits=stop_bits)

    table = drive("even", 1)
    settings = table.client().comm_params
    assert (settings.parity, settings.stopbits, settings.bytesize, settings.baudrate) == ("E", 1, 8, 19200)
    assert table.reply_duration == pytest.approx(7 * 11 / 19200)
    assert drive("odd", 2).client().comm_params.parity == "O"
    assert "parity even, 1 stop bits" in table.link_settings


@pytest.mark.long
def test_a_drive_on_the_network_is_read_and_comes_back(tmp_path: Path) -> None:
    drive = lines.TcpDrive(3, {100: 11937, 7: 0xFFFE})
    feed = network_drive(drive.port, SPINDLE, LOAD, interval_s=0.02)
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
        times, values = recording.events["spindle_speed_rpm"].read()
        assert codes.tolist() == [0.0, 1.0]
        assert 0.5 < lost < 1.2 < back < 2.3
        assert set(values[times < lost]) == {5968.5}
        assert set(values[times >= back]) == {6000.0}
        assert recording.events["load"].read()[1][0] == -2.0
    with pytest.raises(Disconnected, match=r"cannot be opened.*; check its name, plug, power"):
        network_drive(drive.port, SPINDLE, LOAD).open()


SERVERS = {
    "tachometer": lines.tachometer(lambda due: b"5\r\n", 0.02),
    "strict": lines.tachometer(lambda due: b"5\r\n", 0.02),
    "drive": lines.modbus_slave(1, {0: 5}),
    "amplifier": lines.amplifier(TABLE),
}


@pytest.mark.long
@pytest.mark.parametrize("kind", list(SERVERS))
def test_a_plug_that_is_pulled_and_put_in_again_does_not_end_the_cut(
    far_end: MakeEnd, tmp_path: Path, kind: str
) -> None:
    port = tmp_path / "ttyUSB"
    ends = [far_end(SERVERS[kind])]
    port.symlink_to(ends[0].port)
    feed = {
        "tachometer": tachometer_on(str(port)),
        "strict": tachometer_on(str(port), period_s=0.02),
        "drive": drive_on(str(port), 1, RegisterTable(address=0, series="speed"), interval_s=0.02),
        "amplifier": amplifier_on(str(port), on_open=OPEN, on_close=RESET, check=(command("*IDN?", "Charge"),)),
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
            assert "are missing; later times account for it" in texts[2]
            assert np.abs(np.diff(at[at > times[1]]) - 0.02).max() < 1e-3
    if kind == "amplifier":
        assert ends[1].heard == [b"*IDN?", b"*IDN?", b"RESET"]  # no reset and no range while the cut runs


def test_a_range_stands_in_one_place_and_is_read_back(far_end: MakeEnd, tmp_path: Path) -> None:
    end = far_end(lines.ranged_amplifier({"1": 100.0}))
    commands = (command("RANGE 1,{fx}", "OK"),)
    queries = (command("RANGE? 1", "RANGE {fx}"),)

    def turn_the_knob(item: object) -> None:
        if isinstance(item, Block) and item.first_sample == 500:
            end.settings["1"] = 200.0

    amplifier = amplifier_on(end.port, {"fx": 1000.0}, on_open=commands, check=queries, check_every_s=0.1)
    record(WithFeeds(Clockwork(20), [amplifier], retry=0.1), tmp_path / "a.h5", observer=turn_the_knob)
    assert end.settings["1"] == 200.0  # nothing is set while the cut runs
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.complete
        texts = recording.events["devices"].read_texts()
        assert "the range of fx is 200, not 1000" in texts[0]
    refused = amplifier_on(end.port, {"fx": 1000.0}, check=queries)
    with pytest.raises(DeviceError, match="the range of fx is 200, not 1000; set it there or in the session"):
        refused.open()
    with pytest.raises(InputError, match="needs the range of fx; give amplifier and amplifier_range"):
        amplifier_on(end.port, on_open=commands)


def test_lines_that_are_not_there_and_bad_patterns_are_said(tmp_path: Path) -> None:
    nowhere = str(tmp_path / "ttyNone")
    for feed in (
        tachometer_on(nowhere),
        drive_on(nowhere, 1, SPINDLE),
        amplifier_on(nowhere),
    ):
        with pytest.raises(Disconnected, match="cannot be opened"):
            feed.open()
    with pytest.raises(InputError, match="not a regular expression"):
        tachometer_on(nowhere, pattern="(")
    with pytest.raises(InputError, match="needs a group"):
        tachometer_on(nowhere, pattern="x")
    with pytest.raises(InputError, match="comes from two devices"):
        WithFeeds(Clockwork(1), [tachometer_on(nowhere), tachometer_on(nowhere)])
