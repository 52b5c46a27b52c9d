"""The page that an engineer reads after a diagnosis."""

import os
from collections.abc import Callable
from functools import partial

from millfrf.cutting import MillingProcess
from millfrf.mismatch import StructureDiagnosis, in_processes

from ..collection_paused import collection_paused
from ..pages import FigureFiles, ResultsPage, write_results_page
from ..section import Section
from .behaviour_section import behaviour_section
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
from .made_when import made_when


def write_diagnosis_report(
    path: str | os.PathLike[str],
    diagnosis: StructureDiagnosis,
    model_name: str = "",
    process: MillingProcess | None = None,
    *,
    dated: bool = True,
    figures: FigureFiles | None = None,
) -> None:
    """Write one HTML page, figures inside, that needs no other file and no network.

    Parameters
    ----------
    path
        File of the page.
    diagnosis
        Diagnosis of a structure, with its fits and maps.
    model_name
        Name of the nominal model, for the title.
    process
        Milling process for the lobes; None: one that is assumed.
    dated
        Whether the page tells when it was written; without, equal input gives equal bytes.
    figures
        Folder and format in which each figure is written as a file too; None: no files.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    with collection_paused():
        sections = (number_section(diagnosis), *_drawn_sections(diagnosis, process), candidate_section(diagnosis))
        names = ", ".join(one.recording.name for one in diagnosis.details.recordings)
        page = ResultsPage(
            "Diagnosis of a model against recordings",
            f"{model_name or 'Nominal model'} against {names}",
            made_when(dated=dated),
            (verdict_sentence(diagnosis),),
            tuple(warnings(diagnosis)),
            answers(diagnosis),
        )
        write_results_page(path, page, sections, figures)


def _drawn_sections(diagnosis: StructureDiagnosis, process: MillingProcess | None) -> list[Section]:
    """Sections with figures, drawn side by side, the longest first."""
    makers: list[Callable[[], Section]] = [
        lambda: if_possible(lambda: held_out_section(diagnosis), "On data that was not fitted"),
        partial(location_section, diagnosis),
        lambda: if_possible(lambda: diagnosis_lobes_section(diagnosis, process), "What it does to the lobes"),
        lambda: if_possible(lambda: law_section(diagnosis), "The measured force of the joint"),
        partial(growth_section, diagnosis),
        partial(behaviour_section, diagnosis),
    ]
    held_out, location, lobes, law, growth, behaviour = in_processes(makers)
    return [behaviour, law, held_out, lobes, location, growth]
