"""Finite elements of the trial's own: beams in space by their flexibility, and the null space of the joints."""

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]


def tube(outer: float, inner: float, young: float, shear: float, density: float) -> dict[str, float]:
    """Section numbers of a round tube, with Cowper's shear factor."""
    area, second = np.pi / 4 * (outer**2 - inner**2), np.pi / 64 * (outer**4 - inner**4)
    nu, m2 = young / (2 * shear) - 1, (inner / outer) ** 2
    kappa = 6 * (1 + nu) * (1 + m2) ** 2 / ((7 + 6 * nu) * (1 + m2) ** 2 + (20 + 12 * nu) * m2)
    return {
        "ea": young * area,
        "ei": young * second,
        "gj": 2 * shear * second,
        "ga": kappa * shear * area,
        "mass": density * area,
        "rotary": density * second,
    }


def beam_matrices(section: dict[str, float], start: Real, end: Real) -> tuple[Real, Real]:
    """Stiffness and mass (12, 12) of one element between two points, in the base frame.

    The stiffness inverts the flexibility of the free end under a unit load; the mass is lumped along eleven slices that
    move with the static shapes (Simpson's rule), so that neither formula of the tested program is used.
    """
    length = float(np.linalg.norm(end - start))
    x = (end - start) / length
    helper = np.eye(3)[int(np.argmin(np.abs(x)))]
    y = np.cross(helper, x)
    y /= np.linalg.norm(y)
    turn = np.kron(np.eye(2), np.array([x, y, np.cross(x, y)]))
    flexible = _flexibility(section, length)
    stiff = np.linalg.inv(flexible)
    carry = _carried(length)  # motion of the free end when the root moves as a rigid body
    both = np.hstack([-carry, np.eye(6)])
    stiffness = both.T @ stiff @ both
    mass = np.zeros((12, 12))
    for place, weight in zip(np.linspace(0, 1, 11), _simpson(11), strict=True):
        shape = _shape(section, length, place, stiff, both)
        inertia = np.diag([1.0, 1, 1, 0, 0, 0]) * section["mass"]
        inertia[3:, 3:] = section["rotary"] * np.diag([2.0, 1, 1])
        mass += weight * length * shape.T @ inertia @ shape
    whole = np.kron(np.eye(2), turn)
    return whole.T @ stiffness @ whole, whole.T @ mass @ whole


def _flexibility(section: dict[str, float], length: float) -> Real:
    """Motion of a cantilever's free end over force and moment there, local axes, (6, 6)."""
    flexible = np.zeros((6, 6))
    flexible[0, 0], flexible[3, 3] = length / section["ea"], length / section["gj"]
    bend, ei = length**3 / (3 * section["ei"]) + length / section["ga"], section["ei"]
    flexible[1, 1] = flexible[2, 2] = bend
    flexible[5, 5] = flexible[4, 4] = length / ei
    flexible[1, 5] = flexible[5, 1] = length**2 / (2 * ei)
    flexible[2, 4] = flexible[4, 2] = -(length**2) / (2 * ei)
    return flexible


def _carried(arm: float) -> Real:
    carry = np.eye(6)
    carry[1, 5], carry[2, 4] = arm, -arm
    return carry


def _shape(section: dict[str, float], length: float, share: float, stiff: Real, both: Real) -> Real:
    """Motion at a share of the length over the twelve end motions: rigid part, and bending under the end's load."""
    at = share * length
    root = np.hstack([_carried(at), np.zeros((6, 6))])
    load = stiff @ both  # force and moment at the free end
    part = _flexibility(section, at) if at else np.zeros((6, 6))
    transfer = np.eye(6)  # the load at the free end, told at the place
    transfer[4, 2], transfer[5, 1] = -(length - at), length - at
    return np.asarray(root + part @ transfer @ load)


def _simpson(count: int) -> Real:
    weights = np.ones(count)
    weights[1:-1:2], weights[2:-1:2] = 4, 2
    return weights / weights.sum()


def null_basis(rows: Real) -> Real:
    """Orthonormal basis of what the constraints leave free."""
    _, sizes, vectors = np.linalg.svd(rows)
    rank = int(np.sum(sizes > 1e-9 * sizes[0]))
    return np.asarray(vectors[rank:].T)
