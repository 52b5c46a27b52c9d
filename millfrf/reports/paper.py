"""Page of results as a PDF with bookmarks, written without a browser."""

import io
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from millfrf.core import writing_whole_file
from millfrf.core.terminal import Table
from millfrf.figures import SmallSvg, as_png

from .results_page import VERDICT_TITLE, WARNINGS_TITLE, ResultsPage, of_numbers
from .section import Picture, Section

_MARGIN, _WIDTH = 14.0, 182.0  # margin and width of the text on A4, mm


def write_results_pdf(path: str | os.PathLike[str], page: ResultsPage, sections: Sequence[Section]) -> None:
    """Write a page of results as PDF, A4.

    Folded parts are printed open. Figures are images of 200 dpi; the option ``--figures`` writes vector graphics.

    Parameters
    ----------
    path
        File to write, ``.pdf``.
    page
        Title, verdict, answers and warnings.
    sections
        Sections of the page; empty ones are left out.
    """
    document = _document(page)
    shown = [section for section in sections if not section.empty]
    counts = {"figure": 0, "table": 0}
    _head(document, page, counts)
    _contents(document, shown)
    for number, section in enumerate(shown, start=1):
        document.ln(5)
        document.start_section(f"{number} {section.title}")
        _text(document, f"{number} {section.title}", 12.5, "B", 2.0)
        for sentence in section.sentences:
            _text(document, sentence)
        _parts(document, section.title, section.tables, section.pictures, counts)
        for fold in section.folds:
            _text(document, fold.title, 10.0, "B", 2.0)
            _parts(document, fold.title, fold.tables, fold.pictures, counts)
    with writing_whole_file(path) as temporary:
        Path(temporary).write_bytes(bytes(document.output()))


def _document(page: ResultsPage) -> Any:
    """Make an empty A4 document with the fonts of the figures, which contain every letter of the reports."""
    from fpdf import FPDF

    class Numbered(FPDF):  # type: ignore[misc]
        """Document with page numbers."""

        def footer(self) -> None:
            """Write the number of the page."""
            self.set_y(-11)
            self.set_font("text", "", 8)
            self.cell(0, 5, f"{self.page_no()} / {{nb}}", align="R")

    document = Numbered(format="A4")
    folder = Path(mpl.get_data_path()) / "fonts" / "ttf"
    document.add_font("text", "", folder / "DejaVuSans.ttf")
    document.add_font("text", "B", folder / "DejaVuSans-Bold.ttf")
    document.set_margins(_MARGIN, 14.0)
    document.set_auto_page_break(True, 15.0)
    document.set_title(page.title)
    document.set_lang("en")
    document.add_page()
    return document


def _text(document: Any, words: str, size: float = 9.5, style: str = "", above: float = 0.6) -> None:
    document.ln(above)
    document.set_font("text", style, size)
    document.multi_cell(0, 0.45 * size, words, align="L", new_x="LMARGIN", new_y="NEXT")


def _head(document: Any, page: ResultsPage, counts: dict[str, int]) -> None:
    _text(document, page.kind.upper(), 8.0)
    _text(document, page.title, 17.0, "B")
    _text(document, page.subtitle, 8.5)
    if page.verdict:
        _text(document, VERDICT_TITLE, 12.0, "B", 4.0)
        for sentence in page.verdict:
            _text(document, sentence)
    if page.picture is not None:
        _parts(document, "", (), (page.picture,), counts)
    for question, answer in page.answers:
        _text(document, question, 9.5, "B", 1.5)
        for sentence in answer:
            _text(document, sentence)
    if page.warnings:
        _text(document, WARNINGS_TITLE, 12.0, "B", 4.0)
        for warning in page.warnings:
            _text(document, f"•  {warning}")
    elif page.clear:
        _text(document, page.clear, above=3.0)


def _contents(document: Any, sections: Sequence[Section]) -> None:
    _text(document, "Contents", 12.0, "B", 4.0)
    for number, section in enumerate(sections, start=1):
        _text(document, f"{number} {section.title}")


def _parts(
    document: Any, heading: str, tables: Sequence[Table], pictures: Sequence[Picture], counts: dict[str, int]
) -> None:
    for table in tables:
        counts["table"] += 1
        _table(document, table, f"Table {counts['table']}. {table.title or heading}")
    for picture in pictures:
        counts["figure"] += 1
        _picture(document, picture, f"Figure {counts['figure']}. {picture.caption}")


def _table(document: Any, table: Table, caption: str) -> None:
    """Draw a table with columns as wide as their longest cells, and the headings repeated on each page."""
    document.set_font("text", "B", 7.0)  # the font of the headings, the widest
    if document.will_page_break(28.0):  # keep a caption with its first rows
        document.add_page()
    _text(document, caption, 8.5, "B", 3.0)
    document.set_font("text", "B", 7.0)
    widths = [
        min(max(document.get_string_width(row[k]) for row in (table.columns, *table.rows)), 60.0) + 4.0
        for k in range(len(table.columns))
    ]
    share = min(1.0, _WIDTH / sum(widths))
    align = ["RIGHT" if numbers else "LEFT" for numbers in of_numbers(table)]
    document.set_font("text", "", 7.0)
    layout = {
        "borders_layout": "HORIZONTAL_LINES",
        "line_height": 3.6,
        "padding": 0.5,
        "align": "LEFT",
        "text_align": tuple(align),
    }
    with document.table(width=share * sum(widths), col_widths=tuple(widths), **layout) as drawn:
        for row in (table.columns, *table.rows):
            line = drawn.row()
            for cell in row:
                line.cell(cell)


def _picture(document: Any, picture: Picture, caption: str) -> None:
    """Draw a figure with its caption, both on one page."""
    drawn = io.BytesIO(as_png(picture.figure))
    wide, high = _size(picture.figure)
    scale = min(1.0, _WIDTH / wide, 225.0 / high)
    document.set_font("text", "", 8.0)
    lines = document.multi_cell(0, 3.8, caption, dry_run=True, output="LINES")
    if document.will_page_break(scale * high + 3.8 * len(lines) + 6.0):
        document.add_page()
    document.ln(3)
    document.image(drawn, w=scale * wide, h=scale * high, alt_text=picture.alternative)
    _text(document, caption, 8.0)


def _size(figure: Figure | SmallSvg) -> tuple[float, float]:
    """Return the printed width and height, mm."""
    if isinstance(figure, SmallSvg):
        return figure.width, figure.height
    wide, high = 25.4 * figure.get_size_inches()
    return float(wide), float(high)
