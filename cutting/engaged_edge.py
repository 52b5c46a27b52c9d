"""Directional matrices of each tooth along its engaged edge: helix and unequal pitch in closed form."""

import numpy as np
from numpy.typing import NDArray

from .milling_process import MillingProcess

Real = NDArray[np.float64]


def edge_matrices(process: MillingProcess, angles: Real, depth: float) -> Real:
    """Matrix alpha of each tooth, averaged over the depth of a helical edge.

    ``alpha_j = (1 / a) int_0^a alpha(phi_j - 2 z tan(beta) / D) dz`` over the part of the edge that is in the cut
    (Altintas, Manufacturing Automation, 2nd ed., section 2.8.1); the force is ``a K_tc sum_j alpha_j (X - X_j)`` with
    X_j the tool's place when the tooth before stood at the same angle.

    Parameters
    ----------
    process
        Cutter and engagement.
    angles : (n,), rad
        Spindle angles: the immersion of tooth 0 at its tip.
    depth : m
        Axial depth of cut a; it has no effect with straight edges.

    Returns
    -------
    (teeth, n, 3, 3), dimensionless
    """
    moments = _edge_moments(process, angles, depth)
    force, chip = _force_rows(process), _chip_rows(process)
    return np.asarray(np.einsum("ip,tnpq,jq->tnij", force, moments, chip))


def damping_matrices(process: MillingProcess, angles: Real, depth: float) -> Real:
    """Sum over teeth of ``n n^T`` along the engaged edges, n the normal of the surface, shape (n, 3, 3).

    The force of process damping is ``-a (C / V) P X'`` with V the cutting speed (Tyler & Schmitz 2013, Eq. 1, for an
    edge whose normal turns with it).
    """
    chip = _chip_rows(process)
    return np.asarray(np.einsum("ip,tnpq,jq->nij", chip, _edge_moments(process, angles, depth), chip))


def _force_rows(process: MillingProcess) -> Real:
    """Rows M with force direction ``M (sin phi, cos phi, 1)``."""
    gamma = process.edge_angle
    inward = process.krc * np.sin(gamma) + process.kac * np.cos(gamma)
    along = process.krc * np.cos(gamma) - process.kac * np.sin(gamma)
    return np.array([[-inward, -1.0, 0.0], [1.0, -inward, 0.0], [0.0, 0.0, along]])


def _chip_rows(process: MillingProcess) -> Real:
    sine, cosine = np.sin(process.edge_angle), np.cos(process.edge_angle)
    return np.array([[sine, 0.0, 0.0], [0.0, sine, 0.0], [0.0, 0.0, -cosine]])


def _edge_moments(process: MillingProcess, angles: Real, depth: float) -> Real:
    """Mean over the edge of ``b b^T`` with ``b = (sin phi, cos phi, 1)`` where it cuts, (teeth, n, 3, 3)."""
    tips = np.asarray(angles)[None, :] + np.array(process.tooth_angles)[:, None]
    lag = process.lag(depth)
    if lag < 1e-9:
        phi = np.mod(tips, 2 * np.pi)
        cutting = (phi >= process.start_angle) & (phi < process.exit_angle)
        b = np.stack([np.sin(phi), np.cos(phi), np.ones_like(phi)], axis=-1)
        return np.asarray(cutting[..., None, None] * b[..., :, None] * b[..., None, :])
    tips = np.mod(tips, 2 * np.pi)
    total = np.zeros((*tips.shape, 3, 3))
    for turn in range(int(np.floor(lag / (2 * np.pi))) + 2):
        high = np.clip(tips + 2 * np.pi * turn, process.start_angle, process.exit_angle)
        low = np.clip(tips + 2 * np.pi * turn - lag, process.start_angle, process.exit_angle)
        total += _moment_integral(high) - _moment_integral(low)
    return np.asarray(total / lag)


def _moment_integral(phi: Real) -> Real:
    """Antiderivative of ``b b^T``, (..., 3, 3)."""
    sine, cosine = np.sin(phi), np.cos(phi)
    ss, cc, sc = phi / 2 - sine * cosine / 2, phi / 2 + sine * cosine / 2, sine**2 / 2
    rows = [[ss, sc, -cosine], [sc, cc, sine], [-cosine, sine, phi]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
