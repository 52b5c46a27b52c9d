"""Thrust and torque of a twist drill, integrated along its edges, tool entry included."""

from dataclasses import dataclass
from math import pi, radians

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

Real = NDArray[np.float64]

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(32)


@dataclass(frozen=True)
class Drill:
    """Geometry of a drill with straight edges.

    Parameters
    ----------
    diameter : m
        Diameter of the drill.
    edge_angle : rad
        Angle chi_r between edge and axis: half the point angle.
    rake : rad
        Normal rake gamma_n0 at the periphery.
    inclination : rad
        Inclination lambda_s0 of the edge at the periphery.
    edges
        Number of cutting edges.

    Raises
    ------
    InputError
        Diameter or edges not positive, or an edge angle outside 0 to 90 degrees.
    """

    diameter: float
    edge_angle: float = radians(70.0)
    rake: float = radians(30.0)
    inclination: float = radians(-5.0)
    edges: int = 2

    def __post_init__(self) -> None:
        if not (self.diameter > 0 and self.edges >= 1 and 0 < self.edge_angle <= pi / 2):
            raise InputError(
                f"drill: diameter {self.diameter!r} m, {self.edges!r} edges, edge angle {self.edge_angle!r} rad; "
                "give a positive diameter, 1 edge or more, 0 < edge angle <= pi / 2"
            )


@dataclass(frozen=True)
class SpecificForce:
    """Specific pressure ``k0 (a + b gamma_n + c lambda_s) h^-m`` in Pa, with h in mm as in the makers' tables.

    ``a + b gamma_n + c lambda_s`` (angles in rad) has no unit (Ferreras-Higuero et al., Eqs. 17-19).
    """

    k0: float
    m: float
    a: float = 1.0
    b: float = -0.86
    c: float = 0.0


@dataclass(frozen=True)
class DrillingLoad:
    """Thrust along the tool, N, and torque about it, N m."""

    thrust: float
    torque: float


def drilling_load(
    drill: Drill, feed: float, tangential: SpecificForce, axial: SpecificForce, depth: float = np.inf
) -> DrillingLoad:
    """Give the load on a drill whose point is ``depth`` (m) below the surface; at infinite depth the whole edge cuts.

    ``F_a = N int k_a h^(1-m) dr / sin chi``, ``M = N int k_t h^(1-m) r dr / sin chi`` with ``h = f / N sin chi`` and
    ``tan gamma_n = r / (D / 2) tan gamma_n0`` (Ferreras-Higuero et al., Eqs. 16-19). The edge is in the work as far
    as ``r = depth tan chi``. An edge that is straight and beside the axis has constant ``r sin lambda``; inside the
    chisel, where that has no solution, lambda is held at +-90 degrees.

    Parameters
    ----------
    drill
        Geometry of the drill.
    feed : m
        Feed per revolution.
    tangential, axial
        Specific pressures of the cutting force and of the thrust.
    depth : m
        Depth of the drill's point below the surface, 0 or more.

    Raises
    ------
    InputError
        A feed that is not positive, or a negative depth.
    """
    if not feed > 0 or not depth >= 0:
        raise InputError(f"drilling: feed {feed!r} m/rev must be positive and depth {depth!r} m zero or more")
    thickness = feed / drill.edges * np.sin(drill.edge_angle)
    r, cut, thrust = _along_edge(drill, thickness, tangential, axial, depth)
    return DrillingLoad(drill.edges * float(thrust.sum()), drill.edges * float(r @ cut))


def edge_forces(
    drill: Drill, thickness: float, tangential: SpecificForce, axial: SpecificForce, depth: float = np.inf
) -> tuple[float, float]:
    """Cutting force and thrust of one edge that cuts chips of ``thickness`` (m, normal to the edge), N."""
    _, cut, thrust = _along_edge(drill, thickness, tangential, axial, depth)
    return float(cut.sum()), float(thrust.sum())


def _along_edge(
    drill: Drill, thickness: float, tangential: SpecificForce, axial: SpecificForce, depth: float
) -> tuple[Real, Real, Real]:
    """Radius, m, and cutting force and thrust, N, of the pieces of one edge that is in the work."""
    radius = drill.diameter / 2
    outer = min(radius, depth * np.tan(drill.edge_angle)) if np.isfinite(depth) else radius
    r = outer * (_POINTS + 1) / 2
    weight = outer * _WEIGHTS / 2 / np.sin(drill.edge_angle)
    rake = np.arctan(r / radius * np.tan(drill.rake))
    sine = radius / np.maximum(r, 1e-12) * np.sin(drill.inclination)
    inclination = np.arcsin(np.clip(sine, -1, 1))

    def per_length(force: SpecificForce) -> Real:
        shape = force.a + force.b * rake + force.c * inclination
        return np.asarray(force.k0 * shape * 1e-3 * (1e3 * thickness) ** (1 - force.m))

    return r, weight * per_length(tangential), weight * per_length(axial)


def catalogue_load(diameter: float, feed: float, material: float = 1.01) -> DrillingLoad:
    """Give a maker's load for twist drills: ``570 K D f^0.85`` N and ``K D^2 (0.630 + 16.84 f) / 100`` N m.

    D in mm, f in mm per revolution; K = 1.01: aluminium. Arguments here in m.

    Examples
    --------
    >>> load = catalogue_load(8e-3, 0.2e-3)
    >>> round(load.thrust), round(load.torque, 2)
    (1173, 2.58)
    """
    d, f = 1e3 * diameter, 1e3 * feed
    return DrillingLoad(570 * material * d * f**0.85, material * d**2 * (0.630 + 16.84 * f) / 100)


def fitted_to_catalogue(
    drill: Drill, feeds: tuple[float, float] = (0.1e-3, 0.3e-3)
) -> tuple[SpecificForce, SpecificForce]:
    """Tangential and axial pressure that give the catalogue's torque and thrust for aluminium over a range of feeds.

    ``m`` from the catalogue's slope between the two feeds (m per revolution), ``k0`` from the value between them. The
    influence of the rake, 1.5 % a degree, is the usual one for Kienzle's formula (assumed: the paper prints none).
    """
    low, high = feeds
    middle = float(np.sqrt(low * high))
    unit = SpecificForce(1.0, 0.0)
    pressures = []
    for name in ("torque", "thrust"):
        values = [getattr(catalogue_load(drill.diameter, feed), name) for feed in (low, high, middle)]
        m = 1 - float(np.log(values[1] / values[0]) / np.log(high / low))
        trial = SpecificForce(1.0, m, unit.a, unit.b, unit.c)
        scale = values[2] / getattr(drilling_load(drill, middle, trial, trial), name)
        pressures.append(SpecificForce(scale, m, unit.a, unit.b, unit.c))
    return pressures[0], pressures[1]
