"""Geometry files: TOML, CSV tables, and files of other programs that hold a geometry."""

import csv
import json
import os
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from millfrf.core import FileFormatError, InputError, mistake_in_words, si_factor, writing_whole_file

from .geometry_model import Geometry
from .geometry_uff import read_geometry_uff

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


FORMAT = "millfrf.geometry"

Vector = Annotated[tuple[float, ...], Field(min_length=3, max_length=3)]


class GeometryTable(BaseModel):
    """The file: places by node, local axes of those that have their own, lines between nodes.

    Parameters
    ----------
    format, format_version
        What the file is; may be left out.
    unit
        Unit of the places: ``m``, ``mm``, ``in``.
    nodes
        Place of each node, ``name = [x, y, z]``.
    axes
        Directions of a node's own x, y and z in the axes of the whole, where they differ.
    lines
        Chains of nodes that are drawn as lines.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
    format: str = FORMAT
    format_version: int = 1
    unit: str = "m"
    lines: tuple[tuple[str, ...], ...] = ()
    nodes: dict[str, Vector]
    axes: dict[str, Annotated[tuple[Vector, ...], Field(min_length=3, max_length=3)]] = Field(default_factory=dict)


def read_geometry(path: str | os.PathLike[str]) -> Geometry:
    """Read a geometry: TOML as :func:`write_geometry` writes it, UFF (15, 2411, 18, 2420, 82) or CSV, by suffix.

    Raises
    ------
    InputError
        No such file, another suffix, or a geometry that does not hold together.
    FileFormatError
        A damaged file, or none with nodes.
    """
    return import_geometry(path)[0]


def import_geometry(path: str | os.PathLike[str]) -> tuple[Geometry, tuple[str, ...]]:
    """Read a geometry as :func:`read_geometry` does, and state each thing that the file leaves open.

    Raises
    ------
    InputError, FileFormatError
        As :func:`read_geometry`.
    """
    file = Path(path)
    if not file.is_file():
        raise InputError(f"no file {file}; check the name")
    suffix = file.suffix.lower()
    if suffix == ".toml":
        return _read_toml(file), ()
    if suffix in (".uff", ".unv"):
        return read_geometry_uff(file)
    if suffix in (".csv", ".txt"):
        return read_geometry_table(file)
    raise InputError(f"cannot read a geometry from {file.name}; give .toml, .uff, .unv or .csv")


def is_geometry_table(content: Mapping[str, Any]) -> bool:
    """Whether the content of a TOML file is a geometry."""
    return content.get("format") == FORMAT or ("nodes" in content and "format" not in content)


def write_geometry(path: str | os.PathLike[str], geometry: Geometry) -> None:
    """Write a geometry as TOML: ``nodes`` (m), ``axes`` of nodes that are turned, ``lines``.

    Raises
    ------
    InputError
        Another suffix, or the folder cannot be written to.
    """
    if Path(path).suffix.lower() != ".toml":
        raise InputError(f"cannot write {path}: a geometry is written as .toml; change the suffix")
    text = [f'format = "{FORMAT}"', "format_version = 1", 'unit = "m"', "lines = ["]
    text += [f"    [{', '.join(json.dumps(name) for name in line)}]," for line in geometry.lines]
    text += ["]", "", "[nodes]"]
    for name, position in zip(geometry.nodes, geometry.positions, strict=True):
        text.append(f"{json.dumps(name)} = {_vector(position)}")
    turned = [] if geometry.axes is None else list(zip(geometry.nodes, geometry.axes, strict=True))
    turned = [(name, axes) for name, axes in turned if not np.array_equal(axes, np.eye(3))]
    if turned:
        text += ["", "[axes]"]
        text += [f"{json.dumps(name)} = [{', '.join(_vector(axis) for axis in axes)}]" for name, axes in turned]
    with writing_whole_file(path) as temporary:
        temporary.write_text("\n".join([*text, ""]), encoding="utf-8")


def _vector(numbers: Sequence[float]) -> str:
    return f"[{', '.join(repr(float(number)) for number in numbers)}]"


def _read_toml(path: Path) -> Geometry:
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise FileFormatError(f"{path} is not TOML: {error}") from error
    if not is_geometry_table(content):
        raise FileFormatError(f"{path} is no geometry; it needs a table [nodes] with a position for each name")
    try:
        table = GeometryTable.model_validate(content)
        factor = si_factor("displacement", table.unit)
        unknown = [name for name in table.axes if name not in table.nodes]
        if unknown:
            raise InputError(f"axes are given for node {unknown[0]}, which is not there; add it or take them out")
        positions = np.array(list(table.nodes.values()), dtype=float).reshape(-1, 3) * factor
        axes = [table.axes.get(name, np.eye(3)) for name in table.nodes] if table.axes else None
        return Geometry(tuple(table.nodes), positions, None if axes is None else np.array(axes), table.lines)
    except ValidationError as error:
        raise FileFormatError(f"{path}: {mistake_in_words(error, GeometryTable)}") from error
    except InputError as error:
        raise FileFormatError(f"{path}: {error}") from error
