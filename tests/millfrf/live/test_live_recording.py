"""Recording with the live page, and the page in a real browser."""

import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from acquisition import Channel, Recording, RecordingWriter, StreamDescription
from millfrf.command_line import run
from millfrf.live.control import LiveControl
from millfrf.live.monitor import LiveMonitor, LiveSettings
from millfrf.steps.recording.acquire import _preview, open_session

if TYPE_CHECKING:
    from playwright.sync_api import Page

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
    monkeypatch.setattr("millfrf.steps.recording.acquire._LINGER", 0.1)
    (tmp_path / "s.toml").write_text("duration_s = 1.0\n" + SESSION)
    out = tmp_path / "a.h5"
    assert run(["acquire", str(tmp_path / "s.toml"), "--out", str(out), "--live", "--at-once"]) == 0
    assert "live page: http://127.0.0.1:" in capsys.readouterr().out
    with Recording(out) as recording:
        assert recording.complete
        assert recording.stream().n_samples == 2048
        assert recording.events["mark"].read()[0].size == 0
    assert run(["acquire", str(tmp_path / "s.toml"), "--out", str(out), "--live", "--live-address", "me"]) == 2


@pytest.mark.long
def test_a_replay_that_ends_is_shown_again_until_start(tmp_path: Path) -> None:
    streams = [StreamDescription("main", 2048.0, 0.0, (Channel("f", "force", "N", "T", "+X"),))]
    with RecordingWriter(tmp_path / "short.h5", streams) as writer:
        writer.append("main", np.ones((1024, 1)))
    (tmp_path / "s.toml").write_text('[device]\ndriver = "replay"\nfile = "short.h5"\n')
    opened = open_session(tmp_path / "s.toml")
    control, monitor = LiveControl(), LiveMonitor(opened.source.streams, LiveSettings())
    starter = threading.Timer(2.0, control.start)
    starter.start()
    began = time.monotonic()
    assert _preview(opened.source, monitor, control)
    assert time.monotonic() - began > 1.9
    monitor.close()


def _browser() -> str:
    result = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if result is None:
        pytest.skip("no Chromium on this machine")
    return result


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
    page.on("console", lambda said: errors.append(said.text) if said.type == "error" else None)
    page.goto(url)
    page.get_by_text("waiting").wait_for(timeout=20_000)
    assert not out.exists()
    page.get_by_role("button", name="Start").click()
    page.get_by_text("recording", exact=True).wait_for(timeout=20_000)
    # the page already shows data before the first recorded sample: a mark made now could lie before it
    begun = _until(page, lambda shown: shown["end"] > 0)["end"]
    first = _until(page, lambda shown: shown["end"] > begun + 0.5)["end"]
    page.get_by_placeholder("note for the next mark").fill("entry")
    page.get_by_role("button", name="Mark").click()
    page.get_by_text("1 mark (last: entry)").wait_for(timeout=20_000)
    _until(page, lambda shown: shown["end"] > first + 1.0)
    page.screenshot(path=str(Path(os.environ.get("MILLFRF_ARTEFACTS", out.parent)) / "live_page.png"))
    page.get_by_role("button", name="Stop").click()
    page.get_by_text("ended", exact=True).wait_for(timeout=20_000)
    return errors


def _until(page: "Page", wanted: Callable[[dict[str, float]], bool]) -> dict[str, float]:
    """What the page shows, once it is what is wanted; asked from outside, since its policy lets nobody evaluate."""
    latest = time.monotonic() + 20
    while not wanted(shown := page.evaluate(_SHOWN)):
        assert time.monotonic() < latest, shown
        page.wait_for_timeout(100)
    return dict(shown)


_SHOWN = """() => {
  const named = (name) => Bokeh.documents.map((doc) => doc.get_model_by_name(name)).find((model) => model);
  const xs = named("traces.data").data.xs;
  const last = xs.length ? xs[0][xs[0].length - 1] : 0;
  return {end: last, frf: named("magnitude.data").data.y.length};
}"""


SCRIPTS = (
    "<script>document.title='attacked'</script>",
    "<img src=x onerror=\"document.title='attacked'\">",
    "</script><svg onload=document.title='attacked'>",
    '"><iframe srcdoc="<script>parent.document.title=\'attacked\'</script>">',
    "javascript:document.title='attacked'",
    "$$\\href{javascript:document.title='attacked'}{x}$$",
)


def test_names_of_a_foreign_recording_are_text(tmp_path: Path) -> None:
    """Names that are scripts are replayed, seen, chosen and marked: none runs, none becomes an element."""
    playwright = pytest.importorskip("playwright.sync_api", reason="needs the package playwright")
    browser = _browser()
    channels = [Channel(name, "force", "N", f"N{k}", "+X") for k, name in enumerate(SCRIPTS[:3])]
    channels += [Channel(name, "acceleration", "m/s^2", f"N{k}", "+Y") for k, name in enumerate(SCRIPTS[3:])]
    streams = [StreamDescription("main", 2048.0, 0.0, tuple(channels))]
    with RecordingWriter(tmp_path / "foreign.h5", streams, title=SCRIPTS[0]) as writer:
        writer.append("main", np.random.default_rng(0).standard_normal((30 * 2048, 6)))
    (tmp_path / "s.toml").write_text('[device]\ndriver = "replay"\nfile = "foreign.h5"\nspeed = 2.0\n')
    command = [sys.executable, "-m", "millfrf", "acquire", "s.toml", "--out", "a.h5", "--live", "--at-once"]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        url = next(line.split()[-1] for line in process.stdout if "live page" in line)
        with playwright.sync_playwright() as driver:
            started = driver.chromium.launch(executable_path=browser, args=["--no-sandbox"])
            page = started.new_page(viewport={"width": 1400, "height": 1250})
            errors: list[str] = []
            page.on("console", lambda said: errors.append(said.text) if said.type == "error" else None)
            page.goto(url)
            page.get_by_text("recording", exact=True).wait_for(timeout=20_000)
            page.get_by_placeholder("note for the next mark").fill(SCRIPTS[1])
            page.get_by_role("button", name="Mark").click()
            page.get_by_text("1 mark (last: <img").wait_for(timeout=20_000)
            page.get_by_text("Spectra of").click()
            page.get_by_role("checkbox", name=SCRIPTS[3]).uncheck()
            page.locator("#excitation").select_option(label=SCRIPTS[1])
            _until(page, lambda shown: shown["end"] > 6.0)
            seen = page.evaluate(_ELEMENTS)
            title = page.title()
            started.close()
    finally:
        process.kill()
        process.wait()
    assert (title, errors) == ("millfrf live", [])
    assert seen == {"img": 0, "iframe": 0, "svg": 0, "script": 2}


_ELEMENTS = """() => {
  const every = (root) => [...root.querySelectorAll("*")].flatMap(
    (one) => [one, ...(one.shadowRoot ? every(one.shadowRoot) : [])]);
  const count = (name) => every(document).filter((one) => one.localName == name).length;
  return {img: count("img"), iframe: count("iframe"), svg: count("svg"), script: count("script")};
}"""
