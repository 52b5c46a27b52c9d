"""Geometry in UFF files: nodes (15, 2411), coordinate systems (18, 2420), trace lines (82), units (164)."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition import read_uff_lines, read_uff_sets
from foundation import FileFormatError

from .coordinate_systems import CARTESIAN, GLOBAL, CoordinateSystem, by_matrices, by_points
from .geometry import Geometry

_NODES, _NODES_DOUBLE, _BY_POINTS, _BY_MATRICES, _LINES, _UNITS = 15, 2411, 18, 2420, 82, 164
_LIFTED = 0  # in place of a node: the pen is lifted

Real = NDArray[np.float64]


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
