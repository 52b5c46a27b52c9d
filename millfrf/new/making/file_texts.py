"""What a file says in texts beside its samples: names and units of an array's columns, and notes for the reader."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .csv_look import is_unit

_NAMES = re.compile(
    r"name|label|channel|kanal|kan\u00e4le|kanaele|signal|sensor|bezeichn|column|spalte|head", re.IGNORECASE
)
_UNITS = re.compile(r"unit|einheit|unidad|eu$", re.IGNORECASE)
_DATES = re.compile(r"date|datum|recorded|start_?time|zeitstempel", re.IGNORECASE)
_LONGEST_TEXT, _MOST_NOTES, _FEW = 60, 24, 6
"""Characters of a text, notes, and numbers of an array that are shown in a mapping's first lines."""


@dataclass(frozen=True)
class ColumnTexts:
    """Names and units of an array's columns as other fields of its file state them.

    Parameters
    ----------
    names, units
        One text a column; empty where the file states none, or more than one list might be meant.
    said
        Where they come from, for the reader; empty: nowhere.
    """

    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    said: str = ""


def column_texts(fields: Mapping[str, Any], array: str, count: int) -> ColumnTexts:
    """Names and units of the ``count`` columns of an array: lists of as many texts.

    A list of units is one by its field's name, or because most of its texts are units; any other may be names.

    Parameters
    ----------
    fields
        All that the file holds, by name.
    array
        Name of the array with the columns.
    count
        Number of its columns.
    """
    lists = _nearest({name: texts for name, value in fields.items() if len(texts := texts_of(value)) == count}, array)
    if count < 2:
        return ColumnTexts()
    units = {name: texts for name, texts in lists.items() if _are_units(name, texts)}
    rest = {name: texts for name, texts in lists.items() if name not in units and len(set(texts)) == count}
    unit, name = _only(units, _UNITS), _only(rest, _NAMES)
    told = [f"{what} from {key}" for what, key in (("names", name), ("units", unit)) if key]
    return ColumnTexts(
        rest.get(name, ()),
        units.get(unit, ()),
        f"Columns of {array} have {' and '.join(told)}: check them." if told else "",
    )


def texts_of(value: Any) -> tuple[str, ...]:
    """Texts of a cell array or an array of characters; empty where a value is none."""
    if isinstance(value, str):
        return (value.strip(),)
    if isinstance(value, np.ndarray) and value.dtype.kind == "U":
        return tuple(str(one).strip() for one in value.reshape(-1))
    return ()


def notes(fields: Mapping[str, Any]) -> Iterator[str]:
    """Short texts and few numbers that a file holds, one line each: ``Hdr.machine: ABB IRB6660``."""
    lines = [f"  {name}: {shown}" for name, value in fields.items() if (shown := _shown(value))]
    yield from lines[:_MOST_NOTES]
    if len(lines) > _MOST_NOTES:
        yield f"  and {len(lines) - _MOST_NOTES} more"


def dates(fields: Mapping[str, Any]) -> str:
    """Texts of a file whose name says that they are a date or time, as ``Hdr.date = 2026-03-11``."""
    told = [f"{name} = {_shown(value)}" for name, value in fields.items() if _DATES.search(name.rpartition(".")[2])]
    return ", ".join(one for one in told if any(sign.isdigit() for sign in one.partition(" = ")[2]))


def _shown(value: Any) -> str:
    """One line for a few numbers or texts, empty for anything larger."""
    texts = texts_of(value)
    if texts:
        whole = " ".join(", ".join(texts).split())
        plain = "".join(sign if sign.isprintable() else "?" for sign in whole)
        return plain if len(plain) <= _LONGEST_TEXT * (1 + (len(texts) > 1)) else f"{plain[:_LONGEST_TEXT]} ..."
    if not isinstance(value, np.ndarray | np.generic | int | float) or not 0 < np.size(value) <= _FEW:
        return ""
    array = np.asarray(value)
    return ", ".join(f"{one:.10g}" for one in array.reshape(-1)) if array.dtype.kind in "iuf" else ""


def _nearest(lists: dict[str, tuple[str, ...]], array: str) -> dict[str, tuple[str, ...]]:
    """Lists in the array's own structure where there are some, else all."""
    own = {name: texts for name, texts in lists.items() if name.rpartition(".")[0] == array.rpartition(".")[0]}
    return own or lists


def _are_units(name: str, texts: tuple[str, ...]) -> bool:
    known = sum(bool(text) and is_unit(text.strip("[]()")) for text in texts)
    return bool(_UNITS.search(name.rpartition(".")[2])) or known > len(texts) / 2


def _only(lists: Mapping[str, tuple[str, ...]], wanted: re.Pattern[str]) -> str:
    """Name of the only list, or of the only one whose name says what it is; empty: none, or it cannot be told."""
    called = [name for name in lists if wanted.search(name.rpartition(".")[2])]
    found = called or list(lists)
    return found[0] if len(found) == 1 else ""
