"""The file of a choice, which the next run repeats with `--poles`."""

import os
from collections.abc import Sequence
from pathlib import Path

from millfrf.core import writing_whole_file

from ..provenance import sources, versions
from .session import Pole


def write_picked(
    path: str | os.PathLike[str], chosen: Sequence[Pole], frf: str | os.PathLike[str], band: tuple[float, float]
) -> None:
    """Write chosen poles as TOML, with the FRF and the band in comments.

    Parameters
    ----------
    path
        File to write, ``.toml``.
    chosen
        Frequency (Hz) and damping ratio of each pole.
    frf
        FRF that they were picked of.
    band : Hz
        Lowest and highest frequency of the fit.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    [source] = sources([frf])
    lines = [
        f"# Poles picked in the browser from {_comment(str(source['file']))}, {band[0]:g} to {band[1]:g} Hz.",
        f"# SHA-256 of that file: {source['sha256']}; millfrf {versions()['millfrf']}.",
        f"# Repeat: millfrf fit {_comment(str(source['file']))} --band {band[0]:g} {band[1]:g} --poles THIS_FILE",
        'format = "millfrf.poles"',
        "format_version = 1",
    ]
    for frequency, damping in sorted(chosen):
        lines += ["", "[[poles]]", f"frequency_hz = {frequency!r}", f"damping_ratio = {damping!r}"]
    with writing_whole_file(path) as temporary:
        Path(temporary).write_text("\n".join(lines) + "\n", encoding="utf-8")


def _comment(text: str) -> str:
    """A name without what would end a comment's line."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)
