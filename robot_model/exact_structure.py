"""Receptance of a robot in space with exact beams: no element error at any frequency, the reference for elements."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimation import Frf

from .exact_beam import spatial_dynamic_stiffness
from .generalised_coordinates import coordinate_basis
from .spatial_modes import TIP
from .spatial_robot import SpatialRobot, structure_at
from .structure import mass_matrix, stiffness_matrix

Real = NDArray[np.float64]


def exact_frf_at(robot: SpatialRobot, q: Real, frequencies: Real, loss_factor: float = 0.0) -> Frf:
    """Receptance at the tool, links by their exact dynamic stiffness, joints and bodies lumped.

    ``H = S (T^T (K_joints - omega^2 M_bodies + sum B D(omega) B^T) T)^-1 S^T`` with T from :func:`coordinate_basis`:
    the planar coupling of Chen et al. 2026, Eqs. 10-17, in three dimensions.

    Parameters
    ----------
    robot, q : (n_moving,)
    frequencies : (n_frequencies,), Hz
    loss_factor
        Of links and joints alike: ``K (1 + i loss_factor)``; a robot's Rayleigh damping has no place here.
    """
    structure = structure_at(robot, q)
    omega = 2 * np.pi * np.asarray(frequencies, dtype=float)
    lumped = replace(structure, beams=())
    static = stiffness_matrix(lumped) * (1 + 1j * loss_factor)
    whole = static - omega[:, None, None] ** 2 * mass_matrix(lumped)
    for beam in structure.beams:
        arm = structure.positions[beam.nodes[1]] - structure.positions[beam.nodes[0]]
        local = spatial_dynamic_stiffness(beam.section, float(np.linalg.norm(arm)), omega, loss_factor)
        turn = np.kron(np.eye(4), beam.axes)
        dofs = np.concatenate([np.arange(6 * node, 6 * node + 6) for node in beam.nodes])
        whole[:, dofs[:, None], dofs] += turn @ local @ turn.T
    basis = coordinate_basis(structure)
    tip = basis[6 * structure.tip : 6 * structure.tip + 3]
    loads = np.broadcast_to(tip.T.astype(complex), (len(omega), *tip.T.shape))
    values = np.asarray(tip @ np.linalg.solve(basis.T @ whole @ basis, loads), dtype=complex)
    valid = np.ones(len(omega), dtype=bool)
    return Frf(omega / (2 * np.pi), values, TIP, TIP, "receptance", "m/N", valid)
