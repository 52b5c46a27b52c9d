"""The three routes in a browser: taps, sweeps and a disagreement, each from files to a page, by mouse or keyboard."""

import io
import json
import os
import subprocess
import sys
from dataclasses import replace
from math import pi
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

import millfrf
from acquisition import record
from replay_data import (
    ACETAL_CUTTER,
    SWEEP_IMMERSIONS,
    HammerCell,
    LinearSweep,
    MillingCell,
    default_structure,
    dynamometer,
    table_one_model,
    tip_accelerometers,
)
from tests.millfrf.app.conftest import served

MINUTE = 60_000.0
"""Milliseconds: longest time that a step takes on a loaded machine."""


MEASURED = "reading 'top_panel'"
"""Bokeh measures a figure that is added to a page before its first layout: it is drawn a moment later all the same."""

PICTURES = os.environ.get("MILLFRF_PICTURES")
"""Folder for pictures of the routes, such as docs/pictures; without it none is written."""


class Page:
    """A visitor of the page."""

    def __init__(self, browser: Any, url: str) -> None:
        self.page = browser.new_page(viewport={"width": 1280, "height": 1000})
        self.errors: list[str] = []
        self.page.on("console", lambda text: self.errors.append(text.text) if text.type == "error" else None)
        self.page.on("pageerror", lambda error: self.errors.append(str(error)) if MEASURED not in str(error) else None)
        self.page.set_default_timeout(MINUTE)
        self.page.goto(url)

    def tab(self, name: str) -> None:
        self.page.get_by_role("tab", name=name).click()

    def tick(self, *names: str) -> None:
        for name in names:
            self.page.get_by_role("checkbox", name=name, exact=True).check()

    def press(self, name: str, then: str, minutes: float = 3) -> None:
        self.page.get_by_role("button", name=name, exact=True).click()
        self.page.get_by_text(then).first.wait_for(timeout=minutes * MINUTE)

    def picture(self, name: str, height: int = 1000) -> None:
        """Write a picture of the upper part of the page."""
        if PICTURES is not None:
            self.page.wait_for_timeout(1500)
            clip = {"x": 0, "y": 0, "width": 1280, "height": height}
            content = self.page.screenshot(full_page=True, clip=clip)
            drawn = Image.open(io.BytesIO(content)).convert("RGB").quantize(64)
            drawn.save(Path(PICTURES) / f"app_{name}.png", optimize=True)

    def fill(self, label: str, text: str) -> None:
        field = self.page.get_by_label(label).first
        field.fill(text)
        field.press("Enter")


def _hammer(folder: Path) -> None:
    for axis in range(2):
        sensors = (dynamometer(0.001, 2000.0)[axis], tip_accelerometers(0.001)[axis])
        directions = (("TCP:+X", "TCP:+Y")[axis],)
        options = {"taps": 4, "spacing": 4.0, "sample_rate": 1024.0, "sensors": sensors, "seed": axis}
        record(HammerCell(default_structure(), directions=directions, **options), folder / f"{'xy'[axis]}.h5")


@pytest.mark.slow
def test_two_taps_to_a_sheet_and_the_session_again(browser: Any, tmp_path: Path) -> None:
    _hammer(tmp_path)
    with served(tmp_path) as url:
        page = Page(browser, url)
        page.tab("2 FRF")
        page.tick("x.h5", "y.h5")
        page.fill("Band (Hz)", "8 120")
        page.press("Run tap", "tap is done.")
        page.picture("taps", 1900)
        page.tab("3 Modes")
        page.tick("frf_taps.h5")
        page.press("Run fit", "fit is done.")
        page.press("Pick poles on the chart", "Click a pole")
        page.picture("poles", 2600)
        page.press("Save the poles", "poles are saved in poles.toml")
        page.tab("4 Cut")
        page.page.get_by_role("radio", name="model.json", exact=True).check()
        page.page.get_by_text("lowest limit").first.wait_for()
        slider = page.page.get_by_role("slider", name="Teeth").first
        before = page.page.get_by_text("lowest limit").first.inner_text()
        slider.focus()
        slider.press("ArrowRight")
        page.page.get_by_text(before).first.wait_for(state="hidden")
        page.page.get_by_text("lowest limit").first.wait_for()
        page.picture("cut")
        page.press("Save the cut and compute limits", "lobes is done.")
        page.tab("5 Sheet")
        page.press("Run report", "report is done.", 8)
        page.press("Save the session", "Saved;")
        assert page.errors == []
    assert millfrf.open(tmp_path / "cut_page.toml").teeth == 3
    sheet = (tmp_path / "sheet.png").read_bytes()
    (tmp_path / "sheet.png").unlink()
    again = subprocess.run([sys.executable, "-m", "millfrf", "repeat", "work.toml"], cwd=tmp_path, capture_output=True)
    assert again.returncode == 0, again.stderr.decode()
    assert (tmp_path / "sheet.png").read_bytes()[:8] == sheet[:8]


@pytest.mark.slow
def test_three_sweeps_to_limits(browser: Any, tmp_path: Path) -> None:
    sweep = LinearSweep(450 * pi / 30, 690 * pi / 30, 64.0)
    for number, (start, leave) in enumerate(SWEEP_IMMERSIONS.values()):
        process = replace(ACETAL_CUTTER, runout=0.0, start_angle=start * pi, exit_angle=leave * pi)
        sensors = dynamometer() + tip_accelerometers()
        cell = MillingCell(table_one_model(), process, 2e-3, sweep, 64.0, sensors=sensors, seed=number)
        record(cell, tmp_path / f"sweep_{number}.h5")
    with served(tmp_path) as url:
        page = Page(browser, url)
        page.tab("2 FRF")
        page.tab("From milling")
        page.tick("sweep_0.h5", "sweep_1.h5", "sweep_2.h5")
        page.press("Run estimate", "estimate is done.")
        page.picture("sweeps", 1900)
        page.tab("3 Modes")
        page.tick("sweep_0.h5", "sweep_1.h5", "sweep_2.h5")  # more exact than their FRF, whose segments leak
        page.fill("Band (Hz)", "15.2 45")
        page.press("Run fit", "fit is done.")
        page.tab("4 Cut")
        page.page.get_by_role("radio", name="model.json", exact=True).check()
        page.press("Save the cut and compute limits", "lobes is done.")
        assert page.errors == []
    truth = table_one_model().natural_frequencies
    fitted = millfrf.open(tmp_path / "model.json").natural_frequencies
    for frequency in truth[(truth > 16) & (truth < 44)]:
        assert abs(fitted / frequency - 1).min() < 0.02


@pytest.mark.slow
def test_a_disagreement_to_its_physics(browser: Any, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "millfrf", "demo", "--conceal", "--seed", "3", "--out", str(tmp_path / "demo")],
        capture_output=True,
    )
    assert done.returncode == 0, done.stderr.decode()
    folder = tmp_path / "demo"
    for path in (folder / "recordings").glob("*.h5"):
        path.rename(folder / path.name)
    with served(folder) as url:
        page = Page(browser, url)
        page.tab("Diagnosis")
        page.page.get_by_role("radio", name="nominal.json", exact=True).check()
        page.tick("low.h5", "mid.h5", "high.h5")
        page.fill("Save as", "by_page")
        page.press("Run diagnose", "diagnose is done.", 8)
        page.page.get_by_role("link", name="Download report.html").or_(
            page.page.get_by_role("button", name="Download report.html")
        ).first.wait_for()
        page.picture("diagnosis", 1500)
        assert page.errors == []
    by_page = json.loads((folder / "by_page" / "diagnosis.json").read_text())
    by_command = json.loads((folder / "diagnosis" / "diagnosis.json").read_text())
    assert by_page["verdict"] == by_command["verdict"]
