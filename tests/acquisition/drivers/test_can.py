"""CAN feeds: a virtual bus, a multicast one that stays on this machine, and slcan over a pseudo terminal."""

import os
import threading
import time
import tty
from pathlib import Path

import numpy as np
import pytest

from acquisition import Block, Channel, DeviceTimeout, Disconnected, Recording, StreamDescription, record
from acquisition.drivers.can_bus import CanFeed, CanSignal, DbcDecoder
from acquisition.sources.feeds import WithFeeds
from foundation import FileFormatError, InputError

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
SIGNALS = (CanSignal("Speed", "spindle_speed_rpm"), CanSignal("Joint1", "joint_1", np.pi / 180))
STREAM = StreamDescription("main", 1000.0, 0.0, (Channel("fx", "force", "N"),))


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
        record(WithFeeds(source, [CanFeed(interface, channel, dbc, SIGNALS, options=arguments)]), tmp_path / "a.h5")
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


def test_a_silent_bus_ends_the_recording(dbc: Path, tmp_path: Path) -> None:
    feed = CanFeed("virtual", "silent", dbc, SIGNALS, silence=0.3)
    with pytest.raises(DeviceTimeout, match=r"no wanted message for 0.3 s; check bus, bitrate and DBC"):
        record(WithFeeds(Clockwork(), [feed]), tmp_path / "a.h5")
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.complete is False
        assert 300 <= recording.stream().n_samples <= 600


@pytest.mark.skipif(os.name != "posix", reason="pseudo terminals need a Unix")
def test_an_slcan_adapter_is_read_and_its_unplugging_noticed(dbc: Path, tmp_path: Path) -> None:
    pytest.importorskip("serial")
    master, slave = os.openpty()
    tty.setraw(slave)
    feed = CanFeed("slcan", os.ttyname(slave), dbc, SIGNALS, options={"sleep_after_open": 0, "bitrate": 500000})

    def play(item: object) -> None:
        if isinstance(item, Block) and item.first_sample < 500:
            os.write(master, b"t1008" + (2 * 7000).to_bytes(2, "little").hex().encode() + bytes(6).hex().encode())
            os.write(master, b"\r")
        elif isinstance(item, Block) and item.first_sample == 500:
            os.close(slave)
            os.close(master)

    with pytest.raises(Disconnected, match=r"CAN bus slcan .* is gone .*check its plug"):
        record(WithFeeds(Clockwork(20), [feed]), tmp_path / "a.h5", observer=play)
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.events["spindle_speed_rpm"].read()[1].tolist() == [7000.0] * 5
        assert recording.ending.startswith("Disconnected: CAN bus slcan")


def test_wrong_files_signals_and_buses_are_named(dbc: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no signal 'Sped'; it has Joint1, Load, Speed"):
        DbcDecoder(dbc, [CanSignal("Sped")])
    (tmp_path / "bad.dbc").write_text("BO_ nonsense")
    with pytest.raises(FileFormatError, match="is not a DBC file"):
        DbcDecoder(tmp_path / "bad.dbc", ())
    with pytest.raises(InputError, match="no DBC file"):
        DbcDecoder(tmp_path / "none.dbc", ())
    with pytest.raises(Disconnected, match="cannot be opened"):
        CanFeed("slcan", str(tmp_path / "ttyNone"), dbc, SIGNALS).open()
