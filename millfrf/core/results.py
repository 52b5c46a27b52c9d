"""Base class of all results: equality by value, text and HTML summaries, plots, optional libraries."""

import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import partial
from html import escape
from types import ModuleType
from typing import TYPE_CHECKING, Any, cast

from .errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes


def drawing(name: str) -> "Callable[..., Axes]":
    """The function of ``figures`` that draws one type of result into axes; matplotlib is loaded here, not before.

    Parameters
    ----------
    name
        Name of the function, such as ``draw_frf``.
    """
    from millfrf import figures

    return cast("Callable[..., Axes]", getattr(figures, name))


def same_values(one: Any, other: Any) -> bool:
    """Whether two values are equal: arrays by shape and every element, dataclasses by every field, NaN equal to NaN.

    Partial functions are equal if they call the same function with equal arguments, and objects without attributes if
    they are of one class; Python compares both by identity, so that a pickle would not come back equal.

    Parameters
    ----------
    one, other
        Numbers, texts, arrays, and dataclasses, sequences or mappings of them.

    Examples
    --------
    >>> import numpy as np
    >>> same_values((1.0, np.array([1.0, np.nan])), (1.0, np.array([1.0, np.nan])))
    True
    >>> same_values(np.zeros(2), np.zeros((1, 2)))
    False
    """
    import numpy as np  # not above: this package is loaded before anything heavy, so that `--help` is quick

    if one is other:
        return True
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        return isinstance(one, np.ndarray) and isinstance(other, np.ndarray) and _same_arrays(one, other)
    if type(one) is not type(other):
        return bool(one == other) and not isinstance(one, str | bytes)
    if is_dataclass(one) and not isinstance(one, type):
        compared = [field.name for field in fields(one) if field.compare]
        return all(same_values(getattr(one, name), getattr(other, name)) for name in compared)
    if isinstance(one, partial):
        return same_values((one.func, one.args, one.keywords), (other.func, other.args, other.keywords))
    if isinstance(one, Mapping):
        return one.keys() == other.keys() and all(same_values(value, other[key]) for key, value in one.items())
    if isinstance(one, Sequence) and not isinstance(one, str | bytes):
        return len(one) == len(other) and all(same_values(*pair) for pair in zip(one, other, strict=True))
    return bool(one == other) or (one != one and other != other) or _stateless(one)


def _stateless(one: Any) -> bool:
    """Whether an object is nothing but an instance of its class: no function, no attributes, no equality of its own."""
    own = any("__eq__" in vars(kind) for kind in type(one).__mro__[:-1])
    plain = not own and not callable(one) and type(one).__module__ != "builtins"
    return plain and getattr(one, "__dict__", None) == {}


def _same_arrays(one: "np.ndarray[Any, Any]", other: "np.ndarray[Any, Any]") -> bool:
    import numpy as np

    numbers = one.dtype.kind in "fc" and other.dtype.kind in "fc"
    return bool(np.array_equal(one, other, equal_nan=numbers))


def optional_library(name: str, purpose: str, extra: str = "notebook") -> ModuleType:
    """The library, imported.

    Parameters
    ----------
    name
        Name of the module, such as ``xarray``.
    purpose
        What needs it, such as ``Frf.to_xarray``, for the message.
    extra
        Extra of the package that brings it, for the message.

    Raises
    ------
    InputError
        It is not installed.

    Examples
    --------
    >>> optional_library("no_such_library", "Frf.to_xarray")
    Traceback (most recent call last):
    millfrf.core.errors.InputError: Frf.to_xarray needs no_such_library: pip install "millfrf[notebook]"
    """
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        raise InputError(f'{purpose} needs {name}: pip install "millfrf[{extra}]"') from error


MOST_LINES = 4
"""Lines of text that a result takes at a prompt."""

MOST_ROWS = 20
"""Rows of a table in a notebook."""

_CELL = "text-align:left;padding:1px 10px 1px 0"


@dataclass(frozen=True)
class Summary:
    """The few facts that matter of a result.

    Parameters
    ----------
    headline
        Name of the type and what it holds, one line.
    lines
        Further lines, at most three.
    columns, rows
        Headings and cells of the table that a notebook shows below the headline; empty: the lines are shown instead.
    """

    headline: str
    lines: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()

    def text(self) -> str:
        """Write at most four lines of text."""
        return "\n  ".join((self.headline, *self.lines)[:MOST_LINES])

    def html(self) -> str:
        """Headline, lines and table; every text is escaped."""
        parts = [f"<strong>{escape(self.headline)}</strong>", *(f"<br>{escape(line)}" for line in self.lines)]
        if self.rows:
            heading = "".join(f'<th style="{_CELL}">{escape(name)}</th>' for name in self.columns)
            rows = [_row(row) for row in self.rows[:MOST_ROWS]]
            if len(self.rows) > MOST_ROWS:
                rows.append(_row((f"and {len(self.rows) - MOST_ROWS} more",)))
            parts.append(f"<table><thead><tr>{heading}</tr></thead><tbody>{''.join(rows)}</tbody></table>")
        return f"<div>{''.join(parts)}</div>"


def _row(cells: Sequence[str]) -> str:
    return "<tr>" + "".join(f'<td style="{_CELL}">{escape(cell)}</td>' for cell in cells) + "</tr>"


def listed(names: Sequence[str], most: int = 6) -> str:
    """Names with commas; of more than ``most`` the first ones and how many follow.

    Examples
    --------
    >>> listed(["fx", "fy", "fz"], most=2)
    'fx, fy and 1 more'
    """
    if len(names) <= most:
        return ", ".join(names)
    return f"{', '.join(names[:most])} and {len(names) - most} more"


def counted(number: int, thing: str) -> str:
    """A number with the name of what is counted, in the plural where it is not one.

    Examples
    --------
    >>> counted(1, "mode"), counted(3, "mode")
    ('1 mode', '3 modes')
    """
    return f"{number} {thing}" + ("" if number == 1 else "s")


def doubts_line(warnings: Sequence[str]) -> tuple[str, ...]:
    """A line with the number of warnings and the first one, cut at 100 characters; empty where there is none.

    Examples
    --------
    >>> doubts_line(["the force is small"])
    ('1 warning: the force is small',)
    """
    if not warnings:
        return ()
    first = warnings[0] if len(warnings[0]) <= 100 else f"{warnings[0][:97]}..."
    return (f"{counted(len(warnings), 'warning')}: {first}",)


class Result:
    """Equality by value, a short text and a small HTML table, for ``@dataclass(frozen=True, eq=False, repr=False)``.

    Two results are equal if they are of one type and all their fields are equal, arrays element by element. A result
    holds arrays, whose elements can be changed; it therefore has no hash.
    """

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return same_values(self, other)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return self._summary().text()

    def _repr_html_(self) -> str:
        return self._summary().html()

    def _summary(self) -> Summary:
        """Give the few facts that matter of this result.

        Raises
        ------
        NotImplementedError
            A type that does not say what it holds.
        """
        raise NotImplementedError(f"{type(self).__name__} says nothing of itself")
