"""Stability of turning: a loop with constant coefficients and one delay, counted by the argument of its determinant."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, Real
from millfrf.cutting import EarlierMotions, EdgeForces, MillingProcess, PieceNodes, add_edge_forces, edge_slices

from ..milling_loop import DelaySystem

LARGEST_STEP = 1.0  # rad; of the determinant's argument between two frequencies, so that no turn is missed
MOST_REFINEMENTS = 40  # halvings of an interval; a zero within 1e-12 of it lies on the imaginary axis


def unstable_turning(system: DelaySystem, speed: float, depths: Real) -> NDArray[np.bool_]:
    """Check at each depth (n,), m, and a spindle speed (rad/s) whether a turning cut is unstable.

    ``det[I - ((1 - exp(-s T)) D(a) - s (C / V) P(a)) H(s)]`` with the revolution T, the force D per motion and the
    integral P of ``n n^T`` over the edge turns by -2 pi along the positive imaginary axis for each pair of unstable
    roots, as the structure alone is stable (Nyquist 1932). A residual flexibility U acts at once: no motion is bounded
    if ``(I - D U)^-1 D U`` has an eigenvalue of modulus 1 or more. A root on the axis counts as unstable.
    """
    if not len(depths):
        return np.zeros(0, dtype=bool)
    edges = [_edge(system, speed, float(depth)) for depth in depths]
    omega = _frequencies(system, speed, edges[int(np.argmax(depths))])
    receptance = system.receptance(omega)
    return np.array([_is_unstable(system, edge, omega, receptance) for edge in edges])


@dataclass(frozen=True)
class _Edge:
    """Force of an edge at one depth and speed."""

    turn: float  # s, duration of a revolution
    cutting: Real  # (3, 3), N/m, force per motion
    flank: Real  # (3, 3), N s/m, force per velocity, against it

    def determinant(self, omega: Real, receptance: Complex) -> Complex:
        """Compute the determinant of the loop at frequencies (n,), rad/s."""
        regenerated = (1 - np.exp(-1j * omega * self.turn))[:, None, None]
        force = regenerated * self.cutting
        if self.flank.any():
            force = force - 1j * omega[:, None, None] * self.flank
        return np.asarray(np.linalg.det(np.eye(3) - force @ receptance))


def _edge(system: DelaySystem, speed: float, depth: float) -> _Edge:
    cutting, normals = turning_matrices(system.process, depth)
    flank = system.process.process_damping / (speed * system.process.diameter / 2)
    return _Edge(2 * math.pi / speed, cutting, flank * normals)


def _is_unstable(system: DelaySystem, edge: _Edge, omega: Real, receptance: Complex) -> bool:
    at_once = edge.cutting @ system.upper
    if at_once.any():
        fastest = np.linalg.eigvals(np.linalg.solve(np.eye(3) - at_once, at_once))
        if np.abs(fastest).max() >= 1:
            return True
    values = edge.determinant(omega, receptance)
    return _roots(lambda more: edge.determinant(more, system.receptance(more)), omega, values) != 0


def turning_matrices(process: MillingProcess, depth: float) -> tuple[Real, Real]:
    """Return the force per motion D, N/m, and the integral P of ``n n^T`` over the edge's width, m, (3, 3) each."""
    cutting, normals, none = np.zeros((1, 3, 3)), np.zeros((1, 3, 3)), np.zeros(0)
    pieces = PieceNodes(none, none, 2 * np.pi, none, none)
    earlier = EarlierMotions.empty(1, 0, 0, np.arange(3), np.arange(3))
    add_edge_forces(np.zeros(1), edge_slices(process, depth), EdgeForces.of(process), pieces, cutting, normals, earlier)
    return cutting[0], normals[0]


def _frequencies(system: DelaySystem, speed: float, edge: _Edge) -> Real:
    """Return frequencies (rad/s) from 0 that resolve resonances and delay, up to where the modes no longer matter.

    Far above the modes ``H - U = A / (i w) - B / w^2`` with the sum A of the residues and B that of residue times pole.
    Above the highest frequency the loop through it stays below a half, below a twentieth beside a flexibility U.
    """
    poles, share = system.poles, 0.05 if system.upper.any() else 0.5
    size = np.linalg.norm(system.right, axis=1) * np.linalg.norm(system.left, axis=1)
    second = 2 * float(size @ np.abs(poles))
    first = float(np.linalg.norm(2 * np.real(system.right.T @ system.left), 2))
    force, flank = 2 * float(np.linalg.norm(edge.cutting, 2)), float(np.linalg.norm(edge.flank, 2))
    reach = max(2 * np.abs(poles).max(), math.sqrt(force * second / share), (force * first + flank * second) / share)
    top = speed * math.ceil(reach / speed)  # whole turns, where the delay closes the loop
    near = poles.imag[:, None] - poles.real[:, None] * np.sinh(np.linspace(-5, 5, 41))
    waves, spread = np.arange(0.0, top, speed / 12), np.linspace(0.0, top, 200)
    joined = np.concatenate([np.abs(near.ravel()), waves, spread])
    return np.unique(joined[joined <= top])


def _roots(value: Callable[[Real], Complex], omega: Real, values: Complex) -> int:
    """Return the number of pairs of roots in the right half plane; at least 1 for a root on the imaginary axis.

    Frequencies are added where the argument of ``values`` changes fast.
    """
    for _ in range(MOST_REFINEMENTS):
        turned = np.angle(values[1:] / values[:-1])
        wide = np.flatnonzero(np.abs(turned) > LARGEST_STEP)
        if not len(wide):
            ends = float(np.angle(values[-1]) - np.angle(values[0]))
            return round((ends - float(turned.sum())) / (2 * math.pi))
        middles = (omega[wide] + omega[wide + 1]) / 2
        omega, values = np.insert(omega, wide + 1, middles), np.insert(values, wide + 1, value(middles))
    return 1


def turning_frequency(system: DelaySystem, speed: float, depth: float) -> float:
    """Return the chatter frequency (Hz) at a limit: where the determinant is smallest."""
    edge = _edge(system, speed, depth)
    omega = _frequencies(system, speed, edge)[1:]
    for _ in range(6):
        least = int(np.argmin(np.abs(edge.determinant(omega, system.receptance(omega)))))
        omega = np.linspace(omega[max(least - 1, 0)], omega[min(least + 1, len(omega) - 1)], 41)
    return float(omega[20] / (2 * math.pi))
