"""The page of a report in a browser: a folded section opens, and its figure zooms, under the page's own policy."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from millfrf.figures import lobes_figure, zoomed_limits
from millfrf.reports.results_page import ResultsPage, write_results_page
from millfrf.reports.section import Section, picture_of
from millfrf.stability import StabilityLobes

RPM = np.linspace(1000.0, 3000.0, 50)


def _written(folder: Path) -> Path:
    depths = 1e-3 * (2 + np.cos(RPM / 100))
    lobes = StabilityLobes(RPM * np.pi / 30, depths, np.full(50, 18.0), ("hopf",) * 50, "certified")
    picture = picture_of(lobes_figure({"a": lobes}), "Limits.", "Limits over speed", zoomed=zoomed_limits({"a": lobes}))
    page = ResultsPage("Kind", "Title", "Made by", ("Cut 1 mm deep.",))
    write_results_page(folder / "page.html", page, [Section("Lobes", pictures=(picture,))])
    return folder / "page.html"


@pytest.mark.slow
@pytest.mark.parametrize("address", ["", "#section-1"])
def test_a_section_opens_and_its_figure_zooms(tmp_path: Path, address: str) -> None:
    playwright = pytest.importorskip("playwright.sync_api", reason="needs the package playwright")
    browser = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if browser is None:
        pytest.skip("no Chromium on this machine")
    with playwright.sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        page, errors = started.new_page(), list[str]()
        page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(_written(tmp_path).as_uri() + address)
        if not address:
            assert page.locator("figure").first.is_hidden()
            page.click("summary:has(#section-1)")
        page.wait_for_selector("figure.zoomed .plot canvas, figure.zoomed .plot > *", timeout=60_000)
        page.get_by_role("button", name="Zoom in on spindle speed").click()
        started.close()
    assert not errors
