"""HTML pages of results: answer, figure, warnings, folded sections; figures as files."""

import base64
import gzip
import hashlib
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from millfrf.core import InputError, writing_whole_file
from millfrf.core.provenance import versions
from millfrf.core.terminal import Table
from millfrf.figures import browser_library, save_figure

from .section import Picture, Section

FORMATS = ("svg", "png", "pdf")


@dataclass(frozen=True)
class FigureFiles:
    """Folder and format of the files of a page's figures.

    Parameters
    ----------
    folder
        Folder of the files, which is created if needed.
    format
        ``svg``, ``png`` (200 dpi) or ``pdf``.

    Raises
    ------
    InputError
        Another format, or a folder whose name is that of a file.
    """

    folder: Path
    format: str = "svg"

    def __post_init__(self) -> None:
        if self.format not in FORMATS:
            raise InputError(f"unknown format {self.format!r} of figures; use one of {', '.join(FORMATS)}")
        if self.folder.exists() and not self.folder.is_dir():
            raise InputError(f"cannot write figures to {self.folder}: it is a file; name a folder")
        if not self.folder.parent.is_dir():
            raise InputError(f"cannot write figures to {self.folder}: {self.folder.parent} is no folder; make it first")


def pictures_of(page: "ResultsPage", sections: Sequence[Section]) -> Iterator[Picture]:
    """Yield all pictures in the order of their numbers on the page."""
    if page.picture is not None:
        yield page.picture
    for section in sections:
        if not section.empty:
            yield from section.pictures
            for fold in section.folds:
                yield from fold.pictures


def write_figures(where: FigureFiles, page: "ResultsPage", sections: Sequence[Section]) -> list[Path]:
    """Write each figure of a page as ``figure_03_stability_lobes.svg``, numbered as on the page.

    Parameters
    ----------
    where
        Folder and format.
    page, sections
        Head and sections of the page.

    Returns
    -------
    list of Path
        Paths of the files that were written, in the order of the figures.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    where.folder.mkdir(exist_ok=True)
    written = []
    for number, picture in enumerate(pictures_of(page, sections), start=1):
        path = where.folder / f"figure_{number:02d}_{_name(picture.alternative)}.{where.format}"
        save_figure(picture.figure, path)
        written.append(path)
    return written


def _name(words: str) -> str:
    """Convert a text to a file name of at most 40 characters, lower-case letters and underscores."""
    return re.sub(r"[^a-z0-9]+", "_", words.split(":")[0].lower())[:40].strip("_")


_NUMBER = re.compile(r"[-+−±<>≤≥≈]?\s*\d[\d.,]*(e[-+]?\d+)?(%|\s.*)?$")
_NONE = {"", "-", "–", "no limit", "not resolved", "none"}  # cells in place of a number


def of_numbers(table: Table) -> list[bool]:
    """Return for each column whether all its cells are numbers or stand for a number, such as ``no limit``.

    A number may be followed by a unit or a remark.

    Examples
    --------
    >>> of_numbers(Table("", ("cause", "gain"), (("Coulomb friction", "+3.2"), ("gap", "-"))))
    [False, True]
    >>> of_numbers(Table("", ("entry", "value"), (("1:+Z / 2:+Z", "2.02e-06 m/N"),)))
    [False, True]
    """
    return [_numbers([row[column] for row in table.rows]) for column in range(len(table.columns))]


def _numbers(cells: list[str]) -> bool:
    numbers = [cell for cell in cells if cell.strip() not in _NONE and not cell.startswith("none up to")]
    return bool(cells) and all(_NUMBER.match(cell) for cell in numbers)


DEFAULT_TITLE = "FRF and modal fit"
"""Title of a report to which none is given."""


@dataclass(frozen=True)
class ResultsPage:
    """Head of a page of results, before its sections: one screen that answers.

    Parameters
    ----------
    kind
        Kind of the report, a few words above the title.
    title
        Title of the page.
    subtitle
        One line under the title. Without a time of writing, equal results give equal pages.
    verdict
        The answer, one sentence; further sentences are smaller.
    warnings
        Warnings, one sentence each, the most serious first. Three stand open (:func:`doubts_of`).
    answers
        Questions with the sentences that answer them, after the verdict.
    clear
        Sentence for a page without warnings; may be empty.
    picture
        The figure on which the answer rests; None: none.
    """

    kind: str
    title: str
    subtitle: str
    verdict: tuple[str, ...]
    warnings: tuple[str, ...] = ()
    answers: tuple[tuple[str, tuple[str, ...]], ...] = ()
    clear: str = ""
    picture: Picture | None = None


VERDICT_TITLE, WARNINGS_TITLE = "In brief", "Before you trust it"

MOST_DOUBTS = 3  # doubts that stand open


@dataclass(frozen=True)
class Doubts:
    """Warnings that stand open, and those that are folded."""

    opened: tuple[str, ...]
    folded: tuple[str, ...] = ()


_FILE = re.compile(r"\S+\.[A-Za-z]\w{0,4}: ")


def doubts_of(warnings: Sequence[str]) -> Doubts:
    """Choose three warnings that stand open: the first on each file, then further ones.

    Parameters
    ----------
    warnings
        Warnings, the most serious first.

    Examples
    --------
    >>> doubts_of(["a.csv: not verified", "a.csv: coarse", "b.json: one mode", "c.h5: hum"])
    Doubts(opened=('a.csv: not verified', 'b.json: one mode', 'c.h5: hum'), folded=('a.csv: coarse',))
    >>> doubts_of(["a.csv: not verified", "a.csv: coarse"])
    Doubts(opened=('a.csv: not verified', 'a.csv: coarse'), folded=())
    """
    first: dict[str, int] = {}
    for place, warning in enumerate(warnings):
        match = _FILE.match(warning)
        first.setdefault(warning if match is None else match[0], place)
    further = [place for place in range(len(warnings)) if place not in first.values()]
    chosen = sorted([*first.values(), *further][:MOST_DOUBTS])
    folded = (warning for place, warning in enumerate(warnings) if place not in chosen)
    return Doubts(tuple(warnings[place] for place in chosen), tuple(folded))


def page_text(page: ResultsPage, sections: Sequence[Section]) -> str:
    """Render the page as text, with all figures, styles and scripts embedded.

    Its content security policy forbids the browser to load anything, or to run a script of another origin.

    Parameters
    ----------
    page
        Title, verdict, answers and warnings.
    sections
        Sections of the page; empty ones are left out.
    """
    environment = Environment(
        loader=PackageLoader("millfrf.reports", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    environment.globals["of_numbers"] = of_numbers
    environment.filters["in_script"] = _in_script
    environment.filters["packed"] = _packed
    pictures = list(pictures_of(page, sections))
    scripts = [_own("report.js")]
    if any(picture.moving for picture in pictures):
        scripts.append(_own("shapes.js"))
    library = browser_library() if any(picture.zoomed for picture in pictures) else ""
    if library:
        scripts.append(_own("plots.js"))
    return environment.get_template("page.html.j2").render(
        page=page,
        verdict_title=VERDICT_TITLE,
        warnings_title=WARNINGS_TITLE,
        doubts=doubts_of([warning for warning in page.warnings if warning not in page.verdict]),
        style=_own("report.css"),
        scripts=scripts,
        library=library,
        policy=_policy([*scripts, library] if library else scripts),
        sections=[section for section in sections if not section.empty],
        versions=versions(),
    )


def write_results_page(
    path: str | os.PathLike[str],
    page: ResultsPage,
    sections: Sequence[Section],
    figures: FigureFiles | None = None,
) -> list[Path]:
    """Write one self-contained HTML page that needs no other file and no network.

    Parameters
    ----------
    path
        File of the page; an existing one is replaced.
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
    written = [] if figures is None else write_figures(figures, page, sections)
    with writing_whole_file(path) as temporary:
        Path(temporary).write_text(text, encoding="utf-8")
    return written


def _packed(text: str) -> str:
    """Compress a text for a page: gzip in base64, a quarter of the size of a program. Equal texts give equal bytes."""
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode("ascii")


def _in_script(text: str) -> Markup:
    """Escape JSON so that it cannot end its script element."""
    return Markup(text.replace("<", "\\u003c"))


def _own(name: str) -> str:
    return files("millfrf.reports").joinpath("templates", name).read_text(encoding="utf-8")


def _policy(scripts: Sequence[str]) -> str:
    """Return a content security policy that forbids the browser to load anything or to run any script but these."""
    hashes = (base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii") for script in scripts)
    allowed = " ".join(f"'sha256-{digest}'" for digest in hashes)
    return f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data:; base-uri 'none'"
