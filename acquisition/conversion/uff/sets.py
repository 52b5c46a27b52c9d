"""Data sets of a Universal File Format file, read one by one with pyuff and held against what they announce."""

import contextlib
import io
import warnings
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from foundation import FileFormatError

from .lines import UffLines, read_uff_lines, whole_uff
from .text_functions import text_function

_FUNCTION = 58
_SPARE = 2
"""Numbers by which a binary data set may be longer than announced: line ends are counted with the data."""


def read_uff_sets(path: Path, kinds: Collection[int]) -> tuple[dict[str, Any], ...]:
    """All data sets of the kinds asked for, in the order of the file, as pyuff gives them; others are passed over.

    pyuff reads a file whole or not at all, so that one set of a kind that nobody asked for would spoil the rest; it
    does not see that a file is cut short, nor that a function (58) has fewer points than it announces. Here each set is
    read for itself, and these are looked at. pyuff prints what it does not know; nothing of that is let through.

    Parameters
    ----------
    path
        ``.uff`` or ``.unv``.
    kinds
        Numbers of data sets, such as 58 (functions; 58b is one of them) or 2411 (nodes).

    Returns
    -------
    tuple of dict
        Each with its ``type`` and, for messages, its ``place`` in the file, counted from 1.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        No UFF file, a file that is cut short, or a data set that cannot be read or lacks points.
    """
    whole_uff(path)
    import pyuff

    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        try:
            file = pyuff.UFF(str(path))
            found = [int(kind) for kind in file.get_set_types()]
        except Exception as error:  # whatever a damaged file brings pyuff to
            raise FileFormatError(f"{path} is no readable UFF file ({_reason(error)}); export it again") from error
        lines: dict[int, UffLines] = {}
        return tuple(_one(path, file, place, kind, lines) for place, kind in enumerate(found, 1) if kind in kinds)


def _one(path: Path, file: Any, place: int, kind: int, lines: dict[int, UffLines]) -> dict[str, Any]:
    try:
        found = _as_pyuff_reads(path, file, place, kind, lines)
    except Exception as error:
        raise FileFormatError(
            f"{path}: data set {place} (type {kind}) cannot be read ({_reason(error)}); export it again"
        ) from error
    found["place"] = place
    if kind == _FUNCTION:
        _require_points(path, found)
    return dict(found)


def _as_pyuff_reads(path: Path, file: Any, place: int, kind: int, lines: dict[int, UffLines]) -> dict[str, Any]:
    """The set as pyuff reads it; where it stumbles over the numbers of a text function, these are read here.

    ``lines`` keeps those of all functions of the file, from the first time that they are needed.
    """
    try:
        return dict(file.read_sets(place - 1))
    except Exception:
        if kind != _FUNCTION:
            raise
        header = file.read_sets(place - 1, header_only=True)
        if header["binary"]:
            raise
        if not lines:
            lines |= {one.place: one for one in read_uff_lines(path, (_FUNCTION,))}
        return text_function(lines[place], header)


def _require_points(path: Path, found: dict[str, Any]) -> None:
    """As many points as the header says; what binary data hold beyond is the line's end."""
    announced, held = int(found["num_pts"]), len(found["data"])
    if held < announced or held > announced + (_SPARE if found["binary"] else 0):
        raise FileFormatError(
            f"{path}: data set {found['place']} announces {announced} points and holds {held}; it is damaged, export "
            "it again"
        )
    found["data"] = np.asarray(found["data"])[:announced]
    found["x"] = np.asarray(found["x"], dtype=float)[:announced]


def _reason(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
