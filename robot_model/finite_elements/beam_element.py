"""Stiffness and consistent mass of a straight beam element with two nodes, 12 x 12, both beam theories."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .section import Section

Real = NDArray[np.float64]


@lru_cache(maxsize=256)
def beam_stiffness(section: Section, length: float) -> Real:
    """Stiffness over ``(u, v, w, theta_x, theta_y, theta_z)`` of both nodes, local axes, shape (12, 12).

    Exact for loads at the nodes (Przemieniecki, Theory of Matrix Structural Analysis, section 5.6); with shear the
    bending terms are divided by ``1 + Phi``, ``Phi = 12 E I / (kappa G A L^2)``.
    """
    stiffness = np.zeros((12, 12))
    rod = np.array([[1.0, -1.0], [-1.0, 1.0]])
    stiffness[np.ix_([0, 6], [0, 6])] = section.axial / length * rod
    stiffness[np.ix_([3, 9], [3, 9])] = section.torsion / length * rod
    stiffness[np.ix_(_XY, _XY)] = _bending_stiffness(section.bending_z, section.shear_y, length)
    stiffness[np.ix_(_XZ, _XZ)] = _SIGNS * _bending_stiffness(section.bending_y, section.shear_z, length)
    return stiffness


@lru_cache(maxsize=256)
def beam_mass(section: Section, length: float) -> Real:
    """Consistent mass on the same degrees of freedom, shape (12, 12), kg, kg m and kg m^2.

    Rotary inertia where the section has it (Przemieniecki, section 11.6; with shear: Friedman & Kosmatka 1993).
    """
    mass = np.zeros((12, 12))
    rod = np.array([[2.0, 1.0], [1.0, 2.0]]) * length / 6
    mass[np.ix_([0, 6], [0, 6])] = section.mass * rod
    mass[np.ix_([3, 9], [3, 9])] = section.polar * rod
    mass[np.ix_(_XY, _XY)] = _bending_mass(section.bending_z, section.shear_y, section.mass, section.rotary_z, length)
    in_xz = _bending_mass(section.bending_y, section.shear_z, section.mass, section.rotary_y, length)
    mass[np.ix_(_XZ, _XZ)] = _SIGNS * in_xz
    return mass


_XY = [1, 5, 7, 11]
_XZ = [2, 4, 8, 10]
_SIGNS = np.outer([1.0, -1.0, 1.0, -1.0], [1.0, -1.0, 1.0, -1.0])
"""``dw/dx = -theta_y``."""


def _bending_stiffness(bending: float, shear: float, length: float) -> Real:
    phi = 12 * bending / (shear * length**2)
    a, b = 4 + phi, 2 - phi
    unit = np.array(
        [
            [12, 6 * length, -12, 6 * length],
            [6 * length, a * length**2, -6 * length, b * length**2],
            [-12, -6 * length, 12, -6 * length],
            [6 * length, b * length**2, -6 * length, a * length**2],
        ]
    )
    return np.asarray(bending / (length**3 * (1 + phi)) * unit)


def _bending_mass(bending: float, shear: float, mass: float, rotary: float, length: float) -> Real:
    """``integral of rho A N^T N + rho I P^T P`` with the static shapes of deflection N and rotation P."""
    phi = 12 * bending / (shear * length**2)
    points, weights = np.polynomial.legendre.leggauss(4)  # exact to degree 7; N^T N has degree 6
    x, weights = (points + 1) / 2, weights / 2
    whole = 1 + phi
    deflection = np.array(
        [
            (1 - 3 * x**2 + 2 * x**3 + phi * (1 - x)) / whole,
            length * (x - 2 * x**2 + x**3 + phi * (x - x**2) / 2) / whole,
            (3 * x**2 - 2 * x**3 + phi * x) / whole,
            length * (-(x**2) + x**3 - phi * (x - x**2) / 2) / whole,
        ]
    )
    rotation = np.array(
        [
            6 * (x**2 - x) / (length * whole),
            (1 - 4 * x + 3 * x**2 + phi * (1 - x)) / whole,
            6 * (x - x**2) / (length * whole),
            (-2 * x + 3 * x**2 + phi * x) / whole,
        ]
    )
    return np.asarray(
        length * ((deflection * weights * mass) @ deflection.T + (rotation * weights * rotary) @ rotation.T)
    )
