"""Geometry in CSV tables: one node a row, or one coordinate a row as ModeLAB's set-up files have it."""

import csv
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from foundation import FileFormatError, si_factor

from .geometry import Geometry

_UNIT = re.compile(r"(?P<name>[^(\[]*?)\s*[(\[](?P<unit>[^)\]]+)[)\]]\s*")
_NODE = ("node", "point", "name", "id", "nr", "no")
_COORDINATES = ("x", "y", "z")

Rows = Sequence[Sequence[str]]


def read_geometry_table(path: Path) -> tuple[Geometry, tuple[str, ...]]:
    """Nodes of a CSV file.

    Either a row a node, under headings ``node, x, y, z`` with a unit behind them as in ``x (mm)``; without the column
    ``node`` the rows are numbered from 1. Or a row a coordinate, whose first field is the coordinate and a name:
    ``xHammer, 0, 0.1, 0.2`` gives the nodes ``Hammer1``, ``Hammer2``, ``Hammer3`` (and one alone just ``Hammer``).
    Other rows are passed over.

    Returns
    -------
    Geometry, tuple of str
        The geometry, without lines, and what the file leaves open.

    Raises
    ------
    FileFormatError
        Neither layout, a coordinate that is missing or no number.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (UnicodeDecodeError, OSError) as error:
        raise FileFormatError(f"{path} cannot be read as text; save it as CSV in UTF-8") from error
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    delimiter = max(",;\t", key=lines[0].count) if lines else ","
    rows = [[field.strip() for field in row] for row in csv.reader(lines, delimiter=delimiter)]
    if rows and len(rows[0]) > 1 and rows[0][0].lower() in _NODE:
        return _by_nodes(path, rows)
    if rows and tuple(_name_and_unit(heading)[0] for heading in rows[0][:3]) == _COORDINATES:
        numbered = [["node", *rows[0]], *([str(k), *row] for k, row in enumerate(rows[1:], 1))]
        return _by_nodes(path, numbered)
    return _by_coordinates(path, rows)


def _by_nodes(path: Path, rows: Rows) -> tuple[Geometry, tuple[str, ...]]:
    names, units = zip(*map(_name_and_unit, rows[0]), strict=True)
    missing = [axis for axis in _COORDINATES if axis not in names]
    if missing:
        raise FileFormatError(f"{path} has no column {missing[0]}; its headings must be node, x, y, z")
    columns = [names.index(axis) for axis in _COORDINATES]
    factors = [si_factor("displacement", units[column]) if units[column] else 1.0 for column in columns]
    nodes, positions = [], []
    for number, row in enumerate(rows[1:], 2):
        nodes.append(row[0])
        positions.append([_number(path, number, row, c) * f for c, f in zip(columns, factors, strict=True)])
    notes = () if all(units[c] for c in columns) else (_taken_in_metres(path, "headings"),)
    return Geometry(tuple(nodes), np.array(positions).reshape(-1, 3)), notes


def _name_and_unit(heading: str) -> tuple[str, str]:
    found = _UNIT.fullmatch(heading)
    return ((found["name"] if found else heading).strip().lower(), found["unit"].strip() if found else "")


def _by_coordinates(path: Path, rows: Rows) -> tuple[Geometry, tuple[str, ...]]:
    given: dict[str, dict[str, tuple[int, Sequence[str]]]] = {}
    for number, row in enumerate(rows, 1):
        axis, name = row[0][:1], row[0][1:]
        if axis in _COORDINATES and name:
            given.setdefault(name, {})[axis] = (number, [row[0], *row[1:]])
    groups = {name: found for name, found in given.items() if set(found) == set(_COORDINATES)}
    if not groups:
        raise FileFormatError(
            f"{path} is no table of nodes; give headings node, x, y, z, or rows such as xHammer, yHammer, zHammer"
        )
    nodes: list[str] = []
    positions: list[list[float]] = []
    for name, found in groups.items():
        points = _points(path, found)
        nodes += [name] if len(points) == 1 else [f"{name}{k}" for k in range(1, len(points) + 1)]
        positions += points
    return Geometry(tuple(nodes), np.array(positions)), (_taken_in_metres(path, "rows"),)


def _points(path: Path, found: Mapping[str, tuple[int, Sequence[str]]]) -> list[list[float]]:
    filled = {axis: [k for k, field in enumerate(row[1:], 1) if field] for axis, (_, row) in found.items()}
    if len({len(columns) for columns in filled.values()}) > 1 or not filled["x"]:
        counts = ", ".join(f"{len(columns)} of {axis}" for axis, columns in filled.items())
        raise FileFormatError(f"{path}: row {found['x'][0]} and its neighbours have {counts}; give each node all three")
    return [[_number(path, *found[axis], k) for axis in _COORDINATES] for k in filled["x"]]


def _number(path: Path, line: int, row: Sequence[str], column: int) -> float:
    field = row[column] if column < len(row) else ""
    try:
        return float(field)
    except ValueError as error:
        raise FileFormatError(f"{path}: row {line}, column {column + 1}: {field!r} is not a number") from error


def _taken_in_metres(path: Path, where: str) -> str:
    return f"{path.name}: positions taken in m, since its {where} name no unit; write the unit into the TOML file"
