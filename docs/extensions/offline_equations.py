"""Sphinx extension: equations become MathML when the site is built, so that a page needs neither network nor script."""

import re
from typing import Any
from xml.etree import ElementTree

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.util import logging

_LOG = logging.getLogger(__name__)


def setup(app: Any) -> dict[str, Any]:
    """Connect to Sphinx."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def _inline(writer: Any, node: Any) -> None:
    writer.body.append(mathml(node.astext(), "inline", node))
    raise nodes.SkipNode


def _block(writer: Any, node: Any) -> None:
    """A line of its own that scrolls where it is wider than the screen; the keyboard reaches it."""
    writer.body.append('<div class="equation" tabindex="0" role="group" aria-label="equation">')
    writer.body.append(mathml(node.astext(), "block", node))
    writer.body.append("</div>\n")
    raise nodes.SkipNode


def mathml(latex: str, display: str, node: Any = None) -> str:
    """MathML of an equation; what the converter does not know is a warning, and so ends the build."""
    text = convert(" ".join(latex.split()), display=display)
    try:
        shown = "".join(ElementTree.fromstring(text).itertext())
    except ElementTree.ParseError as error:
        shown = f"\\ {error}"
    unknown = re.findall(r"\\\w*", shown)
    if unknown:
        _LOG.warning("this equation is not understood (%s): %s", unknown[0], latex, location=node)
    return text
