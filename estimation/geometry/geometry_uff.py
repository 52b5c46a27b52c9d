"""Geometry in UFF files: nodes, coordinate systems, trace lines, units."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from acquisition import UffLines, read_uff_lines, read_uff_sets
from millfrf.core import FileFormatError, Real

from .geometry_model import Geometry

CARTESIAN, CYLINDRICAL, SPHERICAL = 0, 1, 2
_DEEPEST = 32
_LINES_EACH, _WIDTH = 4, 13
GLOBAL = 0


@dataclass(frozen=True)
class CoordinateSystem:
    """One coordinate system of a file, expressed in the structure's own axes.

    Parameters
    ----------
    kind
        0: Cartesian, 1: cylindrical (r, angle in degrees, z), 2: spherical (r, angle from z, angle around z).
    axes : (3, 3)
        Unit vectors of its X, Y and Z as rows.
    origin : (3,)
        Position of its origin, in the file's unit of length.
    """

    kind: int
    axes: Real
    origin: Real

    def place(self, coordinates: Real) -> Real:
        """A point's position (3,) in the structure's axes from its coordinates (3,) in this system."""
        a, b, c = coordinates
        if self.kind == CYLINDRICAL:
            local = np.array([a * np.cos(np.radians(b)), a * np.sin(np.radians(b)), c])
        elif self.kind == SPHERICAL:
            polar, around = np.radians(b), np.radians(c)
            local = a * np.array([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)])
        else:
            local = np.asarray(coordinates, dtype=float)
        return np.asarray(local @ self.axes + self.origin)

    def axes_at(self, position: Real) -> Real:
        """Directions (3, 3) in which a point at ``position`` (3,) is measured: rows are its first, second, third."""
        if self.kind == CARTESIAN:
            return self.axes
        x, y, z = (position - self.origin) @ self.axes.T
        around = np.arctan2(y, x)
        outward = np.array([np.cos(around), np.sin(around), 0.0])
        along = np.array([-np.sin(around), np.cos(around), 0.0])
        if self.kind == CYLINDRICAL:
            return np.asarray(np.array([outward, along, [0.0, 0.0, 1.0]]) @ self.axes)
        polar = np.arctan2(np.hypot(x, y), z)
        upward = np.array([0.0, 0.0, 1.0])
        radial = np.sin(polar) * outward + np.cos(polar) * upward
        downward = np.cos(polar) * outward - np.sin(polar) * upward
        return np.asarray(np.array([radial, downward, along]) @ self.axes)


def by_matrices(path: Path, sets: Sequence[Mapping[str, Any]]) -> dict[int, CoordinateSystem]:
    """Systems of data sets 2420 by number: rows of a matrix are the axes, its fourth row is the origin.

    Raises
    ------
    FileFormatError
        A damaged set.
    """
    found = {}
    for one in sets:
        try:
            for number, kind, matrix in zip(one["CS_sys_labels"], one["CS_types"], one["CS_matrices"], strict=True):
                rows = np.asarray(matrix, dtype=float).reshape(4, 3)
                if not np.isfinite(rows).all():
                    raise ValueError(f"system {number} is not finite")
                found[int(number)] = CoordinateSystem(int(kind), rows[:3], rows[3])
        except (ValueError, TypeError) as error:
            raise FileFormatError(
                f"{path}: data set {one['place']} (type 2420) is damaged ({' '.join(str(error).split())}); export again"
            ) from error
    return found


def by_points(path: Path, sets: Sequence[UffLines]) -> dict[int, CoordinateSystem]:
    """Systems of data sets 18 by number: an origin, a point on +X and one in the plane of +X and +Z, in another system.

    The lines are read here: pyuff joins them before it cuts them into fields, so that blanks at a line's end shift
    every number behind it.

    Raises
    ------
    FileFormatError
        A damaged set, points on one line, or systems that refer to each other in a circle.
    """
    raw: dict[int, tuple[int, int, Real]] = {}
    for one in sets:
        try:
            for at in range(0, len(one.lines), _LINES_EACH):
                number, kind, reference = (int(word) for word in one.lines[at].split()[:3])
                fields = [
                    float(line[k : k + _WIDTH])
                    for line in one.lines[at + 2 : at + _LINES_EACH]
                    for k in range(0, len(line.rstrip()), _WIDTH)
                ]
                raw[number] = (kind, reference, np.array(fields).reshape(3, 3))
        except (ValueError, IndexError) as error:
            raise FileFormatError(
                f"{path}: data set {one.place} (type 18) is damaged ({' '.join(str(error).split())}); export it again"
            ) from error
    return {number: _resolved(path, number, raw) for number in raw}


def _resolved(path: Path, number: int, raw: Mapping[int, tuple[int, int, Real]], depth: int = 0) -> CoordinateSystem:
    if number not in raw:
        if number == GLOBAL:
            return CoordinateSystem(CARTESIAN, np.eye(3), np.zeros(3))
        raise FileFormatError(f"{path}: coordinate system {number} is referred to and not there; export it too")
    if depth > _DEEPEST:
        raise FileFormatError(f"{path}: coordinate system {number} refers to itself; correct the file")
    kind, reference, points = raw[number]
    parent = CoordinateSystem(CARTESIAN, np.eye(3), np.zeros(3))
    if reference not in (GLOBAL, number):
        parent = _resolved(path, reference, raw, depth + 1)
    origin, on_x, on_xz = (parent.place(point) for point in points)
    x, across = on_x - origin, on_xz - origin
    y = np.cross(across, x)
    if not np.linalg.norm(y) > 0:
        raise FileFormatError(f"{path}: the points of coordinate system {number} lie on one line; correct the file")
    axes = np.array([x / np.linalg.norm(x), y / np.linalg.norm(y), np.cross(x, y) / np.linalg.norm(np.cross(x, y))])
    return CoordinateSystem(kind, axes, origin)


_NODES, _NODES_DOUBLE, _BY_POINTS, _BY_MATRICES, _LINES, _UNITS = 15, 2411, 18, 2420, 82, 164
_LIFTED = 0  # in place of a node: the pen is lifted


def read_geometry_uff(path: Path) -> tuple[Geometry, tuple[str, ...]]:
    """The geometry of a UFF file, its nodes named by their numbers; also what the file leaves open.

    Coordinates of set 15 are those of the node's definition system, those of set 2411 the structure's own. A node's
    displacement system gives its local axes.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        No nodes inside, a node that is given twice at different places, or a damaged set.
    """
    sets = read_uff_sets(path, (_NODES, _NODES_DOUBLE, _BY_MATRICES, _LINES, _UNITS))
    kinds = {kind: [one for one in sets if one["type"] == kind] for kind in {one["type"] for one in sets}}
    node_sets = [*kinds.get(_NODES, []), *kinds.get(_NODES_DOUBLE, [])]
    if not node_sets:
        raise FileFormatError(f"{path} holds no nodes (data set 15 or 2411); export the geometry too")
    systems = by_points(path, read_uff_lines(path, (_BY_POINTS,))) | by_matrices(path, kinds.get(_BY_MATRICES, []))
    metre = float(kinds[_UNITS][0]["length"]) if _UNITS in kinds else 1.0
    notes = [] if _UNITS in kinds else [f"{path.name}: positions taken in m, since the file states no units (set 164)"]
    table: dict[int, tuple[Real, Real]] = {}
    unknown: set[int] = set()
    for one in node_sets:
        for number, node in _nodes_of(path, one, systems, unknown):
            if number in table and not np.allclose(table[number][0], node[0]):
                raise FileFormatError(f"{path}: node {number} lies at two places; give each node once")
            table[number] = node
    if unknown:
        named = ", ".join(map(str, sorted(unknown)))
        notes.append(f"{path.name}: coordinate system {named} is not there; the structure's own axes are taken")
    lines, lost = _chains(kinds.get(_LINES, []), table)
    if lost:
        notes.append(f"{path.name}: lines to {lost} nodes that are not there are left out")
    positions, axes = (np.array([node[k] for node in table.values()]) for k in (0, 1))
    local = None if np.allclose(axes, np.eye(3)) else axes
    return Geometry(tuple(map(str, table)), positions / metre, local, lines), tuple(notes)


def _nodes_of(
    path: Path, one: Mapping[str, Any], systems: Mapping[int, CoordinateSystem], unknown: set[int]
) -> list[tuple[int, tuple[Real, Real]]]:
    """Number, position and local axes of each node of a set."""
    columns = [np.asarray(one[name], dtype=float) for name in ("node_nums", "def_cs", "disp_cs", "x", "y", "z")]
    if len({len(column) for column in columns}) > 1 or not np.isfinite(columns).all():
        raise FileFormatError(f"{path}: data set {one['place']} (nodes) is damaged or cut short; export it again")
    own = CoordinateSystem(CARTESIAN, np.eye(3), np.zeros(3))
    found = []
    for number, defined_in, measured_in, *coordinates in np.column_stack(columns):
        unknown |= {int(n) for n in (defined_in, measured_in) if n != GLOBAL and int(n) not in systems}
        place = systems.get(int(defined_in), own) if one["type"] == _NODES else own
        position = place.place(np.array(coordinates))
        found.append((int(number), (position, systems.get(int(measured_in), own).axes_at(position))))
    return found


def _chains(sets: Sequence[Mapping[str, Any]], known: Mapping[int, object]) -> tuple[tuple[tuple[str, ...], ...], int]:
    """Lines between nodes, cut where the pen is lifted; and how many nodes in them are not there."""
    chains: list[tuple[str, ...]] = []
    missing: set[int] = set()
    for one in sets:
        for lifted, nodes in groupby((int(node) for node in one["nodes"]), key=lambda node: node == _LIFTED):
            chain = [] if lifted else list(nodes)
            missing |= {node for node in chain if node not in known}
            present = tuple(str(node) for node in chain if node in known)
            if len(present) > 1:
                chains.append(present)
    return tuple(chains), len(missing)
