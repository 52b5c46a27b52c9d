"""What the theme's pages lack for screen readers is added."""

import importlib
import sys
from pathlib import Path
from typing import Any

import pytest

EXTENSIONS = Path(__file__).resolve().parents[2] / "docs" / "extensions"


@pytest.fixture(scope="module")
def readable() -> Any:
    """The extension of the site."""
    sys.path.insert(0, str(EXTENSIONS))
    try:
        return importlib.import_module("readable_pages")
    finally:
        sys.path.remove(str(EXTENSIONS))


SEARCH = (
    '<button type="button" class="btn search-button-field x" title="Search" aria-label="Search" data-y>Search</button>'
)
TOGGLE = '<summary><span class="toctree-toggle" role="presentation"></span></summary>'
LINK = '<p><a class="reference internal" href="a.html"><span class="doc">A title</span></a></p>\n  <div class="t">'
HEAD = '<tr><th class="head"><p></p></th><th class="head"><p>unit</p></th></tr>'


def test_controls_links_and_columns_have_names(readable: Any) -> None:
    assert 'aria-label="Search Ctrl+K"' in readable.corrected(SEARCH)  # on narrow screens it shows a picture alone
    assert readable.corrected(TOGGLE).startswith('<summary aria-label="pages below this one">')
    assert 'href="a.html" aria-label="A title"></a>' in readable.corrected(LINK)
    assert readable.corrected(HEAD) == '<tr><td></td><th class="head"><p>unit</p></th></tr>'


def test_links_in_a_text_stay(readable: Any) -> None:
    text = '<p><a class="reference internal" href="a.html"><span class="doc">A title</span></a></p>\n<p>more</p>'
    assert readable.corrected(text) == text
