"""Report page of a measurement: assembly of the sections, and output."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from estimation import read_geometry
from millfrf.core.progress import progress
from millfrf.core.provenance import edits_of, sha256, versions
from millfrf.core.terminal import grouped
from millfrf.gate import (
    FileKind,
    check_frf,
    check_model,
    check_model_reciprocity,
    check_reciprocity,
    stored_warnings,
    warnings_of,
)
from modal_fit import ModalModel, read_modal_model

from .collection import Collected, SourceFile, collect
from .paper import write_results_pdf
from .results_page import DEFAULT_TITLE, FigureFiles, ResultsPage, write_results_page
from .section import Section
from .sections.frfs import frf_section
from .sections.measurement import (
    channel_section,
    file_section,
    hammer_section,
    reciprocity_section,
    settings_section,
    setup_section,
)
from .sections.results import comparison_section, input_section, mode_section
from .sections.stability import StabilityFindings, chatter_in_brief, chatter_section, stability_findings
from .sheet import write_sheet


@dataclass(frozen=True)
class ReportOptions:
    """Options of a report.

    Parameters
    ----------
    title
        Title of the page.
    band : Hz
        Frequency axis of its figures; None: chosen from the band of the fit.
    reference
        Model file with known dynamics, drawn for comparison.
    geometry
        File of a geometry on which mode shapes are drawn: TOML, UFF (datasets 15, 2411, 82) or CSV; a TOML may also be
        given among the other files.
    pdf
        The same report as PDF; None: no such file.
    figures
        Folder and format in which each figure is written as a file too; None: no files.
    sheet
        One A4 page with the recommended cut, ``.pdf`` or ``.png``; None: no such file.
    """

    title: str = DEFAULT_TITLE
    band: tuple[float, float] | None = None
    reference: str | os.PathLike[str] | None = None
    figures: FigureFiles | None = None
    geometry: str | os.PathLike[str] | None = None
    pdf: str | os.PathLike[str] | None = None
    sheet: str | os.PathLike[str] | None = None


def write_report(
    path: str | os.PathLike[str],
    paths: Sequence[str | os.PathLike[str]],
    options: ReportOptions | None = None,
) -> list[str]:
    """Write one self-contained HTML page that needs no other file and no network.

    Returns
    -------
    list of str
        Warnings, as they stand on the page.

    Raises
    ------
    InputError
        A file that cannot be used; nothing is written.
    """
    chosen = options or ReportOptions()
    report = report_of(_with_geometry(collect(paths, chosen.reference), chosen), chosen)
    if chosen.sheet is not None:
        write_sheet(chosen.sheet, report.page, report.stability)
    write_results_page(path, report.page, report.sections, chosen.figures)
    if chosen.pdf is not None:
        with progress("PDF"):
            write_results_pdf(chosen.pdf, report.page, [section for section in report.sections if not section.empty])
    return list(report.page.warnings)


@dataclass(frozen=True)
class Report:
    """Head, sections and stability of a report."""

    page: ResultsPage
    sections: tuple[Section, ...]
    stability: StabilityFindings


def report_of(collected: Collected, options: ReportOptions) -> Report:
    """Make head and sections of the report.

    Parameters
    ----------
    collected
        Files of the report.
    options
        Title, band and reference.
    """
    reference = None if options.reference is None else read_modal_model(options.reference)
    channels, signal_warnings = channel_section(collected)
    with progress("stability"):
        stability = stability_findings(_with_reference(collected, options, reference))
    frfs = frf_section(collected, options.band, reference)
    picture, frfs = (stability.picture, frfs) if stability.picture is not None else frfs.without_first_picture()
    sections = (
        stability.section,
        chatter_section(collected),
        mode_section(collected),
        comparison_section(collected),
        frfs,
        reciprocity_section(collected),
        input_section(collected, options.band),
        settings_section(collected),
        hammer_section(collected),
        setup_section(collected),
        channels,
        file_section(collected),
    )
    page = ResultsPage(
        "Modal-fitting report",
        options.title,
        f"Written {datetime.now(UTC):%Y-%m-%d %H:%M} UTC by millfrf {versions()['millfrf']}",
        (*stability.answer, *chatter_in_brief(collected), *_in_brief(collected)),
        tuple(_warnings(collected, stability.warnings, signal_warnings)),
        clear="No warning from estimation, fit or channel levels.",
        picture=picture,
    )
    return Report(page, sections, stability)


def _with_geometry(collected: Collected, options: ReportOptions) -> Collected:
    """Add the geometry that the options name, before the geometries among the files."""
    if options.geometry is None:
        return collected
    geometry, path = read_geometry(options.geometry), Path(options.geometry)
    file = SourceFile(path, FileKind.GEOMETRY, sha256(path), {})
    geometries = ((file, geometry), *collected.geometries)
    return replace(collected, files=(*collected.files, file), geometries=geometries)


def _with_reference(collected: Collected, options: ReportOptions, reference: ModalModel | None) -> Collected:
    """Add the reference to the models, so that lobes computed from it can be checked."""
    if reference is None or options.reference is None:
        return collected
    path = Path(options.reference)
    file = SourceFile(path, FileKind.MODEL, sha256(path), {})
    return replace(collected, models=(*collected.models, (file, reference)))


MOST_MODES = 6  # modes that the head of the page lists


def _in_brief(collected: Collected) -> list[str]:
    """Describe the modes in one sentence."""
    sentences = []
    for _, model in _leading_models(collected):
        modes = [
            f"{frequency:.2f} Hz ({100 * zeta:.2f} %)"
            for frequency, zeta in zip(model.natural_frequencies, model.damping_ratios, strict=True)
        ]
        listed = ", ".join(modes[:MOST_MODES]) + (" and further ones" if len(modes) > MOST_MODES else "")
        sentences.append(f"{len(modes)} mode{'s' if len(modes) > 1 else ''}: {listed}.")
    return sentences


def _leading_models(collected: Collected) -> list[tuple[SourceFile, ModalModel]]:
    """Return a list with the model for the head of the page: the last model with lobes, else the last model."""
    drawn = [pair for pair in collected.models if any(lobes.made_from(pair[0]) for lobes, _ in collected.lobes)]
    return (drawn or list(collected.models))[-1:]


def _warnings(collected: Collected, others: Sequence[str], signals: Sequence[str]) -> list[str]:
    """Collect all doubts, each once: those of the limits first, then of lobes, models, FRFs, and signals."""
    texts = [*others, *collected.doubts]
    texts += [f"{file.path.name}: {warning}" for file, lobes in collected.lobes for warning in lobes.warnings]
    texts += [text for file, _ in collected.models for text in stored_warnings(file.path)]
    texts += [f"{file.path.name}: {edits}" for file in collected.files if (edits := edits_of(file.path))]
    texts += [
        f"{file.path.name}: {warning}" for file in collected.files for warning in file.provenance.get("warnings", [])
    ]
    texts += [text for file, frf in collected.frfs for text in warnings_of(check_frf, frf, file.path.name)]
    texts += [text for file, model in collected.models for text in warnings_of(check_model, model, file.path.name)]
    texts += [text for file, frf in collected.frfs for text in check_reciprocity(frf, file.path.name)]
    texts += [text for file, model in collected.models for text in check_model_reciprocity(model, file.path.name)]
    return grouped([*texts, *signals])
