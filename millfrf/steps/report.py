"""Step ``report``: one self-contained HTML page of the results of a test."""

from pathlib import Path
from typing import Annotated

from estimation import Frf
from millfrf.core.steps import Band, File, Reads, Writes, step
from millfrf.core.terminal import say_written, warn
from millfrf.reports.page import ReportOptions, write_report
from millfrf.reports.results_page import DEFAULT_TITLE, FigureFiles
from millfrf.stability import StabilityLobes

from .given import FigureFormat, Figures, HasFrf, HasModel, written_input


@step
def report(
    *files: Annotated[File | HasFrf | HasModel | Frf | StabilityLobes, Reads("FILES...")],
    out: Annotated[File, Writes(suffixes=(".html", ".htm"), needed=True)],
    title: str = DEFAULT_TITLE,
    band: Band | None = None,
    reference: Annotated[File | None, Reads("MODEL.json")] = None,
    geometry: Annotated[File | None, Reads("GEOMETRY")] = None,
    pdf: Annotated[File | None, Writes(suffixes=(".pdf",))] = None,
    sheet: Annotated[File | None, Writes(suffixes=(".pdf", ".png"))] = None,
    figures: Figures = None,
    figure_format: FigureFormat = "svg",
) -> tuple[str, ...]:
    """The modal-fitting report of a test: set-up, settings, modes, figures, lobes, versions.

    Parameters
    ----------
    files
        Recordings, FRFs, models, lobes, verdicts on cuts, and a cutting file; in Python also results of steps that
        wrote them by ``out``.
    out
        HTML page to write.
    title
        Title of the report.
    band : Hz
        Lowest and highest frequency of the figures; without it the band of the fit.
    reference
        Model of known dynamics to draw with the fit.
    geometry
        Positions of the points, for mode shapes: .toml, .uff or .csv.
    pdf
        The same report as PDF.
    sheet
        One A4 page for the machine: recommended cut, lobes, and what was not measured.
    figures
        Folder for each figure of the report as a file.
    figure_format
        Format of these files.

    Returns
    -------
    tuple of str
        Warnings, as they stand on the page: each once, the most serious first.

    Raises
    ------
    InputError
        A file that cannot be used; nothing is written.

    Examples
    --------
    ::

        $ millfrf report rec1.h5 frf.h5 housing.json lobes.csv --out report.html
    """
    figure_files = None if figures is None else FigureFiles(Path(figures), figure_format)
    paths = [written_input(item) for item in files]
    warnings = write_report(out, paths, ReportOptions(title, band, reference, figure_files, geometry, pdf, sheet))
    warn(warnings)
    say_written(
        [path for path in (out, sheet, pdf) if path is not None], "" if figures is None else f"the figures in {figures}"
    )
    return tuple(warnings)
