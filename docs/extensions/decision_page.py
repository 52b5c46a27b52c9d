"""Sphinx extension: all decisions on one page of the site, while the repository keeps a file for each."""

import re
from pathlib import Path
from typing import Any

_LINK = re.compile(r"\]\((?:decisions/)?(\d{4})-[\w-]+\.md\)")


def setup(app: Any) -> dict[str, Any]:
    """Connect to Sphinx."""
    app.connect("source-read", _gather)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def _gather(app: Any, page: str, source: list[str]) -> None:
    """Append the decisions to their index; lead links to the file of one to its part of that page."""
    if page == "decisions/index":
        for path in sorted((Path(app.srcdir) / "decisions").glob("0*.md")):
            app.env.note_dependency(path)
            source[0] += f"\n(decision-{path.name[:4]})=\n#{path.read_text(encoding='utf-8')}"
    source[0] = _LINK.sub(r"](#decision-\1)", source[0])
