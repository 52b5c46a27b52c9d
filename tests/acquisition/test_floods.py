"""Devices that flood the computer cost no sample, do not delay the end, and leave their counts in the file."""

import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest

from acquisition import Channel, Recording, RecordingWriter, StreamDescription
from acquisition.settings import SETTINGS
from acquisition.sources.feeds import ReconnectingFeed
from acquisition.sources.source import HOST_AXIS, Events
from acquisition.sources.threaded_feed import ThreadedFeed
from acquisition.sources.timing import StampedValue, SteadyStamps

pytest.importorskip("can")
pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs pseudo terminals and 127.0.0.2")
HERE = Path(__file__).parent
RATE, N_CHANNELS = 51200.0, 24
DBC = """VERSION ""
BU_: PLC
BO_ 256 Spindle: 8 PLC
 SG_ Speed : 0|16@1+ (0.5,0) [0|32000] "rpm" PLC
"""
SESSION = """
duration_s = {duration}
[device]
driver = "replay"
file = "whole.h5"
speed = 1.0
[[can]]
interface = "slcan"
channel = "ttyCAN"
dbc = "cell.dbc"
signals = [{{ signal = "Speed", series = "spindle_speed_rpm" }}]
options = {{ sleep_after_open = 0, bitrate = 500000 }}
[[tachometer]]
port = "ttyTachometer"
baud = 1000000
series = "tachometer_rpm"
[[modbus]]
host = "127.0.0.1"
tcp_port = {modbus}
slave = 3
registers = [{{ address = 7, series = "drive_load" }}]
[[rsi]]
address = "127.0.0.1"
port = {rsi}
robot = "127.0.0.1"
cycle_ms = 4
"""


def free_port(kind: int) -> int:
    with socket.socket(socket.AF_INET, kind) as line:
        line.bind(("127.0.0.1", 0))
        return int(line.getsockname()[1])


@contextmanager
def running(*arguments: object) -> Iterator["subprocess.Popen[str]"]:
    process = subprocess.Popen([sys.executable, *map(str, arguments)], stdout=subprocess.DEVNULL, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@pytest.fixture
def flooded(tmp_path: Path) -> Iterator[Path]:
    """Folder with a session of 24 channels at 51.2 kHz and four devices, all of which flood."""
    rows = np.arange(int(RATE))[:, None] + np.zeros(N_CHANNELS)
    stream = StreamDescription("main", RATE, 0.0, tuple(Channel(f"f{k}", "force", "N") for k in range(N_CHANNELS)))
    with RecordingWriter(tmp_path / "whole.h5", [stream]) as writer:
        for second in range(12):
            writer.append("main", rows + second)
    (tmp_path / "cell.dbc").write_text(DBC)
    rsi, modbus = free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_STREAM)
    (tmp_path / "s.toml").write_text(SESSION.format(duration=6.0, modbus=modbus, rsi=rsi))
    drivers = HERE / "drivers"
    with ExitStack() as stack:
        for kind, place in {"can": tmp_path / "ttyCAN", "line": tmp_path / "ttyTachometer", "modbus": modbus}.items():
            stack.enter_context(running(HERE / "flooding.py", kind, place))
        stack.enter_context(running(drivers / "rsi_controller.py", rsi, 4, 10_000))
        time.sleep(0.5)
        stack.enter_context(running(HERE / "flooding.py", "rsi", rsi, "127.0.0.2", 600))
        while not (tmp_path / "ttyTachometer").exists():
            time.sleep(0.05)
        yield tmp_path


def acquire(folder: Path) -> "subprocess.Popen[str]":
    command = [sys.executable, "-m", "millfrf", "acquire", "s.toml", "--out", "a.h5"]
    return subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.mark.slow  # its deadlines hold on a machine without other load
def test_floods_of_all_devices_cost_no_sample_and_end_in_time(flooded: Path) -> None:
    process = acquire(flooded)
    said, complained = process.communicate(timeout=60)
    assert process.returncode == 0, complained
    with Recording(flooded / "a.h5") as recording:
        rows = recording.stream().read()
        assert (recording.complete, len(rows)) == (True, round(6 * RATE))
        second, index = np.divmod(np.arange(len(rows)), int(RATE))
        np.testing.assert_array_equal(rows, np.broadcast_to((index + second)[:, None], rows.shape).astype(rows.dtype))
        ended = recording.events["devices"].read()[0].max()
        assert ended < 6 + SETTINGS.stop_time + 1
        for name, value in {"spindle_speed_rpm": 6000.0, "tachometer_rpm": 6001.5, "drive_load": 42.0}.items():
            _, values = recording.events[name].read()
            assert len(values) > 20
            assert len(values) <= (ended + 3) * SETTINGS.messages_per_second  # with the time to open, and a burst
            np.testing.assert_allclose(values, value)
        assert len(recording.events["joint_1_rad"].read()[0]) > 1000
        texts = recording.events["devices"].read_texts()
    # the library of the CAN adapter reads fewer frames than the bound on slow computers; the bound is seen at the line
    [story] = [text for text in texts if text.startswith("serial line")]
    assert int(story.removesuffix(" messages left out, as more than 5000 a second came").rpartition(" ")[2]) > 1000
    assert f"device: {story}" in said
    assert any("of other senders" in text for text in texts)
    assert any(text.startswith("Modbus") and "messages without a value left out" in text for text in texts)


@pytest.mark.slow  # its deadlines hold on a machine without other load
def test_the_first_ctrl_c_ends_a_flooded_recording_in_order(flooded: Path) -> None:
    process = acquire(flooded)
    out = flooded / "a.h5"
    while not out.exists() or out.stat().st_size < 10_000_000:
        time.sleep(0.05)
    sent = time.monotonic()
    process.send_signal(signal.SIGINT)
    said, complained = process.communicate(timeout=30)
    assert time.monotonic() - sent < 2.0
    assert (process.returncode, complained) == (0, "")
    assert "wrote a.h5" in said
    with Recording(out) as recording:
        assert recording.complete


class Hanging(ThreadedFeed):
    """A device whose driver does not return."""

    def __init__(self) -> None:
        super().__init__("hanging device", {"speed": HOST_AXIS})

    def _connect(self) -> None:
        pass

    def _receive(self) -> None:
        time.sleep(20)

    def _release(self) -> None:
        pass


def test_drivers_that_do_not_return_delay_the_end_once_for_all() -> None:
    feeds = [ReconnectingFeed(Hanging(), "devices", 1.0) for _ in range(4)]
    for feed in feeds:
        feed.open()
    began = time.monotonic()
    for feed in feeds:
        feed.request_end()
    texts = [text for feed in feeds for events in feed.conclude() for text in events.texts or ()]
    assert time.monotonic() - began < 1.5
    assert texts == ["hanging device: its driver did not stop within 1 s; its last values may be missing"] * 4


def test_a_queue_that_nobody_empties_counts_what_it_leaves_out() -> None:
    feed = Hanging()
    single = Events("speed", np.zeros(1), np.zeros(1))
    feed._put([single] * (SETTINGS.queued_events + 7))
    assert len(feed.poll()) == SETTINGS.queued_events
    feed.conclude()
    assert [text for _, text in feed.notes()] == [
        "hanging device: 7 values left out, as the recorder was too busy to take them"
    ]


def test_values_of_unusual_lateness_cost_no_time_that_grows_with_their_number() -> None:
    """Four seconds of 5000 values a second, all late by a growing time after the first."""
    steady, began = SteadyStamps(), time.process_time()
    values = [StampedValue("s", 0.0, 10.0 + k / 5000, 10.0 + k / 2500 + (k > 50)) for k in range(20_000)]
    clear = [value for late in values for value in steady.add(late)] + steady.flush()
    assert len(clear) == len(values)
    assert time.process_time() - began < 3.0
