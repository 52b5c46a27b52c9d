"""The page that an engineer reads after a diagnosis."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from cutting import MillingProcess
from estimation import BandRecording
from foundation import writing_whole_file
from mismatch import Diagnosis
from mismatch.inference.process_pool import side_by_side
from mismatch.location.locate import located
from mismatch.location.residual_view import ResidualView, residual_view
from mismatch.location.spindle_orders import SpindleSpeed

from ...provenance import versions
from ..section import Section
from .diagnosis_answers import answers, verdict_sentence, warnings
from .diagnosis_lobes import diagnosis_lobes_section
from .diagnosis_sections import (
    candidate_section,
    growth_section,
    held_out_section,
    if_possible,
    law_section,
    location_section,
    number_section,
)


def with_location(
    diagnosis: Diagnosis, trials: Sequence[BandRecording], speeds: Mapping[str, SpindleSpeed]
) -> tuple[Diagnosis, ResidualView]:
    """Fill in ``located`` of a diagnosis, and make the maps for the page.

    Parameters
    ----------
    diagnosis
        Diagnosis without locations.
    trials
        Recordings as they were read.
    speeds
        Spindle speed by name of the recording, where it is known.
    """
    view = residual_view(diagnosis, trials)
    full = replace(diagnosis, located=located(view, speeds))
    return full, replace(view, diagnosis=full)


def write_diagnosis_report(
    path: str | os.PathLike[str], view: ResidualView, model_name: str = "", process: MillingProcess | None = None
) -> None:
    """Write one HTML page, figures inside, that needs no other file and no network.

    Parameters
    ----------
    path
        File of the page.
    view
        Maps of a located diagnosis (:func:`with_location`).
    model_name
        Name of the nominal model, for the title.
    process
        Milling process for the lobes; None: one that is assumed.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    text = report_text(view, model_name, process)
    with writing_whole_file(path) as temporary:
        Path(temporary).write_text(text, encoding="utf-8")


def _drawn_sections(view: ResidualView, process: MillingProcess | None) -> list[Section]:
    """Sections with figures, drawn side by side, the longest first."""
    diagnosis = view.diagnosis
    makers: list[Callable[[], Section]] = [
        lambda: if_possible(lambda: held_out_section(diagnosis), "On data that was not fitted"),
        partial(location_section, view),
        lambda: if_possible(lambda: diagnosis_lobes_section(diagnosis, process), "What it does to the lobes"),
        lambda: if_possible(lambda: law_section(diagnosis), "The measured force of the joint"),
        partial(growth_section, diagnosis),
    ]
    held_out, location, lobes, law, growth = side_by_side(makers)
    return [law, held_out, lobes, location, growth]


def report_text(view: ResidualView, model_name: str = "", process: MillingProcess | None = None) -> str:
    """The page as text."""
    diagnosis = view.diagnosis
    sections = (number_section(diagnosis), *_drawn_sections(view, process), candidate_section(diagnosis))
    names = ", ".join(one.recording.name for one in diagnosis.lines)
    environment = Environment(loader=PackageLoader("millfrf", "report"), autoescape=True, undefined=StrictUndefined)
    return environment.get_template("diagnosis.html.j2").render(
        title=f"{model_name or 'Nominal model'} against {names}",
        written_at=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        style=files("millfrf.report").joinpath("report.css").read_text(encoding="utf-8"),
        verdict=verdict_sentence(diagnosis),
        answers=answers(diagnosis),
        warnings=warnings(diagnosis),
        sections=[section for section in sections if not section.empty],
        versions=versions(),
    )
