"""Coordinate systems of UFF files (data sets 18 and 2420): where a point lies and how its axes stand."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition import UffLines
from foundation import FileFormatError

Real = NDArray[np.float64]

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
