"""Exact dynamic stiffness of beams and receptance coupling: the reference for the finite elements."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from estimation import Frf
from millfrf.core import TIP, Complex, InputError, Real

from .finite_elements.beam_element import Section
from .finite_elements.structure import Structure, coordinate_basis, mass_matrix, rigid_rows, stiffness_matrix
from .planar import TIP_IN_PLANE, PlanarRobot
from .spatial.spatial_robot import SpatialRobot, structure_at

_PIECE = 3.0
"""Largest bending wave number times length of a piece whose transfer matrix is inverted."""


def planar_dynamic_stiffness(section: Section, length: float, omega: Real, loss_factor: float = 0.0) -> Complex:
    """Give the forces over displacements of the two ends of a beam, in the local x-y plane.

    Displacements ``(u, v, phi)`` of the first end, then of the second; forces ``(N, Q, M)`` on the beam in the same
    order. Chen et al. 2026, Eq. 2 and appendix (whose printed coefficients lost their signs in the text).

    Parameters
    ----------
    section, length
        Cross-section of the uniform beam, and its length (m).
    omega : (n_frequencies,), rad/s
        Angular frequencies. Zero is allowed: it gives the static stiffness.
    loss_factor
        Loss factor of the material: E and G become ``E (1 + i loss_factor)``.

    Returns
    -------
    (n_frequencies, 6, 6), symmetric, N/m, N and N m
    """
    stiffness = np.zeros((len(omega), 6, 6), dtype=complex)
    along = [0, 3]
    across = [1, 2, 4, 5]
    stiffness[np.ix_(range(len(omega)), along, along)] = _rod(section.axial, section.mass, length, omega, loss_factor)
    bend = _bending(section.bending_z, section.shear_y, section.mass, section.rotary_z, length, omega, loss_factor)
    stiffness[np.ix_(range(len(omega)), across, across)] = bend
    return stiffness


def spatial_dynamic_stiffness(section: Section, length: float, omega: Real, loss_factor: float = 0.0) -> Complex:
    """The same in space: ``(u, v, w, theta_x, theta_y, theta_z)`` of both ends, shape (n_frequencies, 12, 12).

    Bending in the x-z plane has the slope ``dw/dx = -theta_y``.
    """
    n = range(len(omega))
    stiffness = np.zeros((len(omega), 12, 12), dtype=complex)
    stiffness[np.ix_(n, [0, 6], [0, 6])] = _rod(section.axial, section.mass, length, omega, loss_factor)
    stiffness[np.ix_(n, [3, 9], [3, 9])] = _rod(section.torsion, section.polar, length, omega, loss_factor)
    in_xy = _bending(section.bending_z, section.shear_y, section.mass, section.rotary_z, length, omega, loss_factor)
    in_xz = _bending(section.bending_y, section.shear_z, section.mass, section.rotary_y, length, omega, loss_factor)
    sign = np.array([1.0, -1.0, 1.0, -1.0])
    stiffness[np.ix_(n, [1, 5, 7, 11], [1, 5, 7, 11])] = in_xy
    stiffness[np.ix_(n, [2, 4, 8, 10], [2, 4, 8, 10])] = in_xz * np.outer(sign, sign)
    return stiffness


def _rod(stiffness: float, mass: float, length: float, omega: Real, loss_factor: float) -> Complex:
    """Axial or torsional waves: ``(E A / L) (mu / sin mu) [[cos mu, -1], [-1, cos mu]]``, mu = omega L / c."""
    complex_stiffness = stiffness * (1 + 1j * loss_factor)
    mu = omega * length * np.sqrt(mass / complex_stiffness)
    scale = complex_stiffness / length / np.sinc(mu / np.pi)
    rod = np.empty((len(omega), 2, 2), dtype=complex)
    rod[:, 0, 0] = rod[:, 1, 1] = scale * np.cos(mu)
    rod[:, 0, 1] = rod[:, 1, 0] = -scale
    return rod


def _bending(
    bending: float, shear: float, mass: float, rotary: float, length: float, omega: Real, loss_factor: float
) -> Complex:
    """Displacements ``(w, phi)`` of both ends, from the transfer matrix of a piece, pieces then joined by doubling.

    ``w' = phi + V / (kappa G A)``, ``phi' = M / (E I)``, ``V' = -omega^2 rho A w``, ``M' = -V - omega^2 rho I phi``
    (Timoshenko 1921). The exponential has no division by a small ``1 - cos cosh``, so low frequencies lose nothing.
    """
    complex_bending = bending * (1 + 1j * loss_factor)
    frequency = omega**2 * mass * length**4 / complex_bending
    halvings = max(0, int(np.ceil(np.log2(np.abs(frequency).max(initial=1e-9) ** 0.25 / _PIECE))))
    system = np.zeros((len(omega), 4, 4), dtype=complex)
    system[:, 0, 1] = 1
    system[:, 0, 2] = bending / (shear * length**2)
    system[:, 1, 3] = 1
    system[:, 2, 0] = -frequency
    system[:, 3, 2] = -1
    system[:, 3, 1] = -frequency * rotary / (mass * length**2)
    stiffness = _from_transfer(scipy.linalg.expm(system / 2**halvings))
    for _ in range(halvings):
        stiffness = _doubled(stiffness)
    scale = np.array([1 / length, 1.0, 1 / length, 1.0])
    return np.asarray(stiffness * (complex_bending / length) * np.outer(scale, scale))


def _from_transfer(transfer: Complex) -> Complex:
    """Transfer matrix of (displacements, inner forces) to stiffness: forces on the ends over displacements."""
    t11, t12, t21, t22 = transfer[:, :2, :2], transfer[:, :2, 2:], transfer[:, 2:, :2], transfer[:, 2:, 2:]
    inverse = np.linalg.inv(t12)
    top = np.concatenate([inverse @ t11, -inverse], axis=2)
    bottom = np.concatenate([t21 - t22 @ inverse @ t11, t22 @ inverse], axis=2)
    stiffness = np.concatenate([top, bottom], axis=1)
    return np.asarray((stiffness + stiffness.swapaxes(1, 2)) / 2)


def _doubled(piece: Complex) -> Complex:
    """Two equal pieces in a row, their common node condensed."""
    aa, ab, ba, bb = piece[:, :2, :2], piece[:, :2, 2:], piece[:, 2:, :2], piece[:, 2:, 2:]
    middle = np.linalg.inv(bb + aa)
    top = np.concatenate([aa - ab @ middle @ ba, -ab @ middle @ ab], axis=2)
    bottom = np.concatenate([-ba @ middle @ ba, bb - ba @ middle @ ab], axis=2)
    return np.concatenate([top, bottom], axis=1)


def couple_receptances(
    receptance: Complex, pairs: Sequence[tuple[int, int]], compliance: Sequence[complex] | Complex
) -> Complex:
    """Receptance after the degrees of freedom of each pair were joined by a spring.

    With ``B = [e_a - e_b, ...]``: ``H' = H - H B (B^T H B + diag(compliance))^-1 B^T H``. For one spring this is Chen
    et al. 2026, Eqs. 4-7; compliance 0 joins rigidly (de Klerk, Rixen & Voormeeren 2008, AIAA J. 46, dual assembly).
    A measured or computed FRF block may stand for any substructure, in the plane or in space.

    Parameters
    ----------
    receptance : (n_frequencies, n_dof, n_dof)
        Block-diagonal FRFs of the substructures apart; m/N, m/(N m) = rad/N and rad/(N m).
    pairs
        Degrees of freedom ``(a, b)`` to be joined.
    compliance : (n_pairs,)
        1 / stiffness of each joint, complex with loss; 0: rigid.

    Raises
    ------
    InputError
        Unequal numbers of pairs and compliances, or a degree of freedom that is not there.
    """
    n_dof = receptance.shape[1]
    if len(pairs) != len(compliance):
        raise InputError(f"{len(pairs)} pairs to couple but {len(compliance)} compliances; give one for each")
    if any(not 0 <= dof < n_dof for pair in pairs for dof in pair):
        raise InputError(f"coupling {list(pairs)} names a degree of freedom outside 0 to {n_dof - 1}")
    signs = np.zeros((n_dof, len(pairs)))
    for column, (first, second) in enumerate(pairs):
        signs[first, column] += 1
        signs[second, column] -= 1
    return couple_along(receptance, signs, compliance)


def couple_along(receptance: Complex, directions: Real, compliance: Sequence[complex] | Complex) -> Complex:
    """The same along any directions: each column of ``directions`` (n_dof, n_pairs) is a gap that a spring closes.

    A column may turn degrees of freedom into a joint's axes, hold a rigid link's end, or tie one to the ground.
    """
    columns = receptance @ directions
    gap = directions.T @ columns + np.diag(np.asarray(compliance))
    return np.asarray(receptance - columns @ np.linalg.solve(gap, directions.T @ receptance))


def block_diagonal(blocks: Sequence[Complex]) -> Complex:
    """Receptances of substructures apart, in one matrix (n_frequencies, sum of n_dof, sum of n_dof)."""
    sizes = [block.shape[1] for block in blocks]
    whole = np.zeros((len(blocks[0]), sum(sizes), sum(sizes)), dtype=complex)
    start = 0
    for block, size in zip(blocks, sizes, strict=True):
        whole[:, start : start + size, start : start + size] = block
        start += size
    return whole


def exact_receptance(robot: PlanarRobot, angles: Real, frequencies: Real) -> Frf:
    """Compute the receptance at the tip (reach, height, rotation) with the exact dynamic stiffness of the links.

    Neighbouring links share translations and have a rotation each, with the joint's spring between them (Chen et al.
    2026, Eqs. 10-17; the first spring stands on the base).

    Parameters
    ----------
    robot, angles : (n_links,), rad
        A robot with sections; relative joint angles.
    frequencies : (n_frequencies,), Hz
        Frequencies of the lines.

    Raises
    ------
    InputError
        The robot has no sections: its links are rigid.
    """
    links = _link_stiffness(robot, angles, frequencies)
    n_links = len(robot.lengths)
    # node i has u, v, the rotation of the link before it and that of the link after it
    whole = np.zeros((len(frequencies), 4 * n_links + 4, 4 * n_links + 4), dtype=complex)
    for link in range(n_links):
        start, end = 4 * link, 4 * link + 4
        dofs = [start, start + 1, start + 3, end, end + 1, end + 2]
        whole[np.ix_(range(len(frequencies)), dofs, dofs)] += links[link]
        spring = robot.stiffness[link] * (1 + 2j * robot.damping_ratios[link])
        before, after = start + 2, start + 3
        whole[:, before, before] += spring
        whole[:, after, after] += spring
        whole[:, before, after] -= spring
        whole[:, after, before] -= spring
    free = np.arange(3, 4 * n_links + 3)  # the base holds u, v and the rotation before the first joint
    inverse: Complex = np.linalg.inv(whole[:, free[:, None], free]).astype(complex)
    return _tip_frf_of_exact_chain(frequencies, inverse[:, -3:, -3:])


def coupled_receptance(robot: PlanarRobot, angles: Real, frequencies: Real) -> Frf:
    """The same by receptance coupling of free links (Chen et al. 2026, Eqs. 4-7); frequencies above 0."""
    if np.min(frequencies) <= 0:
        raise InputError("free links have no receptance at 0 Hz; ask for frequencies above 0, or exact_receptance")
    links: list[Complex] = [
        np.linalg.inv(stiffness).astype(complex) for stiffness in _link_stiffness(robot, angles, frequencies)
    ]
    ground = np.zeros((len(frequencies), 3, 3), dtype=complex)
    apart = block_diagonal([ground, *links])
    pairs: list[tuple[int, int]] = []
    compliance: list[complex] = []
    for link in range(len(links)):
        before, after = (0 if link == 0 else 6 * link), 3 + 6 * link
        pairs += [(before + axis, after + axis) for axis in range(3)]
        compliance += [0, 0, 1 / (robot.stiffness[link] * (1 + 2j * robot.damping_ratios[link]))]
    return _tip_frf_of_exact_chain(frequencies, couple_receptances(apart, pairs, compliance)[:, -3:, -3:])


def _link_stiffness(robot: PlanarRobot, angles: Real, frequencies: Real) -> list[Complex]:
    """Each link in the frame of the base, ``R^T D R`` (Chen et al. 2026, Eq. 8), shape (n_frequencies, 6, 6)."""
    if robot.sections is None:
        raise InputError("the robot's links are rigid; give sections, or use rigid_model")
    omega = 2 * np.pi * np.asarray(frequencies, dtype=float)
    links = []
    for direction, length, section, ratio in zip(
        robot.directions(angles), robot.lengths, robot.sections, robot.damping_ratios, strict=True
    ):
        cosine, sine = np.cos(direction), np.sin(direction)
        turn = np.kron(np.eye(2), np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]]))
        links.append(turn.T @ planar_dynamic_stiffness(section, length, omega, 2 * ratio) @ turn)
    return links


def _tip_frf_of_exact_chain(frequencies: Real, values: Complex) -> Frf:
    axis = np.asarray(frequencies, dtype=float)
    return Frf(axis, values, TIP_IN_PLANE, TIP_IN_PLANE, "receptance", "m/N", np.ones(len(axis), dtype=bool))


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
    return _tip_frf_of_exact_structure(omega, values)


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
    return _tip_frf_of_exact_structure(omega, np.asarray(joined[:, tip, tip]))


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


def _tip_frf_of_exact_structure(omega: Real, values: Complex) -> Frf:
    valid = np.ones(len(omega), dtype=bool)
    return Frf(omega / (2 * np.pi), values, TIP, TIP, "receptance", "m/N", valid)
