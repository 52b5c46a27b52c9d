"""Planar and spatial chains in mixed natural coordinates."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy

from millfrf.core import InputError, Real

from .kinematics.mechanism import Mechanism
from .planar import PlanarRobot


@dataclass(frozen=True)
class NaturalChain:
    """Constraint equations of a chain in the coordinates ``(x_1, y_1, ..., x_n, y_n, psi_1, ..., psi_n)``.

    Points are the ends of the links, psi the relative angles. Constraint 1000 holds a length,
    ``(r_i - r_j) . (r_i - r_j) - L^2 = 0`` (Ferreras-Higuero et al., Eq. 24; Garcia de Jalon & Bayo, Kinematic and
    Dynamic Simulation of Multibody Systems, chapter 2); the angle of a link to the one before it is tied by
    ``cross cos(psi) - dot sin(psi) = 0``, which has no singularity at 0 or 180 degrees.
    """

    robot: PlanarRobot

    def start(self, angles: Real) -> Real:
        """Coordinates that satisfy the constraints at relative joint angles (n_links,)."""
        directions = self.robot.directions(angles)
        along = self.robot.lengths[:, None] * np.column_stack([np.cos(directions), np.sin(directions)])
        return np.concatenate([np.cumsum(along, axis=0).ravel(), angles])

    def _links(self, coordinates: Real) -> Real:
        """Vectors along the base's reach and then along the links, shape (n_links + 1, 2)."""
        n = len(self.robot.lengths)
        points = np.vstack([[0.0, 0.0], coordinates[: 2 * n].reshape(n, 2)])
        return np.vstack([[1.0, 0.0], np.diff(points, axis=0)])

    def constraints(self, coordinates: Real) -> Real:
        """Values of all constraints, shape (2 n_links,): lengths, m^2, then angles."""
        n = len(self.robot.lengths)
        links, psi = self._links(coordinates), coordinates[2 * n :]
        before, after = links[:-1], links[1:]
        cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
        dot = np.sum(before * after, axis=1)
        return np.concatenate(
            [np.sum(after**2, axis=1) - self.robot.lengths**2, cross * np.cos(psi) - dot * np.sin(psi)]
        )

    def jacobian(self, coordinates: Real) -> Real:
        """Derivative of the constraints over the coordinates, shape (2 n_links, 3 n_links)."""
        n = len(self.robot.lengths)
        links, psi = self._links(coordinates), coordinates[2 * n :]
        rows = np.zeros((2 * n, 3 * n))
        for i in range(n):
            before, after = links[i], links[i + 1]
            cosine, sine = np.cos(psi[i]), np.sin(psi[i])
            over_after = cosine * np.array([-before[1], before[0]]) - sine * before
            over_before = cosine * np.array([after[1], -after[0]]) - sine * after
            for row, gradient in ((i, 2 * after), (n + i, over_after)):
                rows[row, 2 * i : 2 * i + 2] += gradient
                if i > 0:
                    rows[row, 2 * i - 2 : 2 * i] -= gradient
            if i > 0:
                rows[n + i, 2 * i - 2 : 2 * i] += over_before
            if i > 1:
                rows[n + i, 2 * i - 4 : 2 * i - 2] -= over_before
            dot = float(before @ after)
            cross = before[0] * after[1] - before[1] * after[0]
            rows[n + i, 2 * n + i] = -cross * sine - dot * cosine
        return rows

    def place(self, angles: Real, start: Real) -> Real:
        """Position problem: coordinates at given relative angles by Newton's method from ``start`` (Eq. 23).

        Raises
        ------
        InputError
            It does not converge from there.
        """
        n = len(self.robot.lengths)
        coordinates = np.concatenate([start[: 2 * n], angles])
        for _ in range(50):
            values = self.constraints(coordinates)
            if np.abs(values).max() < 1e-13:
                return coordinates
            coordinates[: 2 * n] -= np.linalg.solve(self.jacobian(coordinates)[:, : 2 * n], values)
        raise InputError("the points of the chain do not follow the angles from there; start nearer")

    def matrices(self, coordinates: Real) -> tuple[Real, Real]:
        """Mass and stiffness in the small relative angles, (n_links, n_links), kg m^2 and N m/rad.

        A uniform bar has ``m / 6 [[2 I, I], [I, 2 I]]`` over its two points; velocities that keep the constraints are
        ``q' = R psi'`` with R from the null space of the Jacobian.
        """
        n = len(self.robot.lengths)
        mass = np.zeros((2 * n + 2, 2 * n + 2))
        for i, weight in enumerate(self.robot.masses):
            block = slice(2 * i, 2 * i + 4)
            mass[block, block] += weight / 6 * np.kron(np.array([[2.0, 1.0], [1.0, 2.0]]), np.eye(2))
        whole = np.zeros((3 * n, 3 * n))
        whole[: 2 * n, : 2 * n] = mass[2:, 2:]
        kernel = scipy.linalg.null_space(self.jacobian(coordinates))
        velocities = kernel @ np.linalg.inv(kernel[2 * n :])
        return velocities.T @ whole @ velocities, np.diag(np.asarray(self.robot.stiffness, dtype=float))


_SAME = 1e-9
"""Distance, m, and difference of unit vectors below which two are one."""

LENGTH, UNIT, INCLINED, BETWEEN = 1000, 1001, 1002, 1003
"""Constraints of Ferreras-Higuero et al., Eqs. 24-27: a link's length, a vector's norm, vector and link, vectors."""

COMBINED, ANGLE = 1004, 1005
"""Ours: a vector that is a combination of its body's other vectors; a joint angle tied to the bodies it joins."""


@dataclass(frozen=True)
class _Vector:
    """A vector that is linear in the coordinates: ``matrix @ x + constant``, shapes (3, n) and (3,)."""

    matrix: Real
    constant: Real
    is_link: bool

    def value(self, x: Real) -> Real:
        return np.asarray(self.matrix @ x + self.constant)


@dataclass(frozen=True)
class NaturalRobot:
    """Coordinates and constraints of an open chain of revolute joints.

    Each joint has a point and the unit vector of its axis; neighbours share them where they coincide or are parallel,
    so that few are left. A body's vectors keep the products that they have in the reference posture: constraints 1000
    to 1003. Where they lie in a plane, the third is a combination of two, which is linear and never singular. Angles
    are tied by ``sin_ab cos(psi) - cos_ab sin(psi) = 0`` (Garcia de Jalon & Bayo, Kinematic and Dynamic Simulation of
    Multibody Systems, chapters 2 and 3).

    Parameters
    ----------
    start : (n,)
        Coordinates in the reference posture.
    reference : (n_joints,), rad
        Its joint values.
    products
        Constraints 1000 to 1003: identifier, two vectors and the product they keep.
    combinations
        Constraints 1004: a vector, two others and the two factors.
    angles
        Constraints 1005: axis, a vector of the body before and one of the body after, and the angle in the reference.
    tool
        The tool's point.
    """

    start: Real
    reference: Real
    products: tuple[tuple[int, _Vector, _Vector, float], ...]
    combinations: tuple[tuple[_Vector, _Vector, _Vector, Real], ...]
    angles: tuple[tuple[_Vector, _Vector, _Vector, float], ...]
    tool: _Vector

    def identifiers(self) -> list[int]:
        """Identifier of every scalar constraint, in the order of :meth:`constraints`."""
        return [row[0] for row in self.products] + [COMBINED] * 3 * len(self.combinations) + [ANGLE] * len(self.angles)

    def constraints(self, x: Real, q: Real) -> tuple[Real, Real]:
        """Values of all constraints at joint values q, (n_rows,), and their derivatives over x, (n_rows, n)."""
        values: list[float] = []
        rows: list[Real] = []
        for _, first, second, product in self.products:
            a, b = first.value(x), second.value(x)
            values.append(float(a @ b) - product)
            rows.append(b @ first.matrix + a @ second.matrix)
        for vector, first, second, factors in self.combinations:
            gap = vector.value(x) - factors[0] * first.value(x) - factors[1] * second.value(x)
            values += gap.tolist()
            rows += list(vector.matrix - factors[0] * first.matrix - factors[1] * second.matrix)
        for (axis, before, after, angle), psi in zip(self.angles, q - self.reference, strict=True):
            value, row = _angle_row(axis, before, after, angle + psi, x)
            values.append(value)
            rows.append(row)
        return np.array(values), np.array(rows)

    def place(self, q: Real, start: Real | None = None) -> Real:
        """Position problem (Eq. 23): coordinates at joint values q by Gauss-Newton from ``start`` or the reference.

        Raises
        ------
        InputError
            It does not converge from there.
        """
        x = np.array(self.start if start is None else start)
        for _ in range(60):
            values, rows = self.constraints(x, q)
            if np.abs(values).max() < 1e-13:
                return x
            step = np.linalg.lstsq(rows, -values, rcond=1e-12)[0]
            x += step * min(1.0, 0.5 / max(float(np.abs(step).max()), 1e-300))
        if np.abs(values).max() < 1e-10:
            return x
        raise InputError("the points of the robot do not follow the joint values from there; start nearer")

    def tool_point(self, x: Real) -> Real:
        """Place of the tool, m, shape (3,)."""
        return self.tool.value(x)


def natural_robot(mechanism: Mechanism, reference: Real) -> NaturalRobot:
    """Build the coordinates of an open chain from a reference posture in which no axis meets its neighbour's line.

    Raises
    ------
    InputError
        Closed loops, prismatic joints, or a body whose vectors are all along one line.
    """
    if mechanism.closures or any(mechanism.frames[i].motion != "revolute" for i in mechanism.moving):
        raise InputError("natural coordinates are given for open chains of revolute joints")
    placed = mechanism.transforms(reference)
    frames = [placed[i] for i in mechanism.moving] + [placed[mechanism.index(mechanism.tool)]]
    builder = _Builder()
    bodies: list[list[_Entry]] = []
    point, axis, side = (_Entry(fixed=frames[0][:3, column].copy()) for column in (3, 2, 0))
    bodies.append([side])
    joints = [axis]
    for here, after in pairwise(frames):
        next_point = builder.either(here[:3, 3], after[:3, 3], point)
        next_axis = builder.either(here[:3, 2], after[:3, 2], axis)
        members = [axis, *([next_axis] if next_axis is not axis else [])]
        if next_point is not point:
            members.append(_Entry(link=(point, next_point)))
        if after is frames[-1]:
            members.append(builder.new(after[:3, 0]))
        bodies.append(members)
        point, axis = next_point, next_axis
        joints.append(axis)
    return builder.finished(bodies, joints[:-1], point, np.asarray(reference, dtype=float))


@dataclass(frozen=True, eq=False)
class _Entry:
    """A fixed vector, three coordinates from ``first`` on, or the link between two points."""

    first: int = -1
    fixed: Real | None = None
    link: "tuple[_Entry, _Entry] | None" = None


class _Builder:
    """Collects coordinates; entries are turned into linear vectors when their number is known."""

    def __init__(self) -> None:
        self.values: list[float] = []

    def either(self, here: Real, there: Real, shared: "_Entry") -> "_Entry":
        """Share a node where the two are the same in the reference (and so in every posture), else make a new one."""
        return shared if np.linalg.norm(there - here) < _SAME else self.new(there)

    def new(self, value: Real) -> "_Entry":
        self.values += [float(entry) for entry in value]
        return _Entry(first=len(self.values) - 3)

    def vector(self, entry: "_Entry") -> _Vector:
        matrix = np.zeros((3, len(self.values)))
        if entry.link is not None:
            start, end = (self.vector(point) for point in entry.link)
            return _Vector(end.matrix - start.matrix, end.constant - start.constant, True)
        if entry.fixed is not None:
            return _Vector(matrix, entry.fixed, False)
        matrix[:, entry.first : entry.first + 3] = np.eye(3)
        return _Vector(matrix, np.zeros(3), False)

    def finished(self, bodies: list[list["_Entry"]], joints: list["_Entry"], tool: "_Entry", q: Real) -> NaturalRobot:
        x = np.array(self.values)
        vectors = [[self.vector(entry) for entry in body] for body in bodies]
        products: list[tuple[int, _Vector, _Vector, float]] = []
        combinations: list[tuple[_Vector, _Vector, _Vector, Real]] = []
        for body in vectors[1:]:
            _body_constraints(body, x, products, combinations)
        angles = []
        for number, entry in enumerate(joints):
            axis = self.vector(entry)
            before, after = _across(vectors[number], axis, x), _across(vectors[number + 1], axis, x)
            angles.append((axis, before, after, _angle(axis.value(x), before.value(x), after.value(x))))
        return NaturalRobot(x, q, tuple(products), tuple(combinations), tuple(angles), self.vector(tool))


def _body_constraints(
    body: list[_Vector],
    x: Real,
    products: list[tuple[int, _Vector, _Vector, float]],
    combinations: list[tuple[_Vector, _Vector, _Vector, Real]],
) -> None:
    """Products of independent vectors of a body; the others as combinations."""
    basis: list[_Vector] = []
    for vector in body:
        chosen = np.array([other.value(x) for other in (*basis, vector)])
        if np.linalg.matrix_rank(chosen, tol=1e-7) == len(chosen):
            basis.append(vector)
    if len(basis) < 2:
        raise InputError(
            "a body's points and axes lie on one line; take a reference posture or frames that show its turn"
        )
    for i, first in enumerate(basis):
        for second in basis[i:]:
            if not (np.any(first.matrix) or np.any(second.matrix)):
                continue
            products.append((_identifier(first, second, first is second), first, second, _product(first, second, x)))
    for vector in body:
        if not any(vector is other for other in basis):
            pair = np.column_stack([basis[0].value(x), basis[1].value(x)])
            factors = np.asarray(np.linalg.lstsq(pair, vector.value(x), rcond=None)[0], dtype=float)
            combinations.append((vector, basis[0], basis[1], factors))


def _identifier(first: _Vector, second: _Vector, same: bool) -> int:
    if same:
        return LENGTH if first.is_link else UNIT
    return INCLINED if first.is_link or second.is_link else BETWEEN


def _product(first: _Vector, second: _Vector, x: Real) -> float:
    return float(first.value(x) @ second.value(x))


def _across(body: list[_Vector], axis: _Vector, x: Real) -> _Vector:
    """The vector of a body that is farthest from parallel to an axis."""
    along = axis.value(x)
    return max(body, key=lambda v: float(np.linalg.norm(np.cross(along, v.value(x))) / np.linalg.norm(v.value(x))))


def _angle(axis: Real, before: Real, after: Real) -> float:
    return float(np.arctan2(axis @ np.cross(before, after), before @ after - (before @ axis) * (after @ axis)))


def _angle_row(axis: _Vector, before: _Vector, after: _Vector, angle: float, x: Real) -> tuple[float, Real]:
    u, a, b = axis.value(x), before.value(x), after.value(x)
    c, s = np.cos(angle), np.sin(angle)
    value = c * (u @ np.cross(a, b)) - s * (a @ b - (a @ u) * (b @ u))
    over_u = c * np.cross(a, b) + s * (a * (b @ u) + b * (a @ u))
    over_a = c * np.cross(b, u) - s * (b - u * (b @ u))
    over_b = c * np.cross(u, a) - s * (a - u * (a @ u))
    return float(value), over_u @ axis.matrix + over_a @ before.matrix + over_b @ after.matrix
