"""Numbers of text data sets 58 that pyuff does not read: lines filled up with blanks, and Fortran's D exponents."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from .lines import UffLines

_HEADER = 11
_WIDTHS = {
    (2, 1): (13,) * 6,
    (5, 1): (13,) * 6,
    (2, 0): (13,) * 6,
    (5, 0): (13,) * 6,
    (4, 1): (20,) * 4,
    (6, 1): (20,) * 4,
    (4, 0): (13, 20) * 2,
    (6, 0): (13, 20, 20),
}
"""Widths of a line's fields, by data type (real or complex, single or double) and by whether the axis is even."""

_COMPLEX = (5, 6)


def text_function(one: UffLines, header: Mapping[str, Any]) -> dict[str, Any]:
    """A data set with its axis ``x`` and values ``data``, from its lines.

    Parameters
    ----------
    one
        Lines of a data set 58 in text.
    header
        What pyuff read of it.

    Raises
    ------
    ValueError, KeyError
        A field that is no number, or a data type that the format does not have.
    """
    kind, even = int(header["ord_data_type"]), int(header["abscissa_spacing"])
    widths = _WIDTHS[kind, even]
    numbers = [number for line in one.lines[_HEADER:] for number in _fields(line, widths)]
    columns = (2 if kind in _COMPLEX else 1) + (0 if even else 1)
    rows = np.array(numbers[: len(numbers) // columns * columns], dtype=float).reshape(-1, columns)
    values = rows if even else rows[:, 1:]
    x = header["abscissa_min"] + header["abscissa_inc"] * np.arange(len(rows)) if even else rows[:, 0]
    data = values[:, 0] + 1j * values[:, 1] if kind in _COMPLEX else values[:, 0]
    return {**header, "x": x, "data": data}


def _fields(line: str, widths: tuple[int, ...]) -> list[float]:
    text, at, found = line.rstrip().replace("D", "E").replace("d", "e"), 0, []
    for width in widths:
        if at >= len(text):
            break
        found.append(float(text[at : at + width]))
        at += width
    return found
