"""The KUKA driver against a simulated controller, a process of its own: echo, lost and late packets, and its end."""

import json
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition import Block, Channel, Recording, StreamDescription, WithFeeds, record
from acquisition.drivers.rsi import PacketCounter, RsiFeed, RsiPacket, RsiSignalTable, RsiTable, parse_packet
from acquisition.drivers.rsi_answering import Gate, answer
from acquisition.sources.source import Disconnected

CONTROLLER = Path(__file__).with_name("rsi_controller.py")
FLOOD = Path(__file__).parents[1] / "flooding.py"
STREAM = StreamDescription("main", 1000.0, 0.0, (Channel("fx", "force", "N"),))


class Clockwork:
    """Blocks of 0.1 s in real time on the host's own clock."""

    title, setup, streams, n_samples = "", "", (STREAM,), None

    def __init__(self, n_blocks: int) -> None:
        self.n_blocks, self.done, self.started = n_blocks, 0, 0.0

    def open(self) -> None:
        self.started, self.done = time.monotonic(), 0

    def read(self) -> Block | None:
        if self.done == self.n_blocks:
            return None
        self.done += 1
        due = self.started + self.done * 0.1
        time.sleep(max(0.0, due - time.monotonic()))
        return Block("main", (self.done - 1) * 100, np.zeros((100, 1)), due)

    def close(self) -> None:
        pass


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        line.bind(("127.0.0.1", 0))
        return int(line.getsockname()[1])


def rsi_feed(port: int, **settings: Any) -> RsiFeed:
    return RsiFeed(RsiTable(address="127.0.0.1", port=port, **settings))


def controller(port: int, *arguments: object) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, str(CONTROLLER), str(port), *map(str, arguments)], stdout=subprocess.PIPE, text=True
    )


@pytest.mark.long
@pytest.mark.parametrize("cycle", [4, 12])
def test_a_robot_is_recorded_answered_and_its_lost_packets_counted(tmp_path: Path, cycle: int) -> None:
    port, stated = free_port(), {}
    n_packets = 1200 // cycle
    running = []

    def play(item: object) -> None:
        if isinstance(item, Block) and item.first_sample == 200:
            running.append(controller(port, cycle, n_packets, "lose=20,21,60", "late=40"))

    source = Clockwork(32)
    feed = rsi_feed(port, robot="127.0.0.1", silence_s=0.5)
    record(WithFeeds(source, [feed]), tmp_path / "a.h5", observer=play)
    said, _ = running[0].communicate(timeout=10)
    stated = json.loads(said)
    assert stated["sent"] == n_packets - 3
    assert stated["answered"] >= 0.98 * stated["sent"]
    assert stated["wrong"] == 0
    assert stated["median_delay_ms"] < cycle
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.complete
        series = recording.events
        _, angles = series["joint_1_rad"].read()
        packets = np.sort(np.round(np.degrees(angles) / 10).astype(int))
        assert packets.tolist() == [k for k in range(n_packets) if k not in (20, 21, 40, 60)]  # 40 came after 43
        due, positions = series["tcp_x_m"].read()
        error = due - (positions - source.started)
        assert np.abs(error).max() < 5e-3
        _, lost = series["rsi_lost"].read()
        assert lost.tolist() == [2.0, 1.0, 1.0]
        assert series["motor_current_2"].read()[1][0] == 0.5
        assert series["tcp_b_rad"].read()[1][0] == pytest.approx(np.pi / 2)
        texts = series["devices"].read_texts()
    assert texts[-1].startswith(f"RSI 127.0.0.1:{port}: 4 of {n_packets} packets lost, ")
    assert texts[-1].endswith("; left out: 1 out of order")
    assert texts[-2].endswith("lost (no packet for 0.5 s)")  # the robot's program had ended


@pytest.mark.long
def test_a_controller_that_ends_and_starts_anew_is_lost_and_back(tmp_path: Path) -> None:
    port, running = free_port(), []

    def play(item: object) -> None:
        if isinstance(item, Block) and item.first_sample in (0, 1800):
            running.append(controller(port, 4, 150, f"first={1000 if item.first_sample else 900_000}"))

    source = Clockwork(32)
    record(WithFeeds(source, [rsi_feed(port, silence_s=0.4)]), tmp_path / "a.h5", observer=play)
    for each in running:
        assert json.loads(each.communicate(timeout=10)[0])["answered"] >= 140
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.complete
        log = recording.events["devices"]
        lines = list(zip(log.read_texts(), log.read()[0], strict=True))
        times, positions = recording.events["tcp_x_m"].read()
        _, lost = recording.events["rsi_lost"].read()
    where = f"RSI 127.0.0.1:{port}"
    assert lost.sum() == 0
    assert len(times) == 300
    assert np.abs(times - (positions - source.started)).max() < 10e-3
    stated = [(text, at) for text, at in lines if text.endswith(("lost (no packet for 0.4 s)", "back"))]
    (_, gone), (_, back) = stated[0], next((text, at) for text, at in stated if text == f"{where}: back")
    assert 0.6 < gone < 1.2 < 1.8 < back < 2.5
    assert any("controller's clock restarted" in text for text, _ in lines)


def test_a_port_in_use_and_foreign_senders(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        feed = rsi_feed(taken.getsockname()[1])
        with pytest.raises(Disconnected, match=r"cannot be opened: .*in use; check address and port"):
            feed.open()
    port = free_port()
    feed = rsi_feed(port, robot="10.9.8.7", signals=(RsiSignalTable(signal="AIPos.A1", series="a"),))
    feed.open()
    try:
        stated = json.loads(controller(port, 4, 20).communicate(timeout=10)[0])
        assert (stated["answered"], feed.poll()) == (0, [])
    finally:
        feed.close()


def test_packets_that_are_none_are_not_answered() -> None:
    good = b'<Rob Type="KUKA"><AIPos A1="1.5" A2="x"/><IPOC>7</IPOC></Rob>'
    assert parse_packet(good) == RsiPacket(7, {"AIPos.A1": 1.5})
    assert answer(good, "ImFree") == b'<Sen Type="ImFree"><IPOC>7</IPOC></Sen>'
    for bad in (b"", b"<Rob>", b"<Rob></Rob>", b"\xff\x00", b"<Rob><IPOC>x</IPOC></Rob>"):
        assert parse_packet(bad) is None
        assert answer(bad, "ImFree") is None
    bomb = b'<!DOCTYPE a [<!ENTITY b "bbbb">]><Rob><IPOC>1</IPOC></Rob>'
    assert parse_packet(bomb) is None


def test_lost_and_late_packets_are_told_apart() -> None:
    count = PacketCounter()
    order = [0, 1, 2, 3, 4, 5, 6, 9, 10, 11, 15]
    came = [count.add(RsiPacket(5000 + 12 * k, {}), 5.0 + 0.012 * k) for k in order]
    assert [each.n_lost for each in came] == [0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 3]
    assert (count.cycle, count.n_received, count.n_lost, count.n_late) == (12, 11, 5, 0)
    assert count.add(RsiPacket(5000 + 12 * 16, {}), 5.0 + 0.012 * 16 + 0.05).lateness == pytest.approx(0.05, abs=1e-3)
    paused = count.add(RsiPacket(9000, {}), 9.0)
    assert (paused.n_lost, paused.restarted) == (0, False)
    assert count.add(RsiPacket(3, {}), 9.1).restarted


ROBOT, OTHER_PORT, STRANGER = ("10.0.0.2", 4000), ("10.0.0.2", 4001), ("10.0.0.3", 4000)


def admitted(gate: Gate, packets: list[tuple[int | None, tuple[str, int], float]]) -> list[bool]:
    return [gate.believes(sender, at) and gate.admits(ipoc, sender, at) for ipoc, sender, at in packets]


def test_packets_of_others_and_out_of_order_are_counted_and_not_admitted() -> None:
    gate = Gate("any", silence=1.0)
    sent = [
        (1000, ROBOT, 10.000),
        (1004, STRANGER, 10.001),  # another address
        (1004, OTHER_PORT, 10.002),  # another program there
        (1004, ROBOT, 10.004),
        (1004, ROBOT, 10.005),  # repeated
        (1012, ROBOT, 10.012),
        (1008, ROBOT, 10.013),  # overtaken
        (None, ROBOT, 10.014),
        (900_000, ROBOT, 10.015),  # not before a quarter of an hour
        (1016, ROBOT, 10.016),
    ]
    assert admitted(gate, sent) == [k in (0, 3, 5, 9) for k in range(10)]
    assert gate.counts == {"foreign": 2, "overtaken": 2, "early": 1, "unreadable": 1, "busy": 0}
    assert gate.stranger == "10.0.0.2:4001"


def test_after_a_silence_the_robot_may_have_another_port_and_time_but_no_other_address() -> None:
    gate = Gate("any", silence=1.0)
    assert admitted(gate, [(1000, ROBOT, 10.0), (4, STRANGER, 11.5), (4, OTHER_PORT, 11.6), (8, ROBOT, 11.604)]) == [
        True,
        False,
        True,
        False,
    ]
    assert admitted(Gate("10.0.0.3", 1.0), [(1000, ROBOT, 10.0), (1004, STRANGER, 10.004)]) == [False, True]


def test_who_was_heard_together_with_the_robot_never_takes_its_place() -> None:
    gate = Gate("any", silence=1.0)
    sent = [(1000, ROBOT, 10.0), (1004, OTHER_PORT, 10.001), (2004, OTHER_PORT, 12.0), (3000, ROBOT, 12.001)]
    assert admitted(gate, sent) == [True, False, False, True]


def test_no_flood_of_the_robots_own_address_passes_faster_than_its_clock() -> None:
    gate = Gate("any", silence=1.0)
    flood = [(1000 + 4 * k, ROBOT, 10.0 + k / 15000) for k in range(150_000)]  # 10 s
    assert sum(admitted(gate, flood)) <= (10 + 1 + 1) * 250  # real time, and what settling and silence allow


@pytest.mark.long
def test_a_flood_is_counted_and_the_robot_recorded_and_answered(tmp_path: Path) -> None:
    port, running = free_port(), []

    def play(item: object) -> None:
        if not isinstance(item, Block):
            return
        if item.first_sample == 200:
            running.append(controller(port, 4, 600))
        if item.first_sample == 400:
            running.append(
                subprocess.Popen(
                    [sys.executable, str(FLOOD), "rsi", str(port), "127.0.0.1", "1.5"],
                    stdout=subprocess.PIPE,
                    text=True,
                )
            )

    source = Clockwork(36)
    record(WithFeeds(source, [rsi_feed(port, silence_s=0.5)]), tmp_path / "a.h5", observer=play)
    assert time.monotonic() - source.started < 3.6 + 1.0
    stated, sent = json.loads(running[0].communicate(timeout=10)[0]), int(running[1].communicate(timeout=10)[0])
    assert sent > 10_000
    assert stated["wrong"] == 0
    with Recording(tmp_path / "a.h5") as recording:
        assert (recording.complete, recording.stream().n_samples) == (True, 3600)
        _, angles = recording.events["joint_1_rad"].read()
        _, lost = recording.events["rsi_lost"].read()
        assert len(angles) + lost.sum() == 600
        assert lost.sum() < 60  # a computer may be too slow to receive all; it counts what it lost
        texts = recording.events["devices"].read_texts()
    [story] = [text for text in texts if "packets lost" in text]
    left_out = int(story.partition("left out: ")[2].partition(" of other senders")[0])
    assert 0.9 * sent <= left_out <= sent
    assert any("are left out, as another sender came first" in text for text in texts)
