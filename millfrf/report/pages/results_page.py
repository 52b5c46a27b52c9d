"""A page of results: a verdict first, then warnings, contents and sections; equal results give equal bytes."""

import base64
import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from millfrf.core import writing_whole_file
from millfrf.figures import browser_library

from ...provenance import versions
from ..section import Section
from .figures_written import FigureFiles, pictures_of, write_figures
from .table_columns import of_numbers


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
        One line under the title. Without a time of writing, equal results give equal pages.
    verdict
        Sentences that a reader wants first.
    warnings
        Sentences to know before trusting the page.
    answers
        Questions, each with the sentences that answer it; they follow the verdict.
    verdict_title, warnings_title
        Headings of verdict and warnings.
    clear
        Sentence in place of warnings, where there is none; may be empty.
    """

    kind: str
    title: str
    subtitle: str
    verdict: tuple[str, ...]
    warnings: tuple[str, ...] = ()
    answers: tuple[tuple[str, tuple[str, ...]], ...] = ()
    verdict_title: str = "Verdict"
    warnings_title: str = "Before you trust it"
    clear: str = ""


def page_text(page: ResultsPage, sections: Sequence[Section]) -> str:
    """The page as text: figures, style and script inside, no address of another file.

    The page forbids its browser to load anything (content security policy), and to run any script but its own.

    Parameters
    ----------
    page
        Title, verdict, answers and warnings.
    sections
        Sections of the page; empty ones are left out.
    """
    environment = Environment(
        loader=PackageLoader("millfrf.report", "pages"), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    environment.globals["of_numbers"] = of_numbers
    environment.filters["in_script"] = _in_script
    pictures = list(pictures_of(sections))
    scripts = [_own("report.js")]
    if any(picture.moving for picture in pictures):
        scripts.append(_own("shapes.js"))
    if any(picture.zoomed for picture in pictures):
        scripts += [browser_library(), _own("plots.js")]
    return environment.get_template("page.html.j2").render(
        page=page,
        style=_own("report.css"),
        scripts=scripts,
        policy=_policy(scripts),
        sections=[section for section in sections if not section.empty],
        versions=versions(),
    )


def write_results_page(
    path: str | os.PathLike[str],
    page: ResultsPage,
    sections: Sequence[Section],
    figures: FigureFiles | None = None,
) -> list[Path]:
    """Write one HTML page, figures inside, that needs no other file and no network.

    Parameters
    ----------
    path
        The page; an older one is replaced.
    page
        Title, verdict and warnings.
    sections
        Sections of the page; empty ones are left out.
    figures
        Folder and format in which each figure is written as a file too; None: no files.

    Returns
    -------
    list of Path
        Files of figures.
    """
    text = page_text(page, sections)
    written = [] if figures is None else write_figures(figures, sections)
    with writing_whole_file(path) as temporary:
        Path(temporary).write_text(text, encoding="utf-8")
    return written


def _in_script(text: str) -> Markup:
    """JSON that cannot end the element in which it stands."""
    return Markup(text.replace("<", "\\u003c"))


def _own(name: str) -> str:
    return files("millfrf.report.pages").joinpath(name).read_text(encoding="utf-8")


def _policy(scripts: Sequence[str]) -> str:
    """Content security policy: nothing is loaded, only these scripts run, styles and pictures stand in the page."""
    hashes = (base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii") for script in scripts)
    allowed = " ".join(f"'sha256-{one}'" for one in hashes)
    return f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data:; base-uri 'none'"
