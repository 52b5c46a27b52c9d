"""The search of the site shows first the page that a reader expects."""

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
EXPECTED = {
    "tap test": "hammer_tests",
    "hammer": "hammer_tests",
    "impact": "hammer_tests",
    "robot": "robot_models",
    "damping": "identification",
    "coherence": "in_process_frf",
    "helix": "stability",
    "lobes": "stability",
    "chatter": "chatter",
    "backlash": "diagnosis",
    "stabilisation": "picking_poles",
    "UFF": "importing",
}
"""Words that a reader types, and the page that comes first."""


def _keywords() -> Iterator[tuple[str, str]]:
    """Each main entry of the index in small letters, and its page."""
    for path in DOCS.glob("*.md"):
        for entries in re.findall(r"^```\{index\} (.*)$", path.read_text(encoding="utf-8"), re.MULTILINE):
            yield from ((entry.strip(" !").lower(), path.stem) for entry in entries.split(","))


def test_a_keyword_leads_to_one_page() -> None:
    """An exact main entry of the index has the largest score of Sphinx's search; two of them would compete."""
    keywords = list(_keywords())
    words = [word for word, _ in keywords]
    assert sorted(words) == sorted(set(words))
    assert {word: page for word, page in keywords if word in map(str.lower, EXPECTED)} == {
        word.lower(): page for word, page in EXPECTED.items()
    }


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The written pages without those of the code, and their index for the search."""
    pytest.importorskip("myst_parser", reason="needs the package myst-parser")
    folder = tmp_path_factory.mktemp("site")
    settings = ["-D", "html_theme=basic", "-D", "extensions=myst_parser,offline_equations,decision_page"]
    command = [sys.executable, "-m", "sphinx", "-Q", "-b", "html", *settings, str(DOCS), str(folder / "html")]
    subprocess.run([*command, "-d", str(folder / "doctrees")], check=True)
    return folder / "html"


@pytest.fixture(scope="module")
def page() -> Iterator[Any]:
    """A page of a browser that reads files."""
    playwright = pytest.importorskip("playwright.sync_api", reason="needs the package playwright")
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        pytest.skip("no Chromium on this machine")
    with playwright.sync_playwright() as runner:
        opened = runner.chromium.launch(executable_path=browser, args=["--no-sandbox", "--disable-gpu"])
        yield opened.new_page()
        opened.close()


@pytest.mark.slow
@pytest.mark.parametrize("words", EXPECTED)
def test_the_expected_page_comes_first(words: str, site: Path, page: Any) -> None:
    page.goto(f"{(site / 'search.html').as_uri()}?q={words}")
    first = page.wait_for_selector("ul.search > li > a").get_attribute("href")
    assert first.partition("#")[0] == f"{EXPECTED[words]}.html"
