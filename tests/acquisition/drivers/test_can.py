"""CAN feeds: a virtual bus, a multicast one that stays on this machine, and slcan over a pseudo terminal."""

import os
import threading
import time
import tty
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition import Block, Channel, Recording, StreamDescription, WithFeeds, record
from acquisition.drivers.can_bus import CanFeed, CanTable, DbcDecoder, SignalTable
from acquisition.sources.source import Disconnected
from millfrf.core import FileFormatError, InputError

can = pytest.importorskip("can")
pytest.importorskip("cantools")

DBC = """VERSION ""
BU_: PLC
BO_ 256 Spindle: 8 PLC
 SG_ Speed : 0|16@1+ (0.5,0) [0|32000] "rpm" PLC
 SG_ Load : 16|16@1- (0.1,0) [-100|100] "%" PLC
BO_ 512 Joints: 4 PLC
 SG_ Joint1 : 0|32@1- (0.001,0) [-360|360] "deg" PLC
"""
SIGNALS = (
    SignalTable(signal="Speed", series="spindle_speed_rpm"),
    SignalTable(signal="Joint1", series="joint_1", factor=np.pi / 180),
)
STREAM = StreamDescription("main", 1000.0, 0.0, (Channel("fx", "force", "N"),))


def signal(name: str, series: str = "") -> SignalTable:
    return SignalTable(signal=name, series=series)


def can_feed(interface: str, channel: str, dbc: Path, **settings: Any) -> CanFeed:
    table = CanTable(interface=interface, channel=channel, dbc=dbc.name, signals=SIGNALS, **settings)
    return CanFeed(table, dbc.parent)


class Clockwork:
    """Ten blocks of 0.1 s in real time, with exact clock pairs."""

    title, setup, streams, n_samples = "", "", (STREAM,), None

    def __init__(self, n_blocks: int = 10) -> None:
        self.n_blocks, self.done, self.started = n_blocks, 0, 0.0

    def open(self) -> None:
        self.started, self.done = time.monotonic(), 0

    def read(self) -> Block | None:
        if self.done == self.n_blocks:
            return None
        self.done += 1
        time.sleep(max(0.0, self.started + self.done * 0.1 - time.monotonic()))
        return Block("main", (self.done - 1) * 100, np.zeros((100, 1)), self.started + self.done * 0.1)

    def close(self) -> None:
        pass


@pytest.fixture
def dbc(tmp_path: Path) -> Path:
    path = tmp_path / "cell.dbc"
    path.write_text(DBC)
    return path


def _frames(k: int) -> list["can.Message"]:
    speed = (2 * (6000 + k)).to_bytes(2, "little") + (-105).to_bytes(2, "little", signed=True) + bytes(4)
    joint = (-1000 * k).to_bytes(4, "little", signed=True)
    return [
        can.Message(arbitration_id=256, data=speed, is_extended_id=False),
        can.Message(arbitration_id=512, data=joint, is_extended_id=False),
        can.Message(arbitration_id=256, data=b"\x01", is_extended_id=False),  # cut short: not to be decoded
        can.Message(arbitration_id=99, data=b"", is_extended_id=False),
    ]


class Talker:
    """Sends frames every 20 ms from another bus of the same network and notes when."""

    def __init__(self, **bus: object) -> None:
        self.bus = can.Bus(**bus)
        self.sent: list[tuple[float, float]] = []
        self.stopped = threading.Event()
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def _run(self) -> None:
        while not self.stopped.wait(0.02):
            before = time.monotonic()
            for frame in _frames(len(self.sent)):
                self.bus.send(frame)
            self.sent.append((before, time.monotonic()))

    def stop(self) -> None:
        self.stopped.set()
        self.thread.join()
        self.bus.shutdown()


BUSES = {
    "virtual": {"interface": "virtual", "channel": "cell"},
    "udp_multicast": {"interface": "udp_multicast", "channel": "239.74.163.2", "port": 43117, "hop_limit": 0},
}


@pytest.mark.long
@pytest.mark.parametrize("kind", list(BUSES))
def test_wanted_signals_are_recorded_at_the_time_of_the_message(kind: str, dbc: Path, tmp_path: Path) -> None:
    arguments = dict(BUSES[kind])
    try:
        talker = Talker(**arguments)
    except (OSError, can.CanError) as error:
        pytest.skip(f"no {kind} bus on this machine: {error}")
    interface, channel = str(arguments.pop("interface")), str(arguments.pop("channel"))
    source = Clockwork()
    try:
        record(WithFeeds(source, [can_feed(interface, channel, dbc, options=arguments)]), tmp_path / "a.h5")
    finally:
        talker.stop()
    with Recording(tmp_path / "a.h5") as recording:
        times, speeds = recording.events["spindle_speed_rpm"].read()
        _, joints = recording.events["joint_1"].read()
        assert recording.events["joint_1"].axis.clock == f"{interface}:{channel}"
    assert len(speeds) > 20
    first = int(speeds[0]) - 6000
    np.testing.assert_array_equal(speeds, 6000 + first + np.arange(len(speeds)))
    first_joint = round(-float(np.degrees(joints[0])))
    assert first_joint in (first - 1, first)  # the bus may be opened between the two frames of a round
    np.testing.assert_allclose(joints, -np.radians(first_joint + np.arange(len(joints))), atol=1e-12)
    sent = np.array(talker.sent[first : first + len(times)]) - source.started
    early, late = sent[:, 0] - times, times - sent[:, 1]
    assert max(early.max(), late.max()) < 1e-3


def _log(recording: Recording) -> list[tuple[float, float, str]]:
    series = recording.events["devices"]
    return list(zip(*series.read(), series.read_texts(), strict=True))


@pytest.mark.long
def test_a_silent_bus_does_not_end_the_cut_and_its_silence_is_in_the_file(dbc: Path, tmp_path: Path) -> None:
    talker = can.Bus(interface="virtual", channel="pauses")
    feed = can_feed("virtual", "pauses", dbc, silence_s=0.3)

    def play(item: object) -> None:
        if isinstance(item, Block) and not 500 <= item.first_sample < 1400:
            for frame in _frames(item.first_sample // 100):
                talker.send(frame)

    try:
        record(WithFeeds(Clockwork(22), [feed], retry=0.1), tmp_path / "a.h5", observer=play)
    finally:
        talker.shutdown()
    with Recording(tmp_path / "a.h5") as recording:
        assert (recording.complete, recording.stream().n_samples) == (True, 2200)
        [(lost, code, text), (back, code_back, text_back), (_, _, last)] = _log(recording)
        assert last.startswith("CAN bus virtual pauses: ")
        assert last.endswith(" messages without a value left out")  # each round has a frame that is too short
        assert (code, text) == (0.0, "CAN bus virtual pauses: lost (no selected message for 0.3 s)")
        assert (code_back, text_back) == (1.0, "CAN bus virtual pauses: back")
        times, speeds = recording.events["spindle_speed_rpm"].read()
        assert lost == pytest.approx(0.5, abs=0.15)  # the last message, not when it was missed
        assert back == pytest.approx(1.5, abs=0.15)
        assert speeds.tolist() == [6000.0 + k for k in (*range(5), *range(14, 22))][: len(speeds)]
        assert len(speeds) >= 12
        assert np.abs(times - (0.1 + (speeds - 6000) / 10)).max() < 0.1


@pytest.mark.long
@pytest.mark.skipif(os.name != "posix", reason="pseudo terminals need a Unix")
def test_an_slcan_adapter_is_unplugged_and_plugged_again(dbc: Path, tmp_path: Path) -> None:
    pytest.importorskip("serial")
    port, ends = tmp_path / "ttyCAN", []

    def plug() -> None:
        master, slave = os.openpty()
        tty.setraw(slave)
        port.unlink(missing_ok=True)
        port.symlink_to(os.ttyname(slave))
        ends.append((master, slave))

    def play(item: object) -> None:
        if not isinstance(item, Block):
            return
        if item.first_sample == 500:
            port.unlink()
            for end in ends.pop():
                os.close(end)
        elif item.first_sample == 1200:
            plug()
        elif ends:
            frame = b"t1008" + (2 * 7000).to_bytes(2, "little").hex().encode() + bytes(6).hex().encode()
            os.write(ends[0][0], frame + b"\r")

    plug()
    feed = can_feed("slcan", str(port), dbc, options={"sleep_after_open": 0, "bitrate": 500000})
    record(WithFeeds(Clockwork(20), [feed], retry=0.1), tmp_path / "a.h5", observer=play)
    for end in ends[0]:
        os.close(end)
    with Recording(tmp_path / "a.h5") as recording:
        assert (recording.complete, recording.stream().n_samples) == (True, 2000)
        [(lost, code, text), (back, code_back, _)] = _log(recording)
        assert (code, code_back) == (0.0, 1.0)
        assert text.startswith(f"CAN bus slcan {port}: lost (is gone"[:60])
        assert 0.6 <= lost < 1.1
        assert 1.3 <= back < 1.9
        times, speeds = recording.events["spindle_speed_rpm"].read()
        assert set(speeds) == {7000.0}
        assert sum(times < lost) == 5
        assert sum(times >= back - 1e-3) >= 3


@pytest.mark.long
@pytest.mark.parametrize("step", [5.0, -5.0, 0.3])
def test_events_stay_right_when_the_wall_clock_is_set(
    dbc: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: float
) -> None:
    real, set_by = time.time, [0.0]
    monkeypatch.setattr(time, "time", lambda: real() + set_by[0])
    talker = can.Bus(interface="virtual", channel="clock")
    source, sent = Clockwork(25), []

    def play(item: object) -> None:
        if isinstance(item, Block):
            if item.first_sample == 1200:
                set_by[0] = step
            sent.append(time.monotonic() - source.started)
            talker.send(_frames(len(sent))[0])

    try:
        record(WithFeeds(source, [can_feed("virtual", "clock", dbc)]), tmp_path / "a.h5", observer=play)
    finally:
        talker.shutdown()
    with Recording(tmp_path / "a.h5") as recording:
        log = _log(recording)
        times, speeds = recording.events["spindle_speed_rpm"].read()
    true = np.array(sent)[speeds.astype(int) - 6001]
    assert len(times) >= 23
    assert np.abs(times - true).max() < 0.05
    texts = sorted(text for _, _, text in log)
    assert len(texts) == 2
    assert texts[0].startswith("CAN bus virtual clock: clock of its stamps stepped by ")
    assert texts[1].startswith("computer: wall clock set by ")
    for text in texts:
        assert float(text.split(" by ")[1].split(" s")[0]) == pytest.approx(step, abs=2e-3)
    assert all(code == 2.0 and 1.25 < at < 1.9 for at, code, _ in log)


TWINS = """VERSION ""
BU_: PLC
BO_ 256 Spindle: 2 PLC
 SG_ Speed : 0|16@1+ (1,0) [0|32000] "rpm" PLC
BO_ 512 Table: 2 PLC
 SG_ Speed : 0|16@1+ (10,0) [0|32000] "mm/min" PLC
BO_ 2147483904 Coolant: 2 PLC
 SG_ Flow : 0|16@1+ (1,0) [0|32000] "l" PLC
"""


def test_signals_of_one_name_and_identifiers_of_one_number_are_told_apart(tmp_path: Path) -> None:
    path = tmp_path / "twins.dbc"
    path.write_text(TWINS)
    wanted = (signal("Spindle.Speed"), signal("Table.Speed", "feed"), signal("Flow"))
    decoder = DbcDecoder(path, wanted)
    data = (7).to_bytes(2, "little")
    assert decoder.decode(256, data) == [("Spindle.Speed", 7.0)]
    assert decoder.decode(512, data) == [("feed", 70.0)]
    assert decoder.decode(256, data, extended=True) == [("Flow", 7.0)]
    assert decoder.decode(512, data, extended=True) == []
    with pytest.raises(InputError, match=r"'Speed' in 2 messages; name one of Spindle\.Speed, Table\.Speed"):
        DbcDecoder(path, [signal("Speed")])
    with pytest.raises(InputError, match="series v is given to two signals"):
        DbcDecoder(path, [signal("Spindle.Speed", "v"), signal("Table.Speed", "v")])


def test_wrong_files_signals_and_buses_are_named(dbc: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no signal 'Sped'; it has Joint1, Load, Speed"):
        DbcDecoder(dbc, [signal("Sped")])
    (tmp_path / "bad.dbc").write_text("BO_ nonsense")
    with pytest.raises(FileFormatError, match="is not a DBC file"):
        DbcDecoder(tmp_path / "bad.dbc", ())
    with pytest.raises(InputError, match="no DBC file"):
        DbcDecoder(tmp_path / "none.dbc", ())
    with pytest.raises(Disconnected, match="cannot be opened"):
        can_feed("slcan", str(tmp_path / "ttyNone"), dbc).open()
