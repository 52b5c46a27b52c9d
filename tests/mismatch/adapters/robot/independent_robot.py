"""A six-axis robot of its own, sharing no code with the package: rigid bodies on joint springs, a tool on a spring."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

FRAMES = (
    (0.0, 0.0, 0.0, 0.675),
    (-np.pi / 2, 0.35, -np.pi / 2, 0.0),
    (0.0, 1.35, np.pi / 2, 0.0),
    (np.pi / 2, -0.041, 0.0, 1.40),
    (-np.pi / 2, 0.0, 0.0, 0.0),
    (np.pi / 2, 0.0, 0.0, 0.0),
)
"""Modified Denavit-Hartenberg rows of the axes: alpha (rad), d (m), theta (rad), r (m)."""

TIP = 0.565
"""Tool tip on the last axis, m from its frame."""


@dataclass(frozen=True)
class Lump:
    """A rigid body on an axis (0 to 5): mass, kg; centre in its frame, m; inertia about the centre, kg m^2."""

    axis: int
    mass: float
    centre: tuple[float, float, float]
    inertia: tuple[float, float, float]


LUMPS = (
    Lump(0, 400.0, (0.1, 0.0, -0.15), (20.0, 20.0, 20.0)),
    Lump(1, 200.0, (0.7, 0.0, 0.0), (5.0, 40.0, 40.0)),
    Lump(2, 160.0, (0.05, 0.0, 0.0), (6.0, 6.0, 6.0)),
    Lump(3, 90.0, (0.0, 0.0, -0.65), (12.0, 12.0, 1.5)),
    Lump(4, 15.0, (0.0, 0.0, 0.0), (0.2, 0.2, 0.2)),
    Lump(5, 60.0, (0.0, 0.0, 0.3), (1.2, 1.2, 0.5)),
)

SPRINGS = (8.0e6, 9.0e6, 7.0e6, 9.0e5, 8.0e5, 4.0e5)


@dataclass(frozen=True)
class OtherRobot:
    """Bodies on axes with springs.

    Parameters
    ----------
    lumps
        Bodies.
    springs : (6,), N m/rad
        About the axes.
    tool : (3,), m/N
        Compliance between spindle and tool tip along x, y and z of the last frame; zero: rigid.
    tool_mass
        kg, on that spring.
    ratio
        Damping ratio of every mode.
    """

    lumps: tuple[Lump, ...] = LUMPS
    springs: tuple[float, ...] = SPRINGS
    tool: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tool_mass: float = 0.3
    ratio: float = 0.04

    def softer(self, axis: int, factor: float) -> "OtherRobot":
        """One spring times a factor; axes count from 1."""
        return replace(self, springs=tuple(k * factor if i == axis - 1 else k for i, k in enumerate(self.springs)))

    def loaded(self, mass: float, place: tuple[float, float, float]) -> "OtherRobot":
        """A further point mass on the last axis, m from the tip; a negative one takes mass away."""
        centre = (place[0], place[1], place[2] + TIP)
        return replace(self, lumps=(*self.lumps, Lump(5, mass, centre, (0.0, 0.0, 0.0))))


def receptance(robot: OtherRobot, q: Real, frequencies: Real) -> Complex:
    """Motion of the tool tip over force there in the base frame, m/N, (n, 3, 3)."""
    return of_modes(*modes(robot, q), robot.ratio, frequencies)


def of_modes(natural: Real, shapes: Real, ratio: Real | float, frequencies: Real) -> Complex:
    """Receptance of modes with natural angular frequencies (rad/s) and mass-normalised shapes, m/N, (n, 3, 3)."""
    omega = 2 * np.pi * np.asarray(frequencies)[:, None]
    gain = 1 / (natural**2 - omega**2 + 2j * ratio * natural * omega)
    return np.asarray(np.einsum("kr,pr,qr->kpq", gain, shapes, shapes))


def modes(robot: OtherRobot, q: Real) -> tuple[Real, Real]:
    """Natural angular frequencies (n,), rad/s, and mass-normalised shapes of the tool tip (3, n)."""
    mass, tip = mass_and_tip(robot.lumps, q)
    free = np.concatenate([np.ones(6, dtype=bool), np.array(robot.tool) > 0])
    mass += robot.tool_mass * tip.T @ tip if free[6:].any() else 0.0
    springs = np.concatenate([robot.springs, 1 / np.maximum(robot.tool, 1e-300)])
    mass, springs, tip = mass[np.ix_(free, free)], springs[free], tip[:, free]
    root = np.linalg.inv(np.linalg.cholesky(mass))
    squares, vectors = np.linalg.eigh(root @ np.diag(springs) @ root.T)
    shapes = tip @ root.T @ vectors
    return np.sqrt(squares), shapes


def mass_and_tip(lumps: tuple[Lump, ...], q: Real, tool: float = 0.0) -> tuple[Real, Real]:
    """Mass matrix (9, 9) of six axes and a tool of a mass (kg) on a spring, and the tip's motion over them (3, 9)."""
    placed = _placed(q)
    mass = np.zeros((9, 9))
    for lump in lumps:
        turn, origin = placed[lump.axis][:3, :3], placed[lump.axis][:3, 3]
        moved, turned = _motion(placed, lump.axis, turn @ np.array(lump.centre) + origin)
        inertia = turn @ np.diag(lump.inertia) @ turn.T
        mass[:6, :6] += lump.mass * moved.T @ moved + turned.T @ inertia @ turned
    turn = placed[5][:3, :3]
    rigid, _ = _motion(placed, 5, turn @ np.array([0.0, 0.0, TIP]) + placed[5][:3, 3])
    tip = np.hstack([rigid, turn])
    return mass + tool * tip.T @ tip, tip


def weight_torques(lumps: tuple[Lump, ...], q: Real) -> Real:
    """How the weight of the bodies turns each axis, N m, (6,)."""
    placed = _placed(q)
    places = [(each, placed[each.axis][:3, :3] @ np.array(each.centre) + placed[each.axis][:3, 3]) for each in lumps]
    return -9.80665 * np.sum([each.mass * _motion(placed, each.axis, at)[0][2] for each, at in places], axis=0)


def _placed(q: Real) -> list[Real]:
    whole, result = np.eye(4), []
    for (alpha, d, theta, r), angle in zip(FRAMES, q, strict=True):
        ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(theta + angle), np.sin(theta + angle)
        along = np.array([[1, 0, 0, d], [0, ca, -sa, 0], [0, sa, ca, 0], [0, 0, 0, 1]])
        about = np.array([[ct, -st, 0, 0], [st, ct, 0, 0], [0, 0, 1, r], [0, 0, 0, 1]])
        whole = whole @ along @ about
        result.append(whole)
    return result


def _motion(placed: list[Real], axis: int, point: Real) -> tuple[Real, Real]:
    """Translation of a point and rotation of its body over small rotations of the axes, (3, 6) each."""
    moved, turned = np.zeros((3, 6)), np.zeros((3, 6))
    for i in range(axis + 1):
        along, origin = placed[i][:3, 2], placed[i][:3, 3]
        moved[:, i], turned[:, i] = np.cross(along, point - origin), along
    return moved, turned
