"""`Summary`: what a result says of itself in a few lines of text, or as a small HTML table."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

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
