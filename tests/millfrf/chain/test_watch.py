"""`millfrf watch`: announcements, marks in the recording, and messages to a cell through a real MQTT broker."""

import json
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from math import pi
from pathlib import Path

import numpy as np
import pytest

from acquisition import Block, Recording, RecordingWriter
from millfrf.command_line import BAD_INPUT, run
from millfrf.cutting import MillingProcess
from millfrf.live.control import LiveControl
from millfrf.live.handlers import status_of
from millfrf.live.monitor import LiveMonitor, LiveSettings
from millfrf.stability import OnlineClassifier, StateChange
from millfrf.steps.chatter import CutOptions
from millfrf.steps.recording.acquire import open_session
from millfrf.steps.recording.watched_cut import chatter_watch, watched_by_page
from replay_data import MillingCell, table_one_model, tip_accelerometers

RATE, RPM = 2048.0, 800.0
PROCESS = MillingProcess(2, 0.0127, pi / 2, 119e6, 0.17, 0.33, pi / 2, pi, 0.15e-3)
DEPTHS = {"stable": 1.2e-3, "hopf": 3.0e-3}
DURATION = 20.0  # s; chatter from the first moment is announced after four windows of 3.2 s
TYPED = ["--teeth", "2", "--speed", "800"]
BROKER = """
import asyncio, sys
from amqtt.broker import Broker

async def serve():
    listener = {"default": {"type": "tcp", "bind": f"127.0.0.1:{sys.argv[1]}"}}
    broker = Broker({"listeners": listener, "plugins": {"amqtt.plugins.authentication.AnonymousAuthPlugin": {}}})
    await broker.start()
    print("ready", flush=True)
    await asyncio.Event().wait()

asyncio.run(serve())
"""


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a stable and of a chattering cut, each with a session that replays it."""
    folder = tmp_path_factory.mktemp("cuts")
    sensors = tip_accelerometers(0.01)
    for kind, depth in DEPTHS.items():
        cut = (table_one_model(), PROCESS, depth, RPM * pi / 30, DURATION)
        cell = MillingCell(*cut, sample_rate=RATE, sensors=sensors, seed=3)
        with RecordingWriter(folder / f"{kind}.h5", cell.streams) as writer:
            writer.append(cell.streams[0].name, cell.samples())
        session = f'title = "{kind}"\n[device]\ndriver = "replay"\nfile = "{kind}.h5"\nspeed = 4\n'
        (folder / f"{kind}.toml").write_text(session)
    return folder


@pytest.mark.parametrize("kind", DEPTHS)
def test_a_cut_is_announced(kind: str, recordings: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["watch", str(recordings / f"{kind}.toml"), *TYPED]) == 0
    said = capsys.readouterr().out
    assert f" s  {kind}" in said
    assert ("hopf chatter at" in said and "; try " in said) == (kind == "hopf")
    assert f"{kind} " in said.split("windows judged: ")[1]


def test_marks_are_in_the_recording(recordings: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "seen.h5"
    assert run(["watch", str(recordings / "hopf.toml"), *TYPED, "--out", str(out)]) == 0
    said = capsys.readouterr().out
    with Recording(out) as recording, Recording(recordings / "hopf.h5") as original:
        assert recording.complete
        assert np.array_equal(recording.stream().read(), original.stream().read())
        series = recording.events["chatter"]
        (times, values), texts = series.read(), series.read_texts()
    assert values[0] == 1
    assert 0 < times[0] < DURATION
    assert f"{times[0]:9.2f} s  {texts[0]}" in said


def test_teeth_speed_and_broker_that_are_not_known_are_refused(
    recordings: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    session, out = str(recordings / "hopf.toml"), tmp_path / "never.h5"
    for typed, remedy in (
        (["--speed", "800"], "give --cutting CUT.toml or --teeth N"),
        (["--teeth", "2"], "give --speed RPM, or spindle_speed_rpm in [cut] of the session"),
        ([*TYPED, "--mqtt", "127.0.0.1:9"], "no MQTT broker answers"),
        ([*TYPED, "--mqtt", "here:mqtt"], "write it as broker.local:1883"),
        ([*TYPED, "--response", "az"], "no channel az; it has"),
        ([*TYPED, "--stream", "other"], "no stream other; give --stream with one of daq"),
        (["--teeth", "99", "--speed", "800"], "above half the sample rate"),
    ):
        assert run(["watch", session, *typed, "--out", str(out)]) == BAD_INPUT
        assert remedy in capsys.readouterr().err
        assert not out.exists()


@pytest.fixture
def broker() -> Iterator[int]:
    """Port of a broker that runs in a process of its own."""
    pytest.importorskip("amqtt")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = int(free.getsockname()[1])
    command = [sys.executable, "-c", BROKER, str(port)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline().strip() == "ready"
    yield port
    process.terminate()
    process.communicate(timeout=20)


def test_a_cell_receives_the_announcements(broker: int, recordings: Path, capsys: pytest.CaptureFixture[str]) -> None:
    client = pytest.importorskip("paho.mqtt.client")
    received: list[dict[str, object]] = []
    cell = client.Client(client.CallbackAPIVersion.VERSION2)
    cell.on_connect = lambda *_: cell.subscribe("cell7/chatter", qos=1)
    cell.on_message = lambda client, data, message: received.append(json.loads(message.payload))
    cell.connect("127.0.0.1", broker)
    cell.loop_start()
    stated = ["--mqtt", f"127.0.0.1:{broker}", "--topic", "cell7/chatter"]
    assert run(["watch", str(recordings / "hopf.toml"), *TYPED, *stated]) == 0
    latest = time.monotonic() + 10
    while not received and time.monotonic() < latest:
        time.sleep(0.05)
    cell.disconnect()
    cell.loop_stop()
    chatter = next(message for message in received if message["state"] == "hopf")
    assert f"{chatter['time_s']:9.2f} s  hopf chatter at {chatter['frequency_hz']:.0f} Hz" in capsys.readouterr().out
    assert chatter["other_frequency_hz"] is None
    assert chatter["frequency_hz"] == pytest.approx(17.26, abs=0.3)
    assert chatter["proposed_spindle_speeds_rpm"] == pytest.approx([30 * float(str(chatter["frequency_hz"]))])
    assert chatter["spindle_speed_rpm"] == pytest.approx(RPM, rel=0.005)


@pytest.mark.parametrize("stated", [True, False])
def test_the_live_page_watches_where_teeth_and_speed_are_stated(stated: bool, recordings: Path) -> None:
    text = (recordings / "hopf.toml").read_text()
    if stated:
        text += "[cutting]\nteeth = 2\n[cut]\nspindle_speed_rpm = 800\n"
    (recordings / "page.toml").write_text(text)
    opened = open_session(recordings / "page.toml")
    watch = watched_by_page(opened.session, opened.source)
    assert (watch is not None) == stated
    if watch is not None:
        watch.close()


def test_the_live_page_shows_the_state_of_the_cut(recordings: Path) -> None:
    opened = open_session(recordings / "hopf.toml")
    watch = chatter_watch(opened.session, opened.source, CutOptions(2, 800.0), lambda announcement: None, waits=True)
    monitor = LiveMonitor(opened.source.streams, LiveSettings(), chatter=watch)
    try:
        assert status_of(monitor.snapshot(), LiveControl())["cut"] == {"state": "undecided", "line": ""}
        with Recording(recordings / "hopf.h5") as recording:
            stream = recording.stream()
            watch(Block(stream.name, 0, stream.read()))
        watch.finish()
        shown = status_of(monitor.snapshot(), LiveControl())["cut"]
        assert shown["state"] == "hopf"
        assert shown["line"].startswith("hopf chatter at")
    finally:
        monitor.close()
        watch.close()


def test_a_judgement_that_fails_is_reported_and_the_recording_is_complete(
    recordings: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(self: OnlineClassifier, samples: np.ndarray) -> list[StateChange]:
        raise ValueError("no such window")

    monkeypatch.setattr(OnlineClassifier, "add", fail)
    out = tmp_path / "seen.h5"
    assert run(["watch", str(recordings / "stable.toml"), *TYPED, "--out", str(out)]) == 1
    assert "the cut was not judged to its end: no such window" in capsys.readouterr().err
    with Recording(out) as recording:
        assert recording.complete
        assert recording.stream().n_samples == round(DURATION * RATE)


@pytest.mark.parametrize("speed", ["700", "1600"])
def test_a_wrong_speed_leaves_a_warning(speed: str, recordings: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["watch", str(recordings / "stable.toml"), "--teeth", "2", "--speed", speed]) == 0
    said = capsys.readouterr()
    assert "chatter at" not in said.out
    assert " s  " not in said.out
    assert "no verdict on this cut: " in said.err
