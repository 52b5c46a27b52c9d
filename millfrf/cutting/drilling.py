"""Thrust, torque and transverse force of a twist drill, integrated along its edges."""

from dataclasses import dataclass
from math import pi, radians

import numpy as np
import scipy

from millfrf.core import InputError, Real

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(32)  # Gauss's rule along an edge


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

    ``a + b gamma_n + c lambda_s`` (angles in rad) has no unit (Ferreras-Higuero et al., Eqs. 17-19). The default of b,
    1.5 % per degree of rake, is the usual value for Kienzle's formula (assumed: the paper prints none).
    """

    k0: float
    m: float
    a: float = 1.0
    b: float = -0.86
    c: float = 0.0


@dataclass(frozen=True)
class DrillingLoad:
    """Load on a drill: thrust along its axis, N, and torque about its axis, N m."""

    thrust: float
    torque: float


def drilling_load(
    drill: Drill, feed: float, tangential: SpecificForce, axial: SpecificForce, depth: float = np.inf
) -> DrillingLoad:
    """Return the load on a drill whose point is ``depth`` below the surface; at infinite depth the whole edge cuts.

    The thrust is ``F_a = N int k_a h^(1-m) dr / sin chi`` and the torque ``M = N int k_t h^(1-m) r dr / sin chi``, with
    ``h = f / N sin chi`` and ``tan gamma_n = r / (D / 2) tan gamma_n0`` (Ferreras-Higuero et al., Eqs. 16-19). Edges
    cut from the axis to the radius ``r = depth tan chi``.

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
    """Return cutting force and thrust, N, of one edge that cuts a chip of ``thickness`` (m, normal to the edge)."""
    _, cut, thrust = _along_edge(drill, thickness, tangential, axial, depth)
    return float(cut.sum()), float(thrust.sum())


def _along_edge(
    drill: Drill, thickness: float, tangential: SpecificForce, axial: SpecificForce, depth: float
) -> tuple[Real, Real, Real]:
    """Divide the part of an edge that cuts into pieces; return radius (m), cutting force (N) and thrust (N) of each."""
    radius = drill.diameter / 2
    outer = min(radius, depth * np.tan(drill.edge_angle)) if np.isfinite(depth) else radius
    r = outer * (_POINTS + 1) / 2
    weight = outer * _WEIGHTS / 2 / np.sin(drill.edge_angle)
    rake = np.arctan(r / radius * np.tan(drill.rake))
    # r sin(lambda) is constant along a straight edge; near the axis no lambda satisfies this: it stays at +-90 degrees
    sine = radius / np.maximum(r, 1e-12) * np.sin(drill.inclination)
    inclination = np.arcsin(np.clip(sine, -1, 1))

    def per_length(force: SpecificForce) -> Real:
        shape = force.a + force.b * rake + force.c * inclination
        return np.asarray(force.k0 * shape * 1e-3 * (1e3 * thickness) ** (1 - force.m))

    return r, weight * per_length(tangential), weight * per_length(axial)


def catalogue_load(diameter: float, feed: float) -> DrillingLoad:
    """Return the load of a twist drill in aluminium according to a maker's catalogue.

    The thrust is ``570 K D f^0.85`` N and the torque ``K D^2 (0.630 + 16.84 f) / 100`` N m, with D in mm, f in mm per
    revolution and K = 1.01 for aluminium. The arguments of this function are in m.

    Examples
    --------
    >>> load = catalogue_load(8e-3, 0.2e-3)
    >>> round(load.thrust), round(load.torque, 2)
    (1173, 2.58)
    """
    d, f = 1e3 * diameter, 1e3 * feed
    return DrillingLoad(570 * 1.01 * d * f**0.85, 1.01 * d**2 * (0.630 + 16.84 * f) / 100)


def fitted_to_catalogue(drill: Drill) -> tuple[SpecificForce, SpecificForce]:
    """Return tangential and axial pressures that reproduce the catalogue's torque and thrust for aluminium.

    The exponent ``m`` follows from the slope between feeds of 0.1 and 0.3 mm per revolution, ``k0`` from the load at
    the geometric mean of both feeds.
    """
    low, high = 0.1e-3, 0.3e-3
    middle = float(np.sqrt(low * high))
    pressures = []
    for name in ("torque", "thrust"):
        values = [getattr(catalogue_load(drill.diameter, feed), name) for feed in (low, high, middle)]
        m = 1 - float(np.log(values[1] / values[0]) / np.log(high / low))
        trial = SpecificForce(1.0, m)
        scale = values[2] / getattr(drilling_load(drill, middle, trial, trial), name)
        pressures.append(SpecificForce(scale, m))
    return pressures[0], pressures[1]


@dataclass(frozen=True)
class TransverseForce:
    """Force across a drill, in axes that turn with it: x along the first edge, y in the sense of rotation."""

    force: Real  # (2,), N: sum over the edges; it turns with the spindle, so that its mean over a revolution is 0
    thicknesses: Real  # (edges,), m: chip thickness normal to each edge; equal for a drill without runout

    @property
    def size(self) -> float:
        """Magnitude F_r of the transverse force, N."""
        return float(np.hypot(*self.force))


def edge_thicknesses(drill: Drill, feed: float, runout: float, direction: float = 0.0) -> Real:
    """Return the chip thickness of each edge, m, (edges,), of a drill whose axis is off the axis of rotation.

    Edge i, at the angle ``theta_i = 2 pi i / N``, leaves a cone that the eccentricity e lowers by ``e c_i cot chi``
    with ``c_i = cos(direction - theta_i)``. It cuts down from the lowest cone of all earlier passes; edge i + k passed
    k / N of a revolution earlier: ``h_i = sin chi max(0, min_k (k f / N + e cot chi (c_i - c_(i+k))))``, k = 1 to N
    (as runout in milling: Kline & DeVor 1983). For two edges ``h = (f / 2 +- 2 e cot chi cos(direction)) sin chi``.

    Parameters
    ----------
    feed : m
        Feed per revolution.
    runout : m
        Total indicator reading at the drill's tip, twice its eccentricity.
    direction : rad
        Angle of the eccentricity from the first edge, in the sense of rotation.

    Examples
    --------
    >>> (1e6 * edge_thicknesses(Drill(8e-3, edge_angle=pi / 4), 0.2e-3, 20e-6)).round(2).tolist()
    [84.85, 56.57]
    """
    if not feed > 0 or not 0 <= runout <= drill.diameter / 2:
        raise InputError(
            f"drilling: feed {feed!r} m/rev must be positive, runout {runout!r} m from 0 to half the drill's diameter"
        )
    edges = drill.edges
    lowered = runout / 2 / np.tan(drill.edge_angle) * np.cos(direction - 2 * pi * np.arange(edges) / edges)
    thickness = [k * feed / edges + lowered - np.roll(lowered, -k) for k in range(1, edges + 1)]
    return np.asarray(np.sin(drill.edge_angle) * np.maximum(np.min(thickness, axis=0), 0.0))


def resultant_force(
    drill: Drill,
    feed: float,
    tangential: SpecificForce,
    axial: SpecificForce,
    runout: float,
    *,
    direction: float = 0.0,
    depth: float = np.inf,
) -> TransverseForce:
    """Return the transverse force of a stiff drill with runout: the edges' forces across the drill do not cancel.

    Each edge has the cutting force ``F_t`` against its motion. Chip pressure acts normal to the edge, so that each edge
    also has ``F_a cot chi`` towards the axis in addition to the thrust ``F_a`` (Ferreras-Higuero et al., section 3 and
    Fig. 7a; they print no formula). Edges are taken as radial, with the levers of a drill without runout: the error is
    of the order of runout over diameter. A flexible drill centres itself and has far less force:
    :func:`settled_drill`. Feed (m per revolution), runout (m) and direction (rad) are as for :func:`edge_thicknesses`,
    depth (m) as for :func:`drilling_load`.
    """
    thicknesses = edge_thicknesses(drill, feed, runout, direction)
    force = np.zeros(2)
    for index, thickness in enumerate(thicknesses):
        if thickness > 0:
            cut, thrust = edge_forces(drill, float(thickness), tangential, axial, depth)
            angle = 2 * pi * index / drill.edges
            outwards = np.array([np.cos(angle), np.sin(angle)])
            forwards = np.array([-outwards[1], outwards[0]])
            force += -cut * forwards - thrust / np.tan(drill.edge_angle) * outwards
    return TransverseForce(force, thicknesses)


@dataclass(frozen=True)
class SettledDrill:
    """Equilibrium of a flexible drill under its transverse force, in axes that turn with the drill.

    Parameters
    ----------
    force
        Transverse force in equilibrium.
    eccentricity : (2,), m
        Position of the drill's tip relative to the axis of rotation in equilibrium.
    bending : (2,), m
        Displacement of the tip by bending: its position in equilibrium minus its position at rest.
    """

    force: TransverseForce
    eccentricity: Real
    bending: Real


def settled_drill(
    drill: Drill,
    feed: float,
    tangential: SpecificForce,
    axial: SpecificForce,
    runout: float,
    compliance: float,
    *,
    direction: float = 0.0,
) -> SettledDrill:
    """Find the equilibrium ``e = e_0 + C F(e)`` of a flexible drill with the eccentricity e_0 at rest.

    The force pushes the edge with the thicker chip back towards the axis, so that the point centres itself.

    For two edges and constant pressures ``F = -(K_r, K_t) e_x`` with ``K_r = 2 k_a D cot^2 chi`` and
    ``K_t = 2 k_t D cot chi``: ``e_x = e_0x / (1 + C K_r)``, ``e_y = e_0y - C K_t e_x``. Long drills have C K_r of 3 to
    30, so that their tip moves sideways by at most K_t / K_r times its eccentricity. The walls of the hole, which
    guide the drill after entry, are left out.

    Parameters
    ----------
    drill
        Geometry of the drill.
    feed : m
        Feed per revolution.
    tangential, axial
        Specific pressures of the cutting force and of the thrust.
    runout : m
        Total indicator reading at rest.
    compliance : m/N
        Compliance C of the tip across the drill, the same in all directions.
    direction : rad
        Angle of the eccentricity at rest from the first edge, in the sense of rotation.

    Raises
    ------
    InputError
        A compliance that is negative, or no equilibrium within half the drill's radius.
    """
    if not compliance >= 0:
        raise InputError(f"compliance {compliance!r} m/N of a drill must be zero or more")
    at_rest = runout / 2 * np.array([np.cos(direction), np.sin(direction)])

    def force_at(place: Real) -> TransverseForce:
        size, angle = 2 * float(np.hypot(*place)), float(np.arctan2(place[1], place[0]))
        return resultant_force(drill, feed, tangential, axial, min(size, drill.diameter / 2), direction=angle)

    unit = max(runout, 1e-9)
    solution = scipy.optimize.root(
        lambda x: x - (at_rest + compliance * force_at(unit * x).force) / unit, at_rest / unit, tol=1e-12
    )
    place = unit * np.asarray(solution.x)
    residual = place - at_rest - compliance * force_at(place).force
    if not np.abs(residual).max() <= 1e-6 * unit or np.hypot(*place) > drill.diameter / 4:
        raise InputError(
            f"a drill of {1e3 * drill.diameter:g} mm with a compliance of {compliance:g} m/N has no equilibrium; "
            "make it shorter"
        )
    return SettledDrill(force_at(place), place, place - at_rest)


def bending_stiffness(drill: Drill, overhang: float, *, core: float = 0.7) -> float:
    """Return the stiffness of a clamped drill against a transverse force at its tip, N/m.

    ``3 E I / L^3`` with ``I = pi (core D)^4 / 64`` and E = 600 GPa, Young's modulus of cemented carbide.

    Parameters
    ----------
    drill
        Drill with its diameter D.
    overhang : m
        Length L out of its holder.
    core
        Diameter over D of the round bar that bends as the fluted drill does (assumed: 0.7 is usual).

    Raises
    ------
    InputError
        An overhang that is shorter than half the diameter.
    """
    if not overhang >= drill.diameter / 2:
        raise InputError(f"overhang {overhang!r} m: give the drill's length out of its holder in metres")
    return 3 * 600e9 * pi * (core * drill.diameter) ** 4 / 64 / overhang**3
