"""A page of results: a verdict first, then warnings, then sections; equal results give equal bytes."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from foundation import writing_whole_file

from ..provenance import versions
from .section import Section


@dataclass(frozen=True)
class ResultsPage:
    """What a page of results says before its sections.

    Parameters
    ----------
    kind
        Kind of the report, a few words above the title.
    title
        Title of the page.
    subtitle
        One line under the title. It holds no time of writing: equal results give equal pages.
    verdict
        Sentences that a reader wants first.
    warnings
        Sentences to know before trusting the page.
    """

    kind: str
    title: str
    subtitle: str
    verdict: tuple[str, ...]
    warnings: tuple[str, ...] = ()


def write_results_page(path: str | os.PathLike[str], page: ResultsPage, sections: Sequence[Section]) -> None:
    """Write one HTML page, figures inside, that needs no other file and no network.

    Parameters
    ----------
    path
        The page; an older one is replaced.
    page
        Title, verdict and warnings.
    sections
        Sections of the page; empty ones are left out.
    """
    environment = Environment(loader=PackageLoader("millfrf", "report"), autoescape=True, undefined=StrictUndefined)
    text = environment.get_template("results.html.j2").render(
        page=page,
        style=files("millfrf.report").joinpath("report.css").read_text(encoding="utf-8"),
        sections=[section for section in sections if not section.empty],
        versions=versions(),
    )
    with writing_whole_file(path) as temporary:
        Path(temporary).write_text(text, encoding="utf-8")
