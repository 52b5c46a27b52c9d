"""A planar chain in mixed natural coordinates: points of the links and relative angles, tied by constraints."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from foundation import InputError

from .planar_robot import PlanarRobot

Real = NDArray[np.float64]


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
        kernel = null_space(self.jacobian(coordinates))
        velocities = kernel @ np.linalg.inv(kernel[2 * n :])
        return velocities.T @ whole @ velocities, np.diag(np.asarray(self.robot.stiffness, dtype=float))
