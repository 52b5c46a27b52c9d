"""Geometry files: TOML, CSV tables, and UFF files of other programs."""

import csv
import json
import os
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from acquisition import UffLines, read_uff_lines, read_uff_sets
from millfrf.core import FileFormatError, InputError, Real, mistake_in_words, si_factor, writing_whole_file

from .geometry_model import Geometry

FORMAT = "millfrf.geometry"
_COORDINATES = ("x", "y", "z")

Vector = Annotated[tuple[float, ...], Field(min_length=3, max_length=3)]
Imported = tuple[Geometry, tuple[str, ...]]  # a geometry, and a sentence for each thing that its file leaves open
Row = Sequence[str]


class GeometryTable(BaseModel):
    """Content of a geometry file: positions of nodes, local axes where they differ, and lines between nodes.

    Parameters
    ----------
    format, format_version
        What the file is; may be left out.
    unit
        Unit of the positions: ``m``, ``mm``, ``in``.
    nodes
        Position of each node, ``name = [x, y, z]``.
    axes
        Directions of a node's local x, y and z in the axes of the structure, for nodes whose axes differ.
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
        No such file, another suffix, or a geometry with contradictions.
    FileFormatError
        A damaged file, or one without nodes.
    """
    return import_geometry(path)[0]


def import_geometry(path: str | os.PathLike[str]) -> Imported:
    """Read a geometry as :func:`read_geometry` does; also return a sentence for each thing that the file leaves open.

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
        return _read_uff(file)
    if suffix in (".csv", ".txt"):
        return _read_table(file)
    raise InputError(f"cannot read a geometry from {file.name}; give .toml, .uff, .unv or .csv")


def is_geometry_table(content: Mapping[str, Any]) -> bool:
    """Return whether the content of a TOML file is a geometry."""
    return content.get("format") == FORMAT or ("nodes" in content and "format" not in content)


def write_geometry(path: str | os.PathLike[str], geometry: Geometry) -> None:
    """Write a geometry as TOML: ``nodes`` (m), ``axes`` of nodes whose axes differ, ``lines``.

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
        text.append(f"{json.dumps(name)} = {json.dumps(position.tolist())}")
    axes = [] if geometry.axes is None else zip(geometry.nodes, geometry.axes.tolist(), strict=True)
    rotated = [f"{json.dumps(name)} = {json.dumps(own)}" for name, own in axes if own != np.eye(3).tolist()]
    text += ["", "[axes]", *rotated] if rotated else []
    with writing_whole_file(path) as temporary:
        temporary.write_text("\n".join([*text, ""]), encoding="utf-8")


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
        axes = np.array([table.axes.get(name, np.eye(3)) for name in table.nodes]) if table.axes else None
        return Geometry(tuple(table.nodes), positions, axes, table.lines)
    except ValidationError as error:
        raise FileFormatError(f"{path}: {mistake_in_words(error, GeometryTable)}") from error
    except InputError as error:
        raise FileFormatError(f"{path}: {error}") from error


def _read_table(path: Path) -> Imported:
    """Read the nodes of a CSV file.

    The file may have a row per node, under headings ``node, x, y, z``, with units as in ``x (mm)``; without the column
    ``node`` the rows are numbered from 1. Or it has a row per coordinate, whose first field is the coordinate and a
    name: ``xHammer, 0, 0.1, 0.2`` gives the nodes ``Hammer1``, ``Hammer2``, ``Hammer3``; a single node is called
    ``Hammer``. Other rows are skipped.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (UnicodeDecodeError, OSError) as error:
        raise FileFormatError(f"{path} cannot be read as text; save it as CSV in UTF-8") from error
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    # the character that the first line has most often
    delimiter = max(",;\t", key=lines[0].count) if lines else ","
    rows = [[field.strip() for field in row] for row in csv.reader(lines, delimiter=delimiter)]
    if rows and len(rows[0]) > 1 and rows[0][0].lower() in ("node", "point", "name", "id", "nr", "no"):
        return _nodes_by_row(path, rows)
    if rows and tuple(_name_and_unit(heading)[0] for heading in rows[0][:3]) == _COORDINATES:
        return _nodes_by_row(path, [["node", *rows[0]], *([str(k), *row] for k, row in enumerate(rows[1:], 1))])
    return _nodes_by_coordinate(path, rows)


def _nodes_by_row(path: Path, rows: Sequence[Row]) -> Imported:
    names, units = zip(*map(_name_and_unit, rows[0]), strict=True)
    missing = [axis for axis in _COORDINATES if axis not in names]
    if missing:
        raise FileFormatError(f"{path} has no column {missing[0]}; its headings must be node, x, y, z")
    columns = [names.index(axis) for axis in _COORDINATES]
    factors = [si_factor("displacement", units[column]) if units[column] else 1.0 for column in columns]
    positions = [
        [_number(path, number, row, column) * factor for column, factor in zip(columns, factors, strict=True)]
        for number, row in enumerate(rows[1:], 2)
    ]
    notes = () if all(units[column] for column in columns) else (_taken_in_metres(path, "headings"),)
    return Geometry(tuple(row[0] for row in rows[1:]), np.array(positions).reshape(-1, 3)), notes


def _name_and_unit(heading: str) -> tuple[str, str]:
    match = re.fullmatch(r"([^(\[]*?)\s*[(\[]([^)\]]+)[)\]]\s*", heading)
    return (match[1].strip().lower(), match[2].strip()) if match else (heading.strip().lower(), "")


def _nodes_by_coordinate(path: Path, rows: Sequence[Row]) -> Imported:
    by_name: dict[str, dict[str, tuple[int, Row]]] = {}
    for number, row in enumerate(rows, 1):
        axis, name = row[0][:1], row[0][1:]
        if axis in _COORDINATES and name:
            by_name.setdefault(name, {})[axis] = (number, row)
    nodes: list[str] = []
    positions: list[list[float]] = []
    for name, numbered in by_name.items():
        if set(numbered) == set(_COORDINATES):
            points = _points(path, numbered)
            nodes += [name] if len(points) == 1 else [f"{name}{k}" for k in range(1, len(points) + 1)]
            positions += points
    if not nodes:
        raise FileFormatError(
            f"{path} is no table of nodes; give headings node, x, y, z, or rows such as xHammer, yHammer, zHammer"
        )
    return Geometry(tuple(nodes), np.array(positions)), (_taken_in_metres(path, "rows"),)


def _points(path: Path, numbered: Mapping[str, tuple[int, Row]]) -> list[list[float]]:
    filled = {axis: [k for k, field in enumerate(row[1:], 1) if field] for axis, (_, row) in numbered.items()}
    if len({len(columns) for columns in filled.values()}) > 1 or not filled["x"]:
        counts = ", ".join(f"{len(columns)} of {axis}" for axis, columns in filled.items())
        first = numbered["x"][0]
        raise FileFormatError(f"{path}: row {first} and its neighbours have {counts}; give each node all three")
    return [[_number(path, *numbered[axis], k) for axis in _COORDINATES] for k in filled["x"]]


def _number(path: Path, line: int, row: Row, column: int) -> float:
    field = row[column] if column < len(row) else ""
    try:
        return float(field)
    except ValueError as error:
        raise FileFormatError(f"{path}: row {line}, column {column + 1}: {field!r} is not a number") from error


def _taken_in_metres(path: Path, where: str) -> str:
    return f"{path.name}: positions taken in m, since its {where} name no unit; write the unit into the TOML file"


# data sets of UFF files
_NODES, _NODES_DOUBLE, _SYSTEMS_BY_POINTS, _SYSTEMS_BY_MATRICES, _LINES, _UNITS = 15, 2411, 18, 2420, 82, 164
_CARTESIAN, _CYLINDRICAL, _SPHERICAL = 0, 1, 2
_GLOBAL = 0  # number of the coordinate system of the structure


@dataclass(frozen=True)
class _CoordinateSystem:
    """A coordinate system of a UFF file, described in the axes of the structure."""

    kind: int = _CARTESIAN  # cylindrical: r, angle in degrees, z; spherical: r, angle from z, angle around z
    axes: Real = field(default_factory=lambda: np.eye(3))  # unit vectors of its X, Y and Z as rows
    origin: Real = field(default_factory=lambda: np.zeros(3))  # in the file's unit of length

    def position(self, coordinates: Real) -> Real:
        """Return the position (3,) in the structure's axes of a point with coordinates (3,) in this system."""
        a, b, c = coordinates
        if self.kind == _CYLINDRICAL:
            local = np.array([a * np.cos(np.radians(b)), a * np.sin(np.radians(b)), c])
        elif self.kind == _SPHERICAL:
            polar, around = np.radians(b), np.radians(c)
            local = a * np.array([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)])
        else:
            local = np.asarray(coordinates, dtype=float)
        return np.asarray(local @ self.axes + self.origin)

    def axes_at(self, position: Real) -> Real:
        """Return the directions (3, 3) of the first, second and third coordinate at a position (3,), as rows."""
        if self.kind == _CARTESIAN:
            return self.axes
        x, y, z = (position - self.origin) @ self.axes.T
        around = np.arctan2(y, x)
        outward = np.array([np.cos(around), np.sin(around), 0.0])
        along = np.array([-np.sin(around), np.cos(around), 0.0])
        upward = np.array([0.0, 0.0, 1.0])
        if self.kind == _CYLINDRICAL:
            return np.asarray(np.array([outward, along, upward]) @ self.axes)
        polar = np.arctan2(np.hypot(x, y), z)
        radial = np.sin(polar) * outward + np.cos(polar) * upward
        downward = np.cos(polar) * outward - np.sin(polar) * upward
        return np.asarray(np.array([radial, downward, along]) @ self.axes)


def _read_uff(path: Path) -> Imported:
    """Read the geometry of a UFF file, with nodes named by their numbers.

    Coordinates in set 15 refer to the definition system of the node, coordinates in set 2411 to the structure. The
    displacement system of a node gives its local axes.
    """
    sets = read_uff_sets(path, (_NODES, _NODES_DOUBLE, _SYSTEMS_BY_MATRICES, _LINES, _UNITS))
    by_kind = {kind: list(group) for kind, group in groupby(sorted(sets, key=_kind), key=_kind)}
    node_sets = [*by_kind.get(_NODES, []), *by_kind.get(_NODES_DOUBLE, [])]
    if not node_sets:
        raise FileFormatError(f"{path} holds no nodes (data set 15 or 2411); export the geometry too")
    systems = _systems_by_points(path, read_uff_lines(path, (_SYSTEMS_BY_POINTS,)))
    systems |= _systems_by_matrices(path, by_kind.get(_SYSTEMS_BY_MATRICES, []))
    metre, notes = 1.0, []
    if _UNITS in by_kind:
        metre = float(by_kind[_UNITS][0]["length"])
    else:
        notes.append(f"{path.name}: positions taken in m, since the file states no units (set 164)")
    nodes: dict[int, tuple[Real, Real]] = {}
    unknown: set[int] = set()
    for data in node_sets:
        for number, node in _nodes_in(path, data, systems, unknown):
            if number in nodes and not np.allclose(nodes[number][0], node[0]):
                raise FileFormatError(f"{path}: node {number} lies at two places; give each node once")
            nodes[number] = node
    if unknown:
        names = ", ".join(map(str, sorted(unknown)))
        notes.append(f"{path.name}: coordinate system {names} is missing; the structure's own axes are taken")
    lines, missing = _chains(by_kind.get(_LINES, []), nodes)
    if missing:
        notes.append(f"{path.name}: lines to {missing} missing nodes are left out")
    positions, axes = (np.array([node[k] for node in nodes.values()]) for k in (0, 1))
    local = None if np.allclose(axes, np.eye(3)) else axes
    return Geometry(tuple(map(str, nodes)), positions / metre, local, lines), tuple(notes)


def _kind(data: Mapping[str, Any]) -> int:
    return int(data["type"])


def _systems_by_matrices(path: Path, sets: Sequence[Mapping[str, Any]]) -> dict[int, _CoordinateSystem]:
    """Read the systems of data sets 2420: the first three rows of a matrix are the axes, the fourth is the origin."""
    systems = {}
    for data in sets:
        try:
            for number, kind, matrix in zip(data["CS_sys_labels"], data["CS_types"], data["CS_matrices"], strict=True):
                rows = np.asarray(matrix, dtype=float).reshape(4, 3)
                if not np.isfinite(rows).all():
                    raise ValueError(f"system {number} is not finite")
                systems[int(number)] = _CoordinateSystem(int(kind), rows[:3], rows[3])
        except (ValueError, TypeError) as error:
            raise _damaged(path, data["place"], _SYSTEMS_BY_MATRICES, error) from error
    return systems


def _systems_by_points(path: Path, sets: Sequence[UffLines]) -> dict[int, _CoordinateSystem]:
    """Read the systems of data sets 18: origin, a point on +X, a point in the plane of +X and +Z, in another system."""
    raw: dict[int, tuple[int, int, Real]] = {}
    for data in sets:
        try:
            for first in range(0, len(data.lines), 4):
                number, kind, reference = (int(word) for word in data.lines[first].split()[:3])
                # fields of 13 characters. The lines are read here, because pyuff joins them before it cuts them into
                # fields: blanks at a line's end would shift every number behind it.
                fields = [
                    float(line[k : k + 13])
                    for line in data.lines[first + 2 : first + 4]
                    for k in range(0, len(line.rstrip()), 13)
                ]
                raw[number] = (kind, reference, np.array(fields).reshape(3, 3))
        except (ValueError, IndexError) as error:
            raise _damaged(path, data.place, _SYSTEMS_BY_POINTS, error) from error
    return {number: _resolved(path, number, raw) for number in raw}


def _damaged(path: Path, place: int, kind: int, error: Exception) -> FileFormatError:
    reason = " ".join(str(error).split())
    return FileFormatError(f"{path}: data set {place} (type {kind}) is damaged ({reason}); export it again")


def _resolved(
    path: Path, number: int, raw: Mapping[int, tuple[int, int, Real]], seen: tuple[int, ...] = ()
) -> _CoordinateSystem:
    """Return the system of a number in the structure's axes; ``seen`` holds the systems that refer to it."""
    if number in seen:
        raise FileFormatError(f"{path}: coordinate system {number} refers to itself; correct the file")
    if number not in raw:
        raise FileFormatError(f"{path}: coordinate system {number} is referred to but missing; export it too")
    kind, reference, points = raw[number]
    parent = _CoordinateSystem()
    if reference not in (_GLOBAL, number):
        parent = _resolved(path, reference, raw, (*seen, number))
    origin, on_x, on_xz = (parent.position(point) for point in points)
    x, across = on_x - origin, on_xz - origin
    y = np.cross(across, x)
    if not np.linalg.norm(y) > 0:
        raise FileFormatError(f"{path}: the points of coordinate system {number} lie on one line; correct the file")
    axes = np.array([axis / np.linalg.norm(axis) for axis in (x, y, np.cross(x, y))])
    return _CoordinateSystem(kind, axes, origin)


def _nodes_in(
    path: Path, data: Mapping[str, Any], systems: Mapping[int, _CoordinateSystem], unknown: set[int]
) -> Iterator[tuple[int, tuple[Real, Real]]]:
    """Yield number, position and local axes of each node of a set; missing systems are added to ``unknown``."""
    columns = [np.asarray(data[name], dtype=float) for name in ("node_nums", "def_cs", "disp_cs", "x", "y", "z")]
    if len({len(column) for column in columns}) > 1 or not np.isfinite(columns).all():
        raise FileFormatError(f"{path}: data set {data['place']} (nodes) is damaged or cut short; export it again")
    own = _CoordinateSystem()
    for number, defined_in, measured_in, *coordinates in np.column_stack(columns):
        unknown |= {int(n) for n in (defined_in, measured_in) if n != _GLOBAL and int(n) not in systems}
        definition = systems.get(int(defined_in), own) if data["type"] == _NODES else own
        position = definition.position(np.array(coordinates))
        yield int(number), (position, systems.get(int(measured_in), own).axes_at(position))


def _chains(sets: Sequence[Mapping[str, Any]], nodes: Mapping[int, object]) -> tuple[tuple[tuple[str, ...], ...], int]:
    """Return the lines between nodes, and the number of nodes of lines that are missing; a 0 ends a line."""
    numbers = [[int(node) for node in data["nodes"]] for data in sets]
    groups = [list(group) for row in numbers for is_node, group in groupby(row, key=bool) if is_node]
    missing = {node for group in groups for node in group if node not in nodes}
    chains = [tuple(str(node) for node in group if node in nodes) for group in groups]
    return tuple(chain for chain in chains if len(chain) > 1), len(missing)
