"""The figures of a page as files of their own, for a paper or a talk."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from millfrf.core import InputError
from millfrf.figures import save_figure

from ..section import Picture, Section

FORMATS = ("svg", "png", "pdf")


@dataclass(frozen=True)
class FigureFiles:
    """Where the figures of a page go, and in which format.

    Parameters
    ----------
    folder
        Folder of the files; it is made where it is not there.
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


def asked_figures(folder: Path | None, format: str) -> FigureFiles | None:
    """What was asked for on the command line; None where no folder was named.

    Parameters
    ----------
    folder, format
        As typed after ``--figures`` and ``--figure-format``.

    Raises
    ------
    InputError
        As :class:`FigureFiles`.
    """
    return None if folder is None else FigureFiles(folder, format)


def pictures_of(sections: Sequence[Section]) -> Iterator[Picture]:
    """All pictures in the order in which a page numbers them."""
    for section in sections:
        if not section.empty:
            yield from section.pictures
            for fold in section.folds:
                yield from fold.pictures


def write_figures(where: FigureFiles, sections: Sequence[Section]) -> list[Path]:
    """Write each figure of a page as ``figure_03_stability_lobes.svg``, numbered as on the page.

    Parameters
    ----------
    where
        Folder and format.
    sections
        Sections of the page.

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
    for number, picture in enumerate(pictures_of(sections), start=1):
        path = where.folder / f"figure_{number:02d}_{_name(picture.alternative)}.{where.format}"
        save_figure(picture.figure, path)
        written.append(path)
    return written


def _name(words: str) -> str:
    """Words as a file name: small letters and underscores, 40 of them at most."""
    return re.sub(r"[^a-z0-9]+", "_", words.split(":")[0].lower())[:40].strip("_")
