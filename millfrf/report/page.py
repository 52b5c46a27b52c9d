"""Put the sections together and write the page."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from foundation import writing_whole_file
from modal_fit import ModalModel, read_modal_model

from ..file_kinds import MODEL
from ..gate import (
    check_frf,
    check_model,
    check_model_reciprocity,
    check_reciprocity,
    doubts_of,
    stored_doubts,
)
from ..progress import Watch, silent
from ..provenance import sha256, versions
from .collection import Collected, SourceFile, collect
from .sections.chatter import chatter_in_brief, chatter_section
from .sections.comparison import comparison_section
from .sections.frfs import frf_section
from .sections.hammer import hammer_section
from .sections.measurement import channel_section, file_section, settings_section, setup_section
from .sections.reciprocity import reciprocity_section
from .sections.results import input_section, mode_section
from .sections.stability import stability_findings


@dataclass(frozen=True)
class ReportOptions:
    """Options of a report.

    Parameters
    ----------
    title
        Title of the page.
    band : Hz
        Frequency axis of its figures; None: chosen by the fit.
    reference
        Model file with known dynamics to draw beside the measured ones.
    """

    title: str = "In-process FRF and modal fit"
    band: tuple[float, float] | None = None
    reference: str | os.PathLike[str] | None = None


def write_report(
    path: str | os.PathLike[str],
    paths: Sequence[str | os.PathLike[str]],
    options: ReportOptions | None = None,
    watch: Watch = silent,
) -> list[str]:
    """Write one HTML page, figures inside, that needs no other file and no network.

    Returns
    -------
    list of str
        Doubts about files that do not belong together; they stand on the page too.

    Raises
    ------
    InputError
        A file that cannot be used; nothing is written.
    """
    collected = collect(paths)
    text = report_text(collected, options or ReportOptions(), watch)
    with writing_whole_file(path) as temporary:
        Path(temporary).write_text(text, encoding="utf-8")
    return list(collected.doubts)


def report_text(collected: Collected, options: ReportOptions, watch: Watch = silent) -> str:
    """The page as text."""
    reference = None if options.reference is None else read_modal_model(options.reference)
    channels, concerns = channel_section(collected, watch)
    with watch("stability"):
        stability = stability_findings(_with_reference(collected, options, reference))
    sections = (
        mode_section(collected),
        comparison_section(collected),
        stability.section,
        chatter_section(collected),
        frf_section(collected, options.band, reference),
        reciprocity_section(collected),
        input_section(collected, options.band, watch),
        settings_section(collected),
        hammer_section(collected),
        setup_section(collected),
        channels,
        file_section(collected),
    )
    environment = Environment(loader=PackageLoader("millfrf", "report"), autoescape=True, undefined=StrictUndefined)
    return environment.get_template("report.html.j2").render(
        title=options.title,
        written_at=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        style=files("millfrf.report").joinpath("report.css").read_text(encoding="utf-8"),
        brief=[*_in_brief(collected), *stability.brief, *chatter_in_brief(collected)],
        warnings=_warnings(collected, [*stability.warnings, *concerns]),
        sections=[section for section in sections if not section.empty],
        versions=versions(),
    )


def _with_reference(collected: Collected, options: ReportOptions, reference: ModalModel | None) -> Collected:
    """The reference among the models, so that lobes drawn from it are known."""
    if reference is None or options.reference is None:
        return collected
    path = Path(options.reference)
    file = SourceFile(path, MODEL, sha256(path), {})
    return replace(collected, models=(*collected.models, (file, reference)))


def _in_brief(collected: Collected) -> list[str]:
    """The modes in a sentence."""
    sentences = []
    for file, model in collected.models[-1:]:
        modes = ", ".join(
            f"{frequency:.2f} Hz ({100 * zeta:.2f} %)"
            for frequency, zeta in zip(model.natural_frequencies, model.damping_ratios, strict=True)
        )
        sentences.append(f"{file.path.name} has {len(model.poles)} modes: {modes}.")
    return sentences


def _warnings(collected: Collected, concerns: Sequence[str]) -> list[str]:
    """Everything a reader should know before trusting the figures, each once."""
    found = [
        f"{file.path.name}: {warning}" for file in collected.files for warning in file.provenance.get("warnings", [])
    ]
    found += [f"{file.path.name}: {warning}" for file, lobes in collected.lobes for warning in lobes.warnings]
    found += [doubt for file, frf in collected.frfs for doubt in doubts_of(check_frf, frf, file.path.name)]
    found += [doubt for file, model in collected.models for doubt in doubts_of(check_model, model, file.path.name)]
    found += [doubt for file, frf in collected.frfs for doubt in check_reciprocity(frf, file.path.name)]
    found += [doubt for file, model in collected.models for doubt in check_model_reciprocity(model, file.path.name)]
    found += [doubt for file, _ in collected.models for doubt in stored_doubts(file.path)]
    return list(dict.fromkeys([*collected.doubts, *found, *concerns]))
