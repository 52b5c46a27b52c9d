"""Floquet multipliers of a milling cut, written from the force equations alone: no code of `stability` or `cutting`.

A tooth at the immersion phi (from +Y, clockwise) cuts a chip of the thickness
``h = (dx sin phi + dy cos phi) sin gamma - dz cos gamma``, d the tool's motion less that of a tooth period ago. On the
tool act ``F_t = K a h`` against its way (cos phi, -sin phi, 0), ``F_r = k_r F_t`` along the inward normal of the edge
and ``F_a = k_a F_t`` along the edge's own axis. The structure is ``q_r' = p_r q_r + left_r . F``, ``d = 2 Re sum q_r
right_r``. Steps of Gauss's implicit Runge-Kutta rule with six stages (order 12) fill each stretch between the entry and
exit of a tooth. The same steps are made in every period, so the motions that are needed from the last one are those at
its stages, and nothing is interpolated.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

STAGES = 6


@dataclass(frozen=True)
class Mill:
    """A cutter in its cut: angles in rad, ``pressure`` K in Pa, ``radial`` and ``axial`` as shares of it."""

    teeth: int
    edge_angle: float
    pressure: float
    radial: float
    axial: float
    entry: float
    leave: float


def _gauss(stages: int) -> tuple[Real, Real, Real]:
    """Nodes in (0, 1), weights and matrix of Gauss's rule."""
    points, doubled = np.polynomial.legendre.leggauss(stages)
    nodes, weights = (points + 1) / 2, doubled / 2
    powers = np.arange(stages)
    at_nodes = nodes[:, None] ** powers
    integrals = nodes[:, None] ** (powers + 1) / (powers + 1)
    return nodes, weights, integrals @ np.linalg.inv(at_nodes)


def _chip_and_force(mill: Mill, phi: Real) -> tuple[Real, Real]:
    """Chip thickness per motion and force per chip area of one tooth, each (n, 3)."""
    first, sine, cosine = np.ones_like(phi), np.sin(mill.edge_angle), np.cos(mill.edge_angle)
    outward = np.column_stack([np.sin(phi), np.cos(phi), 0 * phi])
    way = np.column_stack([np.cos(phi), -np.sin(phi), 0 * phi])
    up = np.column_stack([0 * phi, 0 * phi, first])
    normal = sine * outward - cosine * up  # out of the chip's face
    binormal = cosine * outward + sine * up  # along the edge
    force = -way - mill.radial * normal - mill.axial * binormal
    return normal, mill.pressure * force


def _stretches(mill: Mill) -> list[tuple[float, float, list[float]]]:
    """Begin, end (rad of spindle turn from an entry) and immersions at the begin, for each set of teeth in the cut."""
    pitch = 2 * np.pi / mill.teeth
    marks = sorted({0.0, pitch, (mill.leave - mill.entry) % pitch})
    marks = [mark for k, mark in enumerate(marks) if k == 0 or mark - marks[k - 1] > 1e-12]
    result = []
    for begin, end in pairwise(marks):
        inside = [mill.entry + begin + j * pitch for j in range(mill.teeth)]
        result.append((begin, end, [phi for phi in inside if phi + (end - begin) / 2 < mill.leave]))
    return result


def spectral_radius(
    poles: Complex, right: Complex, left: Complex, mill: Mill, speed: float, depth: float, *, turn: float = 1.5
) -> float:
    """Largest modulus of the multipliers over a tooth period at ``speed`` (rad/s) and ``depth`` (m).

    Parameters
    ----------
    poles : (n,), rad/s
    right, left : (n, 3)
    turn
        Largest angle of the fastest mode in a step, rad.
    """
    nodes, weights, matrix = _gauss(STAGES)
    n = len(poles)
    decay, spin = np.diag(poles.real), np.diag(poles.imag)
    free = np.block([[decay, -spin], [spin, decay]])
    output = 2 * np.hstack([right.real.T, -right.imag.T])
    enter = np.vstack([left.real, left.imag])
    fastest = float(np.abs(poles).max())
    plan = []
    for begin, end, inside in _stretches(mill):
        count = max(1, int(np.ceil(fastest * (end - begin) / speed / turn)), int(np.ceil((end - begin) / 0.5)))
        plan.append((begin, end, inside, count))
    length = 2 * n + sum(count * STAGES * len(inside) for _, _, inside, count in plan)
    state = np.eye(2 * n, length)
    rows, at = [], 2 * n
    for begin, end, inside, count in plan:
        if not inside:
            ring = np.exp(poles * (end - begin) / speed)
            rotation = np.block([[np.diag(ring.real), -np.diag(ring.imag)], [np.diag(ring.imag), np.diag(ring.real)]])
            state = rotation @ state
            continue
        angle = (end - begin) / count
        h = angle / speed
        for k in range(count):
            phi = angle * (k + nodes)
            pairs = [_chip_and_force(mill, start + phi) for start in inside]
            chips = np.stack([chip for chip, _ in pairs], axis=1) @ output  # (stages, teeth, 2 n)
            pushes = depth * np.einsum("ij,stj->sit", enter, np.stack([force for _, force in pairs], axis=1))
            total = free + pushes @ chips
            # stage slopes K: K_i = A_i (x + h sum_j m_ij K_j) - pushes_i (chips of the last period)_i
            big = np.eye(STAGES * 2 * n) - h * np.einsum("iab,ij->iajb", total, matrix).reshape(STAGES * 2 * n, -1)
            drive = (total @ state).reshape(STAGES * 2 * n, length)
            for i in range(STAGES):
                here = slice(at + i * len(inside), at + (i + 1) * len(inside))
                drive[2 * n * i : 2 * n * (i + 1), here] -= pushes[i]
            slopes = np.linalg.solve(big, drive).reshape(STAGES, 2 * n, length)
            stages = state + h * np.einsum("ij,jab->iab", matrix, slopes)
            rows.append((chips @ stages).reshape(-1, length))
            state = state + h * np.einsum("i,iab->ab", weights, slopes)
            at += STAGES * len(inside)
    return float(np.abs(np.linalg.eigvals(np.concatenate([state, *rows]))).max())
