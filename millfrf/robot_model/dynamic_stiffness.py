"""Exact dynamic stiffness of beams and receptance coupling: the reference for the finite elements."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimation import Frf
from millfrf.core import TIP, Complex, InputError, Real
from modal_fit import bending_stiffness

from .finite_elements.beam_element import Section
from .finite_elements.structure import Structure, coordinate_basis, mass_matrix, rigid_rows, stiffness_matrix
from .planar import TIP_IN_PLANE, PlanarRobot
from .spatial.spatial_robot import SpatialRobot, structure_at


def planar_dynamic_stiffness(section: Section, length: float, omega: Real, loss_factor: float = 0.0) -> Complex:
    """Compute forces ``(N, Q, M)`` over displacements ``(u, v, phi)`` of both ends of a beam, (n_frequencies, 6, 6).

    Chen et al. 2026, Eq. 2 and appendix (whose printed coefficients lost their signs in the text). The material's
    loss factor turns E and G into ``E (1 + i loss_factor)``.

    Parameters
    ----------
    omega : (n_frequencies,), rad/s
        Angular frequencies; zero gives the static stiffness.
    """
    stiffness = np.zeros((len(omega), 6, 6), dtype=complex)
    rod = _rod(section.axial, section.mass, length, omega, loss_factor)
    bend = bending_stiffness(*_in_xy(section), length, np.asarray(1j * omega, dtype=complex), loss_factor)
    for dofs, block in (([0, 3], rod), ([1, 2, 4, 5], bend)):
        stiffness[np.ix_(range(len(omega)), dofs, dofs)] = block
    return stiffness


def spatial_dynamic_stiffness(section: Section, length: float, omega: Real, loss_factor: float = 0.0) -> Complex:
    """Compute the stiffness over ``(u, v, w, theta_x, theta_y, theta_z)`` of both ends, (n_frequencies, 12, 12).

    The parameters are as in :func:`planar_dynamic_stiffness`. Bending in the x-z plane has ``dw/dx = -theta_y``.
    """
    stiffness = np.zeros((len(omega), 12, 12), dtype=complex)
    rod = _rod(section.axial, section.mass, length, omega, loss_factor)
    torsion = _rod(section.torsion, section.polar, length, omega, loss_factor)
    s = np.asarray(1j * omega, dtype=complex)
    in_xy = bending_stiffness(*_in_xy(section), length, s, loss_factor)
    in_xz = bending_stiffness(
        section.bending_y, section.shear_z, section.mass, section.rotary_y, length, s, loss_factor
    )
    sign = np.array([1.0, -1.0, 1.0, -1.0])
    blocks = (
        ([0, 6], rod),
        ([3, 9], torsion),
        ([1, 5, 7, 11], in_xy),
        ([2, 4, 8, 10], in_xz * np.outer(sign, sign)),
    )
    for dofs, block in blocks:
        stiffness[np.ix_(range(len(omega)), dofs, dofs)] = block
    return stiffness


def _in_xy(section: Section) -> tuple[float, float, float, float]:
    return section.bending_z, section.shear_y, section.mass, section.rotary_z


def _rod(stiffness: float, mass: float, length: float, omega: Real, loss_factor: float) -> Complex:
    """Compute the dynamic stiffness of a rod in tension or torsion, (n_frequencies, 2, 2).

    It is ``(E A / L) (mu / sin mu) [[cos mu, -1], [-1, cos mu]]`` with ``mu = omega L / c`` and the wave speed c.
    """
    complex_stiffness = stiffness * (1 + 1j * loss_factor)
    mu = omega * length * np.sqrt(mass / complex_stiffness)
    scale = complex_stiffness / length / np.sinc(mu / np.pi)
    rod = np.empty((len(omega), 2, 2), dtype=complex)
    rod[:, 0, 0] = rod[:, 1, 1] = scale * np.cos(mu)
    rod[:, 0, 1] = rod[:, 1, 0] = -scale
    return rod


def couple_receptances(
    receptance: Complex, pairs: Sequence[tuple[int, int]], compliance: Sequence[complex] | Complex
) -> Complex:
    """Join the degrees of freedom of each pair by a spring (Chen et al. 2026, Eqs. 4-7, for any number of springs).

    Parameters
    ----------
    receptance : (n_frequencies, n_dof, n_dof)
        Block-diagonal receptances of the separate substructures, measured or computed; m/N, rad/N and rad/(N m).
    compliance : (n_pairs,)
        1 / stiffness of each spring, complex with loss; 0 joins rigidly (de Klerk, Rixen & Voormeeren 2008, AIAA J. 46,
        dual assembly).
    """
    n_dof = receptance.shape[1]
    if len(pairs) != len(compliance):
        raise InputError(f"{len(pairs)} pairs to couple but {len(compliance)} compliances; give one for each")
    if any(not 0 <= dof < n_dof for pair in pairs for dof in pair):
        raise InputError(f"coupling {list(pairs)} names a degree of freedom that is not in 0 to {n_dof - 1}")
    signs = np.zeros((n_dof, len(pairs)))
    for column, (first, second) in enumerate(pairs):
        signs[first, column] += 1
        signs[second, column] -= 1
    return couple_along(receptance, signs, compliance)


def couple_along(receptance: Complex, directions: Real, compliance: Sequence[complex] | Complex) -> Complex:
    """Join substructures by springs along any directions: ``H' = H - H B (B^T H B + diag(compliance))^-1 B^T H``.

    Each column of ``directions`` B (n_dof, n_springs) gives the elongation of one spring over the degrees of freedom.
    A spring may act in the axes of a joint, hold the end of a rigid link, or connect a degree of freedom to the ground.
    """
    columns = receptance @ directions
    gap = directions.T @ columns + np.diag(np.asarray(compliance))
    return np.asarray(receptance - columns @ np.linalg.solve(gap, directions.T @ receptance))


def block_diagonal(blocks: Sequence[Complex]) -> Complex:
    """Place the receptances of separate substructures on the diagonal of one matrix, (n_frequencies, n_dof, n_dof)."""
    sizes = [block.shape[1] for block in blocks]
    matrix = np.zeros((len(blocks[0]), sum(sizes), sum(sizes)), dtype=complex)
    start = 0
    for block, size in zip(blocks, sizes, strict=True):
        matrix[:, start : start + size, start : start + size] = block
        start += size
    return matrix


def exact_receptance(robot: PlanarRobot, angles: Real, frequencies: Real) -> Frf:
    """Compute the receptance at the tip (reach, height, rotation) with the exact dynamic stiffness of the links.

    Neighbouring links share translations and have a rotation each, with the joint's spring between them (Chen et al.
    2026, Eqs. 10-17; the first spring stands on the base).

    Parameters
    ----------
    robot
        Planar robot with sections.
    angles : (n_links,), rad
        Relative joint angles of the posture.
    frequencies : (n_frequencies,), Hz
        Frequencies of the lines.

    Raises
    ------
    InputError
        The robot has no sections: its links are rigid.
    """
    links = _link_stiffness(robot, angles, frequencies)
    n_links = len(robot.lengths)
    # each node has u, v, the rotation of the link that ends there, and the rotation of the link that starts there
    stiffness = np.zeros((len(frequencies), 4 * n_links + 4, 4 * n_links + 4), dtype=complex)
    for link in range(n_links):
        start, end = 4 * link, 4 * link + 4
        dofs = [start, start + 1, start + 3, end, end + 1, end + 2]
        stiffness[np.ix_(range(len(frequencies)), dofs, dofs)] += links[link]
        spring = robot.stiffness[link] * (1 + 2j * robot.damping_ratios[link])
        before, after = start + 2, start + 3
        stiffness[:, before, before] += spring
        stiffness[:, after, after] += spring
        stiffness[:, before, after] -= spring
        stiffness[:, after, before] -= spring
    free = np.arange(3, 4 * n_links + 3)  # the base holds u, v and the rotation before the first joint
    inverse: Complex = np.linalg.inv(stiffness[:, free[:, None], free]).astype(complex)
    return _tip_receptance(np.asarray(frequencies, dtype=float), inverse[:, -3:, -3:], TIP_IN_PLANE)


def coupled_receptance(robot: PlanarRobot, angles: Real, frequencies: Real) -> Frf:
    """Compute :func:`exact_receptance` by another method: receptance coupling of free links (Chen et al., Eqs. 4-7)."""
    _check_positive(frequencies, "exact_receptance")
    links: list[Complex] = [
        np.linalg.inv(stiffness).astype(complex) for stiffness in _link_stiffness(robot, angles, frequencies)
    ]
    ground = np.zeros((len(frequencies), 3, 3), dtype=complex)
    substructures = block_diagonal([ground, *links])
    pairs: list[tuple[int, int]] = []
    compliance: list[complex] = []
    for link in range(len(links)):
        before, after = (0 if link == 0 else 6 * link), 3 + 6 * link
        pairs += [(before + axis, after + axis) for axis in range(3)]
        compliance += [0, 0, 1 / (robot.stiffness[link] * (1 + 2j * robot.damping_ratios[link]))]
    values = couple_receptances(substructures, pairs, compliance)[:, -3:, -3:]
    return _tip_receptance(np.asarray(frequencies, dtype=float), values, TIP_IN_PLANE)


def _check_positive(frequencies: Real, alternative: str) -> None:
    if np.min(frequencies) <= 0:
        raise InputError(f"free links have no receptance at 0 Hz; give frequencies above 0, or use {alternative}")


def _link_stiffness(robot: PlanarRobot, angles: Real, frequencies: Real) -> list[Complex]:
    """Compute each link's stiffness in the base frame, (n_frequencies, 6, 6): ``R^T D R`` (Chen et al. 2026, Eq. 8)."""
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


def _tip_receptance(frequencies: Real, values: Complex, labels: tuple[str, ...]) -> Frf:
    return Frf(frequencies, values, labels, labels, "receptance", "m/N", np.ones(len(frequencies), dtype=bool))


def exact_frf_at(robot: SpatialRobot, q: Real, frequencies: Real, loss_factor: float = 0.0) -> Frf:
    """Compute the receptance at the tool with the exact dynamic stiffness of the links, and lumped joints and bodies.

    ``H = S (T^T (K_joints - omega^2 M_bodies + sum B D(omega) B^T) T)^-1 S^T`` with T from :func:`coordinate_basis`:
    the planar assembly of Chen et al. 2026, Eqs. 10-17, in three dimensions. ``frequencies`` are in Hz. Links and
    joints have the complex stiffness ``K (1 + i loss_factor)``; the robot's damping is not used.
    """
    structure = structure_at(robot, q)
    omega = 2 * np.pi * np.asarray(frequencies, dtype=float)
    joints = stiffness_matrix(replace(structure, beams=())) * (1 + 1j * loss_factor)
    stiffness = joints + _links_and_bodies(structure, omega, loss_factor)
    basis = coordinate_basis(structure)
    tip = basis[6 * structure.tip : 6 * structure.tip + 3]
    loads = np.broadcast_to(tip.T.astype(complex), (len(omega), *tip.T.shape))
    values = np.asarray(tip @ np.linalg.solve(basis.T @ stiffness @ basis, loads), dtype=complex)
    return _tip_receptance(omega / (2 * np.pi), values, TIP)


def coupled_frf_at(robot: SpatialRobot, q: Real, frequencies: Real, loss_factor: float = 0.0) -> Frf:
    """Compute :func:`exact_frf_at` by another method: receptance coupling (Chen et al., Eqs. 4-7, in three dimensions).

    Free links and bodies are joined by :func:`couple_along` with a spring for every direction of every joint, in the
    axes of the joint. The compliance is 0 in rigid directions, for rigid links, and for the clamp of node 0.
    """
    _check_positive(frequencies, "exact_frf_at")
    if robot.gravity:
        raise InputError("receptance coupling takes no weight, which acts between parts; use exact_frf_at")
    structure = structure_at(robot, q)
    if structure.drives:
        raise InputError("receptance coupling takes no motor's inertia, which acts between parts; use exact_frf_at")
    omega = 2 * np.pi * np.asarray(frequencies, dtype=float)
    try:
        substructures: Complex = np.asarray(
            np.linalg.inv(_links_and_bodies(structure, omega, loss_factor)), dtype=complex
        )
    except np.linalg.LinAlgError as error:
        raise InputError("a part of the robot has no mass, so no receptance of its own; use exact_frf_at") from error
    clamp = np.eye(6 * len(structure.positions))[:, :6]
    directions, compliance = [clamp, rigid_rows(structure).T], []
    n_rigid = directions[0].shape[1] + directions[1].shape[1]
    for spring in structure.springs:
        elastic = np.isfinite(spring.stiffness)
        directions.append(spring.relative_motion(structure.positions)[elastic].T)
        compliance.append(1 / (spring.stiffness[elastic] * (1 + 1j * loss_factor)))
    all_compliances = np.concatenate([np.zeros(n_rigid, dtype=complex), *compliance])
    coupled = couple_along(substructures, np.hstack(directions), all_compliances)
    tip = slice(6 * structure.tip, 6 * structure.tip + 3)
    return _tip_receptance(omega / (2 * np.pi), np.asarray(coupled[:, tip, tip]), TIP)


def _links_and_bodies(structure: Structure, omega: Real, loss_factor: float) -> Complex:
    """Add the dynamic stiffness of all links and bodies, without joints, (n_frequencies, 6 n_nodes, 6 n_nodes)."""
    bodies = replace(structure, springs=(), beams=())
    stiffness = -(omega[:, None, None] ** 2) * mass_matrix(bodies).astype(complex)
    for beam in structure.beams:
        arm = structure.positions[beam.nodes[1]] - structure.positions[beam.nodes[0]]
        local = spatial_dynamic_stiffness(beam.section, float(np.linalg.norm(arm)), omega, loss_factor)
        turn = np.kron(np.eye(4), beam.axes)
        dofs = np.concatenate([np.arange(6 * node, 6 * node + 6) for node in beam.nodes])
        stiffness[:, dofs[:, None], dofs] += turn @ local @ turn.T
    return np.asarray(stiffness)
