"""Beam elements with 12 degrees of freedom, and their cross-sections."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from millfrf.core import InputError, Real
from modal_fit import shear_factor


@dataclass(frozen=True)
class Section:
    """Stiffness and inertia per length of a uniform beam along its local x axis.

    With infinite shear stiffness and without rotary inertia it is an Euler-Bernoulli beam, otherwise a Timoshenko beam.
    Stiffnesses and mass must be positive, rotary inertias must not be negative.
    """

    axial: float  # E A, N
    bending_y: float  # E I about the local y axis, N m^2
    bending_z: float  # E I about the local z axis, N m^2
    torsion: float  # G J, N m^2
    mass: float  # rho A, kg/m
    shear_y: float = math.inf  # kappa G A for deflection along y, N
    shear_z: float = math.inf  # kappa G A for deflection along z, N
    rotary_y: float = 0.0  # rho I about y, kg m
    rotary_z: float = 0.0  # rho I about z, kg m
    polar: float = 0.0  # rho (I_y + I_z), kg m: the inertia of torsion

    def __post_init__(self) -> None:
        for name in ("axial", "bending_y", "bending_z", "torsion", "mass", "shear_y", "shear_z"):
            if not getattr(self, name) > 0:
                raise InputError(f"section: {name} = {getattr(self, name)!r} must be positive")
        for name in ("rotary_y", "rotary_z", "polar"):
            if not getattr(self, name) >= 0:
                raise InputError(f"section: {name} = {getattr(self, name)!r} must be zero or more")


@dataclass(frozen=True)
class Material:
    """Isotropic elastic material: Young's and shear modulus in Pa, density in kg/m^3."""

    young: float
    shear: float
    density: float


def hollow_circle(outer: float, inner: float, material: Material, *, timoshenko: bool = True) -> Section:
    """Compute the section of a round tube with diameters ``outer`` and ``inner``, m.

    The shear factor is that of :func:`modal_fit.shear_factor`.
    """
    if not 0 <= inner < outer:
        raise InputError(f"tube with outer diameter {outer!r} m and inner {inner!r} m: give 0 <= inner < outer")
    area = math.pi / 4 * (outer**2 - inner**2)
    second_moment = math.pi / 64 * (outer**4 - inner**4)
    poisson = material.young / (2 * material.shear) - 1
    shear = shear_factor(poisson, inner / outer) * material.shear * area if timoshenko else math.inf
    rotary = material.density * second_moment if timoshenko else 0.0
    bending = material.young * second_moment
    return Section(
        axial=material.young * area,
        bending_y=bending,
        bending_z=bending,
        torsion=2 * material.shear * second_moment,
        mass=material.density * area,
        shear_y=shear,
        shear_z=shear,
        rotary_y=rotary,
        rotary_z=rotary,
        polar=2 * material.density * second_moment,
    )


def tube_diameters(area: float, second_moment: float) -> tuple[float, float]:
    """Compute outer and inner diameter, m, of the round tube with an area (m^2) and a second moment of area (m^4).

    ``D^2 = 8 I / A + 2 A / pi``, ``d^2 = 8 I / A - 2 A / pi``.

    Raises
    ------
    InputError
        No tube has them, because the second moment is less than that of a solid bar: ``I < A^2 / (4 pi)``.

    Examples
    --------
    >>> outer, inner = 0.16, 0.13
    >>> area, moment = math.pi / 4 * (outer**2 - inner**2), math.pi / 64 * (outer**4 - inner**4)
    >>> [round(diameter, 9) for diameter in tube_diameters(area, moment)]
    [0.16, 0.13]
    """
    if not (area > 0 and second_moment >= area**2 / (4 * math.pi) * (1 - 1e-12)):
        raise InputError(
            f"no round tube has {area:g} m^2 with {second_moment:g} m^4; the least is {area**2 / (4 * math.pi):g} m^4"
        )
    mean, half = 8 * second_moment / area, 2 * area / math.pi
    return math.sqrt(mean + half), math.sqrt(max(mean - half, 0.0))


# places of (u, v, w, theta_x, theta_y, theta_z) of both nodes; in the x-z plane dw/dx = -theta_y turns signs over
_ROD, _TORSION, _XY, _XZ = [0, 6], [3, 9], [1, 5, 7, 11], [2, 4, 8, 10]
_SIGNS = np.outer([1.0, -1.0, 1.0, -1.0], [1.0, -1.0, 1.0, -1.0])


# the matrices of a beam are the same in every posture
@lru_cache(maxsize=256)
def beam_stiffness(section: Section, length: float) -> Real:
    """Compute the stiffness over ``(u, v, w, theta_x, theta_y, theta_z)`` of both nodes in local axes, (12, 12).

    Exact for loads at the nodes (Przemieniecki, Theory of Matrix Structural Analysis, section 5.6); with shear the
    bending terms are divided by ``1 + Phi``, ``Phi = 12 E I / (kappa G A L^2)``.
    """
    stiffness = np.zeros((12, 12))
    rod = np.array([[1.0, -1.0], [-1.0, 1.0]])
    stiffness[np.ix_(_ROD, _ROD)] = section.axial / length * rod
    stiffness[np.ix_(_TORSION, _TORSION)] = section.torsion / length * rod
    stiffness[np.ix_(_XY, _XY)] = _bending_stiffness(section.bending_z, section.shear_y, length)
    stiffness[np.ix_(_XZ, _XZ)] = _SIGNS * _bending_stiffness(section.bending_y, section.shear_z, length)
    return stiffness


@lru_cache(maxsize=256)
def beam_mass(section: Section, length: float) -> Real:
    """Compute the consistent mass matrix over the degrees of freedom of :func:`beam_stiffness`, kg, kg m and kg m^2.

    With rotary inertia (Przemieniecki, section 11.6; with shear: Friedman & Kosmatka 1993).
    """
    mass = np.zeros((12, 12))
    rod = np.array([[2.0, 1.0], [1.0, 2.0]]) * length / 6
    mass[np.ix_(_ROD, _ROD)] = section.mass * rod
    mass[np.ix_(_TORSION, _TORSION)] = section.polar * rod
    mass[np.ix_(_XY, _XY)] = _bending_mass(section.bending_z, section.shear_y, section.mass, section.rotary_z, length)
    in_xz = _bending_mass(section.bending_y, section.shear_z, section.mass, section.rotary_y, length)
    mass[np.ix_(_XZ, _XZ)] = _SIGNS * in_xz
    return mass


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
    """Integrate ``rho A N^T N + rho I P^T P`` over the beam, with the static shapes of deflection N and rotation P."""
    phi = 12 * bending / (shear * length**2)
    points, weights = np.polynomial.legendre.leggauss(4)  # exact to degree 7; N^T N has degree 6
    x, weights = (points + 1) / 2, weights / 2
    scale = 1 + phi
    deflection = np.array(
        [
            (1 - 3 * x**2 + 2 * x**3 + phi * (1 - x)) / scale,
            length * (x - 2 * x**2 + x**3 + phi * (x - x**2) / 2) / scale,
            (3 * x**2 - 2 * x**3 + phi * x) / scale,
            length * (-(x**2) + x**3 - phi * (x - x**2) / 2) / scale,
        ]
    )
    rotation = np.array(
        [
            6 * (x**2 - x) / (length * scale),
            (1 - 4 * x + 3 * x**2 + phi * (1 - x)) / scale,
            6 * (x - x**2) / (length * scale),
            (-2 * x + 3 * x**2 + phi * x) / scale,
        ]
    )
    return np.asarray(
        length * ((deflection * weights * mass) @ deflection.T + (rotation * weights * rotary) @ rotation.T)
    )
