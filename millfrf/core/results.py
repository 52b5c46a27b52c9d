"""Base class of all results: equality by value, text and HTML summaries, plots, optional libraries."""

import importlib
import math
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
    """Return the function of `millfrf.figures` with a name, such as ``draw_frf``; matplotlib is loaded here first."""
    from millfrf import figures

    return cast("Callable[..., Axes]", getattr(figures, name))


def same_values(first: Any, second: Any) -> bool:
    """Return whether two values are equal; NaN equals NaN.

    Arrays are equal in shape and in every element, dataclasses in every field. Partial functions are equal if they call
    the same function with equal arguments, and objects without attributes if they have the same class; Python compares
    these two by identity, so that a pickled copy would differ.

    Examples
    --------
    >>> import numpy as np
    >>> same_values((1.0, np.array([1.0, np.nan])), (1.0, np.array([1.0, np.nan])))
    True
    >>> same_values(np.zeros(2), np.zeros((1, 2)))
    False
    """
    import numpy as np  # not above: this package is loaded before anything heavy, so that `--help` is quick

    if first is second:
        return True
    if isinstance(first, np.ndarray) or isinstance(second, np.ndarray):
        return isinstance(first, np.ndarray) and isinstance(second, np.ndarray) and _same_arrays(first, second)
    if type(first) is not type(second):
        return bool(first == second) and not isinstance(first, str | bytes)
    if is_dataclass(first) and not isinstance(first, type):
        compared = [field.name for field in fields(first) if field.compare]
        return all(same_values(getattr(first, name), getattr(second, name)) for name in compared)
    if isinstance(first, partial):
        return same_values((first.func, first.args, first.keywords), (second.func, second.args, second.keywords))
    if isinstance(first, Mapping):
        return first.keys() == second.keys() and all(same_values(value, second[key]) for key, value in first.items())
    if isinstance(first, Sequence) and not isinstance(first, str | bytes):
        return len(first) == len(second) and all(same_values(*pair) for pair in zip(first, second, strict=True))
    return bool(first == second) or (first != first and second != second) or _stateless(first)


def _stateless(first: Any) -> bool:
    """Return whether an object has no attributes, is not callable, and its class defines no equality."""
    own = any("__eq__" in vars(kind) for kind in type(first).__mro__[:-1])
    plain = not own and not callable(first) and type(first).__module__ != "builtins"
    return plain and getattr(first, "__dict__", None) == {}


def _same_arrays(first: "np.ndarray[Any, Any]", second: "np.ndarray[Any, Any]") -> bool:
    import numpy as np

    numbers = first.dtype.kind in "fc" and second.dtype.kind in "fc"
    return bool(np.array_equal(first, second, equal_nan=numbers))


def optional_library(name: str, purpose: str, extra: str = "notebook") -> ModuleType:
    """Import a library, or raise `InputError` with the command that installs it.

    Parameters
    ----------
    name
        Name of the module, such as ``xarray``.
    purpose
        Function that needs it, such as ``Frf.to_xarray``, for the message.
    extra
        Extra of the package that installs it, for the message.

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
    """Short description of a result.

    Parameters
    ----------
    headline
        Type and content in one line.
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
    """Join up to ``most`` names with commas, and state the number of further names.

    Examples
    --------
    >>> listed(["fx", "fy", "fz"], most=2)
    'fx, fy and 1 more'
    """
    if len(names) <= most:
        return ", ".join(names)
    return f"{', '.join(names[:most])} and {len(names) - most} more"


def counted(number: int, thing: str) -> str:
    """Write a number with its noun; the noun is in the plural unless the number is 1.

    Examples
    --------
    >>> counted(1, "mode"), counted(3, "mode")
    ('1 mode', '3 modes')
    """
    return f"{number} {thing}" + ("" if number == 1 else "s")


def with_error(value: float, error: float, *, sign: bool = False) -> str:
    """Format a value and its error, such as a standard error; the decimals show two digits of the error.

    Examples
    --------
    >>> with_error(16.98997, 0.000069)
    '16.989970 ± 0.000069'
    >>> with_error(638.374, 0.27), with_error(2.85, float("nan"))
    ('638.37 ± 0.27', '2.850')
    """
    plus = "+" if sign else ""
    if not math.isfinite(error):
        return f"{value:{plus}.3f}"
    decimals = min(max(1 - math.floor(math.log10(error)), 0), 7) if error > 0 else 3
    return f"{value:{plus}.{decimals}f} ± {error:.{decimals}f}"


def doubts_line(warnings: Sequence[str]) -> tuple[str, ...]:
    """Return a line with the number of warnings and the first warning, at most 100 characters; empty if none.

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

    Two results are equal if they have the same type and all their fields are equal, arrays element by element. A result
    contains arrays, whose elements can be changed; therefore it has no hash.
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
        """Return a short description of this result; every subclass defines it."""
        raise NotImplementedError(f"{type(self).__name__} has no summary")
