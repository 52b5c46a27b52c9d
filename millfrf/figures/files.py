"""Output of figures to files, or as text for an HTML page."""

import base64
import io
import os
from pathlib import Path

from matplotlib.figure import Figure

from millfrf.core import InputError, writing_whole_file

from .gallery import SmallSvg, redrawn
from .style import house_style

_SUFFIXES = {".svg": "svg", ".png": "png", ".pdf": "pdf"}


def as_data_uri(figure: Figure, *, kind: str = "svg") -> str:
    """Encode a figure as a ``data:`` address, so that a page contains it and needs no other file."""
    buffer = io.BytesIO()
    with house_style():
        if kind == "svg":
            figure.savefig(buffer, format="svg", metadata={"Date": None})
        else:
            figure.savefig(buffer, format="png", dpi=200)
    text = base64.b64encode(buffer.getvalue()).decode("ascii")
    return f"data:image/{'svg+xml' if kind == 'svg' else 'png'};base64,{text}"


def as_png(figure: Figure | SmallSvg) -> bytes:
    """Render a figure, or a page of small panels, as PNG of 200 dpi.

    Parameters
    ----------
    figure
        Figure of matplotlib, or page of small panels.
    """
    buffer = io.BytesIO()
    drawn = redrawn(figure) if isinstance(figure, SmallSvg) else figure
    with house_style():
        drawn.savefig(buffer, format="png", dpi=200)
    return buffer.getvalue()


def save_figure(figure: Figure | SmallSvg, path: str | os.PathLike[str]) -> None:
    """Write a figure, or a page of small panels, by suffix: ``.svg``, ``.png`` (200 dpi) or ``.pdf``.

    Raises
    ------
    InputError
        Another suffix, or the folder cannot be written to.
    """
    kind = _SUFFIXES.get(Path(path).suffix.lower())
    if kind is None:
        raise InputError(f"cannot write a figure to {path}; use one of {', '.join(_SUFFIXES)}")
    if isinstance(figure, SmallSvg) and kind == "svg":
        with writing_whole_file(path) as temporary:
            Path(temporary).write_text(figure.svg(), encoding="utf-8")
        return
    drawn = redrawn(figure) if isinstance(figure, SmallSvg) else figure
    metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)  # equal figures give equal files
    with writing_whole_file(path) as temporary, house_style():
        drawn.savefig(temporary, format=kind, dpi=200, metadata=metadata)
