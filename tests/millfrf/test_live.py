"""The live page: its parts, its address, and in a real browser."""

import os
import shutil
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from acquisition import Block, Channel, Events, Recording, StreamDescription
from estimation import SpectralAccumulator, h1, settings_for
from foundation import InputError
from millfrf.__main__ import run
from millfrf.live import LiveControl, LiveMonitor, LiveServer, LiveSettings
from millfrf.live.enough import band_progress
from millfrf.live.traces import TraceBuffer

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytest.importorskip("bokeh")
RATE = 4096.0
CHANNELS = (
    Channel("fx", "force", "N", "TCP", "+X", full_scale=10.0),
    Channel("ax", "acceleration", "m/s^2", "TCP", "+X", full_scale=3.0),
)
STREAM = StreamDescription("main", RATE, 0.0, CHANNELS)


def _samples(n: int, seed: int = 0) -> np.ndarray:
    generator = np.random.default_rng(seed)
    force = generator.standard_normal(n)
    return np.stack([force, 0.5 * force + 0.1 * generator.standard_normal(n)], axis=1)


def test_traces_keep_every_peak_whatever_the_blocks() -> None:
    samples = _samples(20000)
    samples[12345, 0] = 99.0
    whole, parts = TraceBuffer(2, RATE, 5.0, 100), TraceBuffer(2, RATE, 5.0, 100)
    whole.add(samples)
    for start in range(0, 20000, 37):
        parts.add(samples[start : start + 37])
    for one, other in zip(whole.drawn(), parts.drawn(), strict=True):
        np.testing.assert_array_equal(one, other)
    times, values = whole.drawn()
    assert len(times) <= 200
    assert values[:, 0].max() == 99.0
    assert times[np.argmax(values[:, 0])] == pytest.approx(12345 / RATE, abs=5.0 / 100)


def test_enough_data_grows_with_the_averages() -> None:
    accumulator = SpectralAccumulator(CHANNELS[:1], CHANNELS[1:], RATE, settings_for(RATE, 0.25, window="hann"))
    done = []
    for seed in range(4):
        samples = _samples(int(8 * RATE), seed)
        accumulator.add(samples[:, :1], samples[:, 1:])
        bands = band_progress(h1(accumulator.result()), (0.0, 2000.0), 5, relative=0.02)
        done.append(np.mean([band.done for band in bands]))
    # H1 of y = 0.5 x + noise: sigma^2 / |H|^2 = (0.1 / 0.5)^2 / N, wanted 0.02^2: N = 100 averages
    assert done[0] == pytest.approx(accumulator.result().effective_averages / 4 / 100, rel=0.2)
    assert done == sorted(done)
    assert all(band.enough for band in band_progress(h1(accumulator.result()), (0.0, 2000.0), 5, relative=0.1))
    assert band_progress(None, (0.0, 100.0), 3, relative=0.1)[0].done == 0.0


@pytest.fixture
def monitor() -> Iterator[LiveMonitor]:
    monitor = LiveMonitor([STREAM], LiveSettings((10.0, 1000.0), 0.25, teeth=2, spindle_speed_rpm=6000.0))
    yield monitor
    monitor.close()


def test_a_monitor_shows_what_came_and_never_waits(monitor: LiveMonitor) -> None:
    samples = _samples(int(12 * RATE))
    samples[100, 1] = 3.0
    for start in range(0, len(samples), 1024):
        began = time.monotonic()
        monitor(Block("main", start, samples[start : start + 1024]))
        assert time.monotonic() - began < 0.05
        time.sleep(0.03)
    latest = time.monotonic() + 5
    while monitor.snapshot().spectra is None and time.monotonic() < latest:
        monitor(Block("main", len(samples), samples[:1024]))
        time.sleep(0.05)
    shown = monitor.snapshot()
    assert shown.tooth_passing == 200.0
    assert shown.overloads.tolist() == [0, 1]
    assert shown.spectra is not None
    assert shown.spectra.frf is not None
    assert np.median(np.abs(shown.spectra.frf.values)) == pytest.approx(0.5, rel=0.05)
    monitor(Events("spindle_speed_rpm", np.array([1.0]), np.array([3000.0])))
    assert monitor.snapshot().tooth_passing == 100.0
    monitor.restart()
    assert monitor.snapshot().overloads.tolist() == [0, 0]


def test_a_flood_is_recorded_but_not_all_drawn(monitor: LiveMonitor) -> None:
    samples = _samples(200_000)
    began = time.monotonic()
    for _ in range(200):
        monitor(Block("main", 0, samples))
    assert time.monotonic() - began < 1.0
    assert monitor.snapshot().n_skipped > 0


def test_buttons_count_only_where_they_make_sense() -> None:
    control = LiveControl()
    control.mark()
    assert control.poll() == []
    control.start()
    control.mark()
    control.mark(" entry of the\ncut ", shown_at=3.5)
    [marks] = control.poll()
    assert marks.values.tolist() == [1.0, 2.0]
    assert marks.texts == ("", "entry of the\ncut")
    assert [mark.label for mark in control.marks] == ["mark 1", "entry of the\ncut"]
    control.stop()
    control.start()
    assert control.state == "stopping"
    control.ended("done")
    control.stop()
    assert control.state == "ended"


def _status(url: str) -> int:
    try:
        with urllib.request.build_opener(urllib.request.ProxyHandler({})).open(url, timeout=10) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        return error.code


def test_the_page_is_on_loopback_or_behind_a_token(monitor: LiveMonitor) -> None:
    with LiveServer(monitor, LiveControl()) as server:
        assert server.url.startswith("http://127.0.0.1:")
        assert _status(server.url) == 200
        port = int(server.url.split(":")[2].strip("/"))
        with pytest.raises(InputError, match=r"cannot listen on 127.0.0.1 port"):
            LiveServer(monitor, LiveControl(), port=port).__enter__()
    # an address of the documentation's network (RFC 5737): not loopback; it is only built, never listened on
    assert len(LiveServer(monitor, LiveControl(), "192.0.2.1")._path) >= 33
    with LiveServer(monitor, LiveControl(), token=True) as server:
        root, token = server.url.rsplit("/", 1)
        assert len(token) >= 32
        assert _status(server.url) == 200
        assert _status(root + "/") == 404
        assert _status(root + "/" + token[:-1]) == 404


IN_A_NETWORK = """
import fcntl, http.client, socket, struct, urllib.error, urllib.request
from acquisition import Channel, StreamDescription
from millfrf.live import LiveControl, LiveMonitor, LiveServer, LiveSettings

def address(text):
    return struct.pack("HH4s8x", socket.AF_INET, 0, socket.inet_aton(text))

control = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)  # the namespace's own loopback gets a second address
fcntl.ioctl(control, 0x8916, struct.pack("16s16s8x", b"lo:1", address("192.0.2.1")))  # SIOCSIFADDR
fcntl.ioctl(control, 0x8914, struct.pack("16sH22x", b"lo", 0x41))  # SIOCSIFFLAGS: up

def status(url):
    try:
        with urllib.request.urlopen(url, timeout=10) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code

stream = StreamDescription("main", 1000.0, 0.0, (Channel("fx", "force", "N"),))
monitor = LiveMonitor([stream], LiveSettings())
with LiveServer(monitor, LiveControl(), "192.0.2.1") as server:
    root, token = server.url.rsplit("/", 1)
    upgrade = {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13"}
    upgrade |= {"Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ=="}
    print(root.rsplit(":", 1)[0], len(token) >= 32)
    print([status(url) for url in (server.url, root + "/", root, root + "/" + token[:-1], root + "/ws")])
    for origin in ("http://192.0.2.7", root):
        client = http.client.HTTPConnection("192.0.2.1", int(root.rsplit(":", 1)[1]), timeout=10)
        client.request("GET", f"/{token}/ws", headers=upgrade | {"Origin": origin})
        print(client.getresponse().status)
monitor.close()
"""


def test_on_another_address_the_page_demands_its_token() -> None:
    """In a network of its own (RFC 5737's address on a private loopback), so that nothing is reached from outside."""
    command = ["unshare", "-rn", sys.executable, "-c", IN_A_NETWORK]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    except FileNotFoundError:
        pytest.skip("no unshare: a network of its own cannot be made")
    if "unshare" in done.stderr:
        pytest.skip(f"a network of its own cannot be made here: {done.stderr.strip()}")
    assert done.returncode == 0, done.stderr
    where, pages, foreign, own = done.stdout.splitlines()
    assert where == "http://192.0.2.1 True"
    assert pages == "[200, 404, 404, 404, 404]"
    assert (foreign, own) == ("403", "101")  # a page of another site may not speak to it


@pytest.mark.parametrize("address", ["everywhere", "0.0.0.0", "::"])
def test_addresses_that_are_none_are_refused(monitor: LiveMonitor, address: str) -> None:
    with pytest.raises(InputError, match="give"):
        LiveServer(monitor, LiveControl(), address)


SESSION = """
title = "live"
band_hz = [5.0, 400.0]
[cutting]
teeth = 2
[cut]
spindle_speed_rpm = 6000
[device]
driver = "simulated"
[live]
segment_s = 0.5
"""


def test_without_any_browser_a_live_recording_ends_by_its_duration(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("millfrf.chain.measuring.live_session._LINGER", 0.1)
    (tmp_path / "s.toml").write_text("duration_s = 1.0\n" + SESSION)
    out = tmp_path / "a.h5"
    assert run(["acquire", str(tmp_path / "s.toml"), "--out", str(out), "--live", "--at-once"]) == 0
    assert "live page: http://127.0.0.1:" in capsys.readouterr().out
    with Recording(out) as recording:
        assert recording.complete
        assert recording.stream().n_samples == 2048
        assert recording.events["mark"].read()[0].size == 0
    assert run(["acquire", str(tmp_path / "s.toml"), "--out", str(out), "--live", "--live-address", "me"]) == 2


def _browser() -> str:
    found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if found is None:
        pytest.skip("no Chromium on this machine")
    return found


def test_in_a_browser_data_move_and_start_mark_and_stop_work(tmp_path: Path) -> None:
    playwright = pytest.importorskip("playwright.sync_api", reason="needs the package playwright")
    browser = _browser()
    (tmp_path / "s.toml").write_text(SESSION)
    out = tmp_path / "a.h5"
    command = [sys.executable, "-m", "millfrf", "acquire", str(tmp_path / "s.toml"), "--out", str(out), "--live"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        url = next(line.split()[-1] for line in process.stdout if "live page" in line)
        with playwright.sync_playwright() as driver:
            started = driver.chromium.launch(executable_path=browser, args=["--no-sandbox"])
            errors = _use(started.new_page(viewport={"width": 1400, "height": 1250}), url, out)
            started.close()
        said, complained = process.communicate(timeout=30)
    finally:
        process.kill()
    assert (process.returncode, complained, errors) == (0, "", [])
    with Recording(out) as recording:
        assert recording.complete
        times, marks = recording.events["mark"].read()
        assert marks.tolist() == [1.0]
        assert recording.events["mark"].read_texts() == ("entry",)
        assert 0 < times[0] < recording.stream().duration + 0.5
        assert f"{recording.stream().n_samples} samples" in said


def _use(page: "Page", url: str, out: Path) -> list[str]:
    """Start, mark, look, stop; returns the errors that the page raised."""
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto(url)
    page.get_by_text("waiting").wait_for(timeout=20_000)
    assert not out.exists()
    page.get_by_role("button", name="Start").click()
    page.get_by_text("recording", exact=True).wait_for(timeout=20_000)
    page.wait_for_function(f"({_SHOWN})().end > 0", timeout=20_000)
    first = page.evaluate(_SHOWN)["end"]
    page.get_by_placeholder("note for the next mark").fill("entry")
    page.get_by_role("button", name="Mark").click()
    page.get_by_text("1 mark (last: entry)").wait_for(timeout=20_000)
    page.wait_for_function(f"({_SHOWN})().end > {first + 1.0} && ({_SHOWN})().frf > 50", timeout=20_000)
    page.screenshot(path=str(Path(os.environ.get("MILLFRF_ARTEFACTS", out.parent)) / "live_page.png"))
    page.get_by_role("button", name="Stop").click()
    page.get_by_text("ended", exact=True).wait_for(timeout=20_000)
    return errors


_SHOWN = """() => {
  const models = [...Bokeh.documents[0]._all_models.values()];
  const traces = models.find(m => m.type == "ColumnDataSource" && m.data.xs && m.data.xs.length == 6);
  const frf = models.find(m => m.type == "ColumnDataSource" && m.data.low && m.data.y);
  const xs = traces.data.xs[0];
  return {end: xs[xs.length - 1], frf: frf.data.y.length};
}"""
