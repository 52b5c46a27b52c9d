"""Planar and spatial chains in mixed natural coordinates: an independent check of kinematics and mass matrices."""

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

    The points are the ends of the links, psi the relative angles. Constraint 1000 keeps a length,
    ``(r_i - r_j) . (r_i - r_j) - L^2 = 0`` (Ferreras-Higuero et al., Eq. 24; Garcia de Jalon & Bayo, Kinematic and
    Dynamic Simulation of Multibody Systems, chapter 2). ``cross cos(psi) - dot sin(psi) = 0`` connects the angle of a
    link to the link before it, without a singularity at 0 or 180 degrees.
    """

    robot: PlanarRobot

    def start(self, angles: Real) -> Real:
        """Compute the coordinates that satisfy the constraints at relative joint angles (n_links,), rad."""
        return np.concatenate([np.cumsum(self.robot.link_vectors(angles), axis=0).ravel(), angles])

    def _links(self, coordinates: Real) -> Real:
        """Return the horizontal unit vector of the base, followed by the vector along each link, (n_links + 1, 2)."""
        n = len(self.robot.lengths)
        points = np.vstack([[0.0, 0.0], coordinates[: 2 * n].reshape(n, 2)])
        return np.vstack([[1.0, 0.0], np.diff(points, axis=0)])

    def constraints(self, coordinates: Real) -> Real:
        """Compute the residuals of all constraints, (2 n_links,): first of squared lengths, m^2, then of angles."""
        n = len(self.robot.lengths)
        links, psi = self._links(coordinates), coordinates[2 * n :]
        before, after = links[:-1], links[1:]
        cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
        dot = np.sum(before * after, axis=1)
        return np.concatenate(
            [np.sum(after**2, axis=1) - self.robot.lengths**2, cross * np.cos(psi) - dot * np.sin(psi)]
        )

    def jacobian(self, coordinates: Real) -> Real:
        """Compute the derivative of the constraints over the coordinates, (2 n_links, 3 n_links)."""
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
        """Find the coordinates at relative joint angles by Newton's method from ``start`` (Eq. 23)."""
        n = len(self.robot.lengths)
        coordinates = np.concatenate([start[: 2 * n], angles])
        for _ in range(50):
            values = self.constraints(coordinates)
            if np.abs(values).max() < 1e-13:
                return coordinates
            coordinates[: 2 * n] -= np.linalg.solve(self.jacobian(coordinates)[:, : 2 * n], values)
        raise InputError("the points of the chain do not follow the angles from there; start nearer")

    def matrices(self, coordinates: Real) -> tuple[Real, Real]:
        """Compute mass and stiffness over small relative angles, each (n_links, n_links), kg m^2 and N m/rad.

        A uniform bar has ``m / 6 [[2 I, I], [I, 2 I]]`` over its two points. Velocities that satisfy the constraints
        are ``q' = R psi'`` with R from the null space of the Jacobian.
        """
        n = len(self.robot.lengths)
        mass = np.zeros((2 * n + 2, 2 * n + 2))
        for i, weight in enumerate(self.robot.masses):
            block = slice(2 * i, 2 * i + 4)
            mass[block, block] += weight / 6 * np.kron(np.array([[2.0, 1.0], [1.0, 2.0]]), np.eye(2))
        over_coordinates = np.zeros((3 * n, 3 * n))
        over_coordinates[: 2 * n, : 2 * n] = mass[2:, 2:]  # the first point is fixed, the angles have no mass
        kernel = scipy.linalg.null_space(self.jacobian(coordinates))
        velocities = kernel @ np.linalg.inv(kernel[2 * n :])
        return velocities.T @ over_coordinates @ velocities, np.diag(np.asarray(self.robot.stiffness, dtype=float))


# identifiers of Ferreras-Higuero et al., Eqs. 24-27: length of a link, norm of a vector, product of vector and link,
# product of two vectors
LENGTH, UNIT, INCLINED, BETWEEN = 1000, 1001, 1002, 1003
# not in the paper: a vector as combination of its body's other vectors; a joint angle between two bodies
COMBINED, ANGLE = 1004, 1005


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

    Each joint has a point and the unit vector of its axis. Neighbouring joints have one common point where their points
    coincide, and one common axis where their axes are parallel: fewer coordinates. The scalar products of a body's
    vectors stay as in the reference posture (constraints 1000 to 1003). A vector that lies in the plane of two other
    vectors is their linear combination, which is never singular. Joint angles satisfy
    ``sin_ab cos(psi) - cos_ab sin(psi) = 0`` (Garcia de Jalon & Bayo, Kinematic and Dynamic Simulation of Multibody
    Systems, chapters 2 and 3).

    Parameters
    ----------
    start : (n,)
        Coordinates in the reference posture.
    reference : (n_joints,), rad
        Joint values of the reference posture.
    products
        Constraints 1000 to 1003: identifier, two vectors and their constant product.
    combinations
        Constraints 1004: a vector, the vectors of which it is a combination, and their factors.
    angles
        Constraints 1005: joint axis, a vector of the body before the joint, a vector of the body after it, and the
        angle between them in the reference posture.
    tool
        Point of the tool.
    """

    start: Real
    reference: Real
    products: tuple[tuple[int, _Vector, _Vector, float], ...]
    combinations: tuple[tuple[_Vector, _Vector, _Vector, Real], ...]
    angles: tuple[tuple[_Vector, _Vector, _Vector, float], ...]
    tool: _Vector

    def identifiers(self) -> list[int]:
        """Return the identifier (1000 to 1005) of every scalar constraint, in the order of :meth:`constraints`."""
        return [row[0] for row in self.products] + [COMBINED] * 3 * len(self.combinations) + [ANGLE] * len(self.angles)

    def constraints(self, x: Real, q: Real) -> tuple[Real, Real]:
        """Compute all residuals, (n_constraints,), at joint values q, and their derivatives over the coordinates x."""
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
        """Find the coordinates at joint values q by Gauss-Newton steps from ``start`` (position problem, Eq. 23)."""
        x = np.array(self.start if start is None else start)
        for _ in range(60):
            values, rows = self.constraints(x, q)
            if np.abs(values).max() < 1e-13:
                return x
            step = np.linalg.lstsq(rows, -values, rcond=1e-12)[0]
            # a longer step may jump to another assembly
            x += step * min(1.0, 0.5 / max(float(np.abs(step).max()), 1e-300))
        if np.abs(values).max() < 1e-10:  # rounding of a long chain
            return x
        raise InputError("the points of the robot do not follow the joint values from there; start nearer")

    def tool_point(self, x: Real) -> Real:
        """Position of the tool, m, (3,)."""
        return self.tool.value(x)


def natural_robot(mechanism: Mechanism, reference: Real) -> NaturalRobot:
    """Build the coordinates of an open chain from a reference posture.

    Raise an `InputError` for closed loops, prismatic joints, or a body whose vectors all lie along one line.
    """
    if mechanism.closures or any(joint.motion != "revolute" for joint in mechanism.joints):
        raise InputError("natural coordinates are given for open chains of revolute joints")
    placed = mechanism.transforms(reference)
    frames = [placed[i] for i in mechanism.moving] + [placed[mechanism.index(mechanism.tool)]]
    # points and axes that are equal in the reference are equal in every posture, and so have the same coordinates
    differs = [[np.linalg.norm((b - a)[:3, column]) >= 1e-9 for column in (3, 2)] for a, b in pairwise(frames)]
    x = np.zeros(3 * (int(np.sum(differs)) + 1))
    unused = iter(range(0, len(x), 3))

    def new(value: Real) -> _Vector:
        first = next(unused)
        x[first : first + 3] = value
        matrix = np.zeros((3, len(x)))
        matrix[:, first : first + 3] = np.eye(3)
        return _Vector(matrix, np.zeros(3), False)

    fixed = np.zeros((3, len(x)))
    point, axis, side = (_Vector(fixed, frames[0][:3, column].copy(), False) for column in (3, 2, 0))
    bodies, axes = [[side]], [axis]
    for after, (new_point, new_axis) in zip(frames[1:], differs, strict=True):
        next_point = new(after[:3, 3]) if new_point else point
        next_axis = new(after[:3, 2]) if new_axis else axis
        body = [axis, next_axis] if new_axis else [axis]
        if new_point:
            body.append(_Vector(next_point.matrix - point.matrix, next_point.constant - point.constant, True))
        if after is frames[-1]:
            body.append(new(after[:3, 0]))
        bodies.append(body)
        point, axis = next_point, next_axis
        axes.append(axis)
    products: list[tuple[int, _Vector, _Vector, float]] = []
    combinations: list[tuple[_Vector, _Vector, _Vector, Real]] = []
    for body in bodies[1:]:
        _body_constraints(body, x, products, combinations)
    angles = []
    for axis, body_before, body_after in zip(axes, bodies, bodies[1:], strict=False):
        before, after = _most_inclined(body_before, axis, x), _most_inclined(body_after, axis, x)
        angles.append((axis, before, after, _angle(axis.value(x), before.value(x), after.value(x))))
    q = np.asarray(reference, dtype=float)
    return NaturalRobot(x, q, tuple(products), tuple(combinations), tuple(angles), point)


def _body_constraints(
    body: list[_Vector],
    x: Real,
    products: list[tuple[int, _Vector, _Vector, float]],
    combinations: list[tuple[_Vector, _Vector, _Vector, Real]],
) -> None:
    """Append a body's constraints: products of its independent vectors, and its dependent vectors as combinations."""
    basis: list[_Vector] = []
    for vector in body:
        chosen = np.array([other.value(x) for other in (*basis, vector)])
        if np.linalg.matrix_rank(chosen, tol=1e-7) == len(chosen):
            basis.append(vector)
    if len(basis) < 2:
        raise InputError(
            "a body's points and axes lie on one line, which does not determine its rotation; use other frames"
        )
    for i, first in enumerate(basis):
        for second in basis[i:]:
            if np.any(first.matrix) or np.any(second.matrix):  # two fixed vectors give no constraint
                product = float(first.value(x) @ second.value(x))
                products.append((_identifier(first, second), first, second, product))
    for vector in body:
        if not any(vector is other for other in basis):
            pair = np.column_stack([basis[0].value(x), basis[1].value(x)])
            factors = np.asarray(np.linalg.lstsq(pair, vector.value(x), rcond=None)[0], dtype=float)
            combinations.append((vector, basis[0], basis[1], factors))


def _identifier(first: _Vector, second: _Vector) -> int:
    if first is second:
        return LENGTH if first.is_link else UNIT
    return INCLINED if first.is_link or second.is_link else BETWEEN


def _most_inclined(body: list[_Vector], axis: _Vector, x: Real) -> _Vector:
    """Return the vector of a body that makes the largest angle with an axis."""
    along = axis.value(x)
    return max(body, key=lambda v: float(np.linalg.norm(np.cross(along, v.value(x))) / np.linalg.norm(v.value(x))))


def _angle(axis: Real, before: Real, after: Real) -> float:
    """Compute the angle (rad) about an axis from vector ``before`` to ``after``, both projected across the axis."""
    return float(np.arctan2(axis @ np.cross(before, after), before @ after - (before @ axis) * (after @ axis)))


def _angle_row(axis: _Vector, before: _Vector, after: _Vector, angle: float, x: Real) -> tuple[float, Real]:
    """Compute the residual of constraint 1005 (joint angle) and its derivative over the n coordinates x, (n,)."""
    u, a, b = axis.value(x), before.value(x), after.value(x)
    c, s = np.cos(angle), np.sin(angle)
    value = c * (u @ np.cross(a, b)) - s * (a @ b - (a @ u) * (b @ u))
    over_u = c * np.cross(a, b) + s * (a * (b @ u) + b * (a @ u))
    over_a = c * np.cross(b, u) - s * (b - u * (b @ u))
    over_b = c * np.cross(u, a) - s * (a - u * (a @ u))
    return float(value), over_u @ axis.matrix + over_a @ before.matrix + over_b @ after.matrix
