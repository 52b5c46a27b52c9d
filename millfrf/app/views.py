"""What a file of the folder shows on the page: a figure, a picture, or a link to open it."""

import html
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import panel as pn
import panel_material_ui as pmui

from acquisition import Recording
from millfrf.core import MillfrfError
from millfrf.core.terminal import silently
from millfrf.figures import as_data_uri
from millfrf.gate import FileKind, kind_of
from millfrf.steps.inspect import open as open_file

DRAWN = (FileKind.FRF, FileKind.MODEL, FileKind.LOBES, FileKind.RECORDING, FileKind.DIAGNOSIS)


def view_of(path: Path) -> Any:
    """Show a file that a command wrote."""
    if path.is_dir():
        return pmui.Column(*(view_of(each) for each in sorted(path.iterdir()) if each.suffix in (".html", ".json")))
    if path.suffix.lower() == ".png":
        return pn.pane.PNG(str(path), alt_text=f"Picture {path.name}", sizing_mode="scale_width", max_width=1000)
    if path.suffix.lower() in (".html", ".pdf"):
        label = f"Download {path.name}"
        return pmui.FileDownload(str(path), filename=path.name, label=label, variant="outlined", width=420)
    return pmui.Column(*_figure_of(path))


def _figure_of(path: Path) -> list[Any]:
    try:
        if kind_of(path) not in DRAWN:
            return []
        with silently():  # the commands have printed its warnings
            content = open_file(path)
            with content if isinstance(content, Recording) else nullcontext():
                figure = content.plot().get_figure()
                words = f"Figure of {path.name}: {content!r}".splitlines()[0]
    except (MillfrfError, OSError):
        return []
    tag = f'<img src="{as_data_uri(figure)}" alt="{html.escape(words)}" style="max-width:100%">'
    return [pn.pane.HTML(tag, sizing_mode="stretch_width", max_width=900)]


def preformatted(text: str, label: str, height: int | None = None) -> str:
    """Return HTML that shows text as it is, with a label for screen readers; the keyboard scrolls it."""
    if not text:
        return ""
    limit = f"max-height:{height}px;" if height else ""
    look = "margin:0;padding:8px;background:#f3f5f7;color:#111;font-size:13px"
    style = f"{look};overflow:auto;{limit}white-space:pre-wrap"
    name = html.escape(label)
    return f'<pre role="region" tabindex="0" aria-label="{name}" style="{style}">{html.escape(text)}</pre>'
