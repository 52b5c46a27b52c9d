"""Sphinx extension: what the theme's pages lack for screen readers is added when they are written."""

import re
from pathlib import Path
from typing import Any

_SEARCH = re.compile(r'(<button type="button" class="btn search-button-field[^>]*?) title="Search" aria-label="Search"')
_TOGGLE = re.compile(r'<summary><span class="toctree-toggle"')
_THUMBNAIL = re.compile(r'<a class="reference internal"( href="[^"]+")><span class="doc">([^<]+)</span></a></p>\s*<div')
_EMPTY_HEAD = re.compile(r'<th class="head">(<p>\s*</p>)?</th>')


def setup(app: Any) -> dict[str, Any]:
    """Connect to Sphinx."""
    app.connect("build-finished", _mend_pages)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def _mend_pages(app: Any, exception: Exception | None) -> None:
    """Rewrite the pages of a site that was built in order."""
    if exception is None and app.builder.format == "html":
        for path in Path(app.outdir).rglob("*.html"):
            before = path.read_text(encoding="utf-8")
            after = corrected(before)
            if after != before:
                path.write_text(after, encoding="utf-8")


def corrected(page: str) -> str:
    """The page with names for what had none.

    The name of the search button holds all that it shows, switches of the navigation say what they do, links over
    pictures of the gallery carry their title, and an empty cell is no heading of a column.
    """
    page = _SEARCH.sub(r'\1 title="Search" aria-label="Search Ctrl+K"', page)
    page = _TOGGLE.sub('<summary aria-label="pages below this one"><span class="toctree-toggle"', page)
    page = _THUMBNAIL.sub(r'<a class="reference internal"\1 aria-label="\2"></a></p>\n<div', page)
    return _EMPTY_HEAD.sub("<td></td>", page)
