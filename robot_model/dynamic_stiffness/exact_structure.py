"""Receptance of a robot in space with exact beams: no element error at any frequency, the reference for elements."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from foundation import TIP, InputError

from ..finite_elements import Structure, coordinate_basis, mass_matrix, rigid_rows, stiffness_matrix
from ..spatial import SpatialRobot, structure_at
from .exact_beam import spatial_dynamic_stiffness
from .receptance_coupling import couple_along

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


def exact_frf_at(robot: SpatialRobot, q: Real, frequencies: Real, loss_factor: float = 0.0) -> Frf:
    """Compute the receptance at the tool, links by their exact dynamic stiffness, joints and bodies lumped.

    ``H = S (T^T (K_joints - omega^2 M_bodies + sum B D(omega) B^T) T)^-1 S^T`` with T from :func:`coordinate_basis`:
    the planar coupling of Chen et al. 2026, Eqs. 10-17, in three dimensions.

    Parameters
    ----------
    robot
        Robot whose structure is computed.
    q : (n_moving,), rad or m
        Joint values of the posture.
    frequencies : (n_frequencies,), Hz
        Frequencies of the lines.
    loss_factor
        Loss factor of links and joints alike: ``K (1 + i loss_factor)``; a robot's Rayleigh damping has no place here.
    """
    structure = structure_at(robot, q)
    omega = 2 * np.pi * np.asarray(frequencies, dtype=float)
    static = stiffness_matrix(replace(structure, beams=())) * (1 + 1j * loss_factor)
    whole = static + _links_and_bodies(structure, omega, loss_factor)
    basis = coordinate_basis(structure)
    tip = basis[6 * structure.tip : 6 * structure.tip + 3]
    loads = np.broadcast_to(tip.T.astype(complex), (len(omega), *tip.T.shape))
    values = np.asarray(tip @ np.linalg.solve(basis.T @ whole @ basis, loads), dtype=complex)
    return _tip_frf(omega, values)


def coupled_frf_at(robot: SpatialRobot, q: Real, frequencies: Real, loss_factor: float = 0.0) -> Frf:
    """The same by receptance coupling: free links and bodies in space, joined by joint springs and rigid links.

    Chen et al. 2026, Eqs. 4-7, in three dimensions: ``H' = H - H B (B^T H B + diag(1 / k))^-1 B^T H`` with H of the
    parts apart and a column of B for every direction of every joint, turned into its axes; compliance 0 where it is
    rigid, and for the clamp of node 0.

    Raises
    ------
    InputError
        Frequencies that are not positive, a part without mass (its receptance is infinite), gravity, or drives.
    """
    if np.min(frequencies) <= 0:
        raise InputError("free links have no receptance at 0 Hz; ask for frequencies above 0, or exact_frf_at")
    if robot.gravity:
        raise InputError("weight acts between parts: receptance coupling takes none; use exact_frf_at")
    structure = structure_at(robot, q)
    if structure.drives:
        raise InputError("a motor's inertia acts between parts: receptance coupling takes none; use exact_frf_at")
    omega = 2 * np.pi * np.asarray(frequencies, dtype=float)
    try:
        apart: Complex = np.asarray(np.linalg.inv(_links_and_bodies(structure, omega, loss_factor)), dtype=complex)
    except np.linalg.LinAlgError as error:
        raise InputError("a part of the robot has no mass, so no receptance of its own; use exact_frf_at") from error
    clamp = np.eye(6 * len(structure.positions))[:, :6]
    columns, compliance = [clamp, rigid_rows(structure).T], []
    for spring in structure.springs:
        elastic = np.isfinite(spring.stiffness)
        turned = np.zeros((len(clamp), int(elastic.sum())))
        for node, sign, motion in zip(spring.nodes, (-1.0, 1.0), spring.motions(structure.positions), strict=True):
            turned[6 * node : 6 * node + 6] = sign * motion[elastic].T
        columns.append(turned)
        compliance.append(1 / (spring.stiffness[elastic] * (1 + 1j * loss_factor)))
    rigid = columns[0].shape[1] + columns[1].shape[1]
    joined = couple_along(apart, np.hstack(columns), np.concatenate([np.zeros(rigid, dtype=complex), *compliance]))
    tip = slice(6 * structure.tip, 6 * structure.tip + 3)
    return _tip_frf(omega, np.asarray(joined[:, tip, tip]))


def _links_and_bodies(structure: Structure, omega: Real, loss_factor: float) -> Complex:
    """Dynamic stiffness of links and bodies apart, over all nodes, (n_frequencies, 6 H, 6 H)."""
    bodies = replace(structure, springs=(), beams=())
    whole = -(omega[:, None, None] ** 2) * mass_matrix(bodies).astype(complex)
    for beam in structure.beams:
        arm = structure.positions[beam.nodes[1]] - structure.positions[beam.nodes[0]]
        local = spatial_dynamic_stiffness(beam.section, float(np.linalg.norm(arm)), omega, loss_factor)
        turn = np.kron(np.eye(4), beam.axes)
        dofs = np.concatenate([np.arange(6 * node, 6 * node + 6) for node in beam.nodes])
        whole[:, dofs[:, None], dofs] += turn @ local @ turn.T
    return np.asarray(whole)


def _tip_frf(omega: Real, values: Complex) -> Frf:
    valid = np.ones(len(omega), dtype=bool)
    return Frf(omega / (2 * np.pi), values, TIP, TIP, "receptance", "m/N", valid)
