"""`millfrf report`: one self-contained HTML page of whatever files are given."""

from pathlib import Path
from typing import Annotated

import typer

from millfrf.core.terminal import say

from ..options import Band, FigureFormat, Figures, Output, check_band, check_output


def report(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILES...", help="Recordings, FRFs, models, lobes, verdicts, cutting file.")
    ],
    out: Output,
    title: Annotated[str, typer.Option("--title", help="Title of the report.")] = "In-process FRF and modal fit",
    band: Band = None,
    reference: Annotated[
        Path | None, typer.Option("--reference", metavar="MODEL.json", help="Known dynamics to draw beside the fit.")
    ] = None,
    geometry: Annotated[
        Path | None,
        typer.Option("--geometry", metavar="FILE", help="Places of the points, for mode shapes: .toml, .uff or .csv."),
    ] = None,
    pdf: Annotated[
        Path | None, typer.Option("--pdf", metavar="FILE.pdf", help="The same report as PDF, beside the page.")
    ] = None,
    figures: Figures = None,
    figure_format: FigureFormat = "svg",
) -> None:
    """The modal-fitting report of a test: set-up, settings, modes, figures, lobes, versions."""
    from millfrf.core.progress import bar
    from millfrf.report.page import ReportOptions, write_report
    from millfrf.report.results_page import asked_figures

    check_output(out, (".html", ".htm"), files)
    if pdf is not None:
        check_output(pdf, (".pdf",), files)
    options = ReportOptions(title, check_band(band), reference, asked_figures(figures, figure_format), geometry, pdf)
    for doubt in write_report(out, files, options, bar):
        say(f"warning: {doubt}")
    written = [str(one) for one in (out, pdf) if one is not None]
    say(f"wrote {' and '.join(written)}" + ("" if figures is None else f"; the figures in {figures}"))
