"""Columns of a table that hold numbers, which stand to the right."""

import re

from ...tables import Table

_NUMBER = re.compile(r"[-+−±<>≤≥≈]?\s*\d[\d.,]*(e[-+]?\d+)?(%|\s.*)?$")
_NONE = {"", "-", "–", "no limit", "not resolved", "none"}
"""Cells that stand in place of a number."""


def of_numbers(table: Table) -> list[bool]:
    """Say of each column whether all its cells are numbers, maybe with more behind, or stand in place of one.

    Examples
    --------
    >>> of_numbers(Table("", ("cause", "gain"), (("Coulomb friction", "+3.2"), ("gap", "-"))))
    [False, True]
    >>> of_numbers(Table("", ("entry", "value"), (("1:+Z / 2:+Z", "2.02e-06 m/N"),)))
    [False, True]
    """
    return [_numbers([row[column] for row in table.rows]) for column in range(len(table.columns))]


def _numbers(cells: list[str]) -> bool:
    told = [cell for cell in cells if cell.strip() not in _NONE and not cell.startswith("none up to")]
    return bool(cells) and all(_NUMBER.match(cell) for cell in told)
