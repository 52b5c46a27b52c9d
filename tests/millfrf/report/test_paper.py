"""A report as PDF: its texts, tables and pictures, letters that plain fonts lack, tables over several pages."""

from pathlib import Path

from millfrf.command_line import BAD_INPUT, run
from millfrf.core.terminal import Table
from millfrf.figures import house_style, new_figure
from millfrf.reports.paper import write_results_pdf
from millfrf.reports.results_page import ResultsPage
from millfrf.reports.section import Section, picture_of


def _written(folder: Path, rows: int) -> Path:
    with house_style():
        figure = new_figure(50.0)
        figure.subplots().plot([0, 1], [0, 1])
    table = Table("Modes ± σ", ("mode", "frequency (Hz)"), tuple((str(k), f"{k}.5 ≈ ζ") for k in range(rows)))
    section = Section("Modal model", ("m/s² and Σ|H|.",), (table,), (picture_of(figure, "A line, 90°.", "A line"),))
    page = ResultsPage("Kind", "Title <b>", "Made", ("All is well.",), ("Mind the gap.",), (("Where?", ("Here.",)),))
    path = folder / "report.pdf"
    write_results_pdf(path, page, [section, Section("Empty")])
    return path


def test_it_is_a_pdf_with_pictures_words_and_bookmarks(tmp_path: Path) -> None:
    raw = _written(tmp_path, 3).read_bytes()
    assert raw.startswith(b"%PDF")
    assert raw.count(b"/Subtype /Image") >= 1
    assert b"/Outlines" in raw
    assert b"/Alt" in raw
    assert b"/FontFile2" in raw, "letters stand in the file"


def test_a_long_table_takes_several_pages_and_repeats_its_headings(tmp_path: Path) -> None:
    short = _written(tmp_path, 3).read_bytes().count(b"/Type /Page\n")
    (tmp_path / "long").mkdir()
    long = _written(tmp_path / "long", 150).read_bytes().count(b"/Type /Page\n")
    assert long >= short + 2


def test_a_name_that_is_no_pdf_is_refused(tmp_path: Path) -> None:
    out, pdf = tmp_path / "r.html", tmp_path / "r.doc"
    assert run(["report", "nothing.h5", "--out", str(out), "--pdf", str(pdf)]) == BAD_INPUT
    assert not out.exists()
