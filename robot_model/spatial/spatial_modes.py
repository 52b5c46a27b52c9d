"""The step from a posture to natural frequencies, mode shapes and the `ModalModel` at the tool tip."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from estimation import Frf
from foundation import TIP, InputError
from modal_fit import ModalModel

from ..finite_elements import (
    Structure,
    coordinate_basis,
    from_real_modes,
    mass_matrix,
    modal_model,
    six_by_six,
    stiffness_matrix,
)
from ..kinematics import drive_direction
from .spatial_robot import SpatialRobot, structure_at

Real = NDArray[np.float64]

TIP_ROTATIONS = ("TCP:+RX", "TCP:+RY", "TCP:+RZ")


@dataclass(frozen=True)
class StructureModes:
    """Undamped modes of a structure at one posture.

    Parameters
    ----------
    structure
        Structure whose modes these are.
    squares : (n_modes,), (rad/s)^2
        Squared angular natural frequencies omega^2, rising.
    shapes : (n_modes, n_nodes, 6)
        Displacement and rotation of every node, mass-normalised, in the base frame.
    """

    structure: Structure
    squares: Real
    shapes: Real

    @property
    def frequencies(self) -> Real:
        """Natural frequencies, Hz, shape (n_modes,)."""
        return np.sqrt(self.squares) / (2 * np.pi)


def modes_at(robot: SpatialRobot, q: Real) -> StructureModes:
    """``(K - omega^2 M) P = 0`` at the joint values q (n_moving,), constraints built in (Mousavi et al., Eq. 12).

    Raises
    ------
    InputError
        A coordinate without mass, or a structure that is not held.
    """
    structure = structure_at(robot, q)
    basis = coordinate_basis(structure)
    stiffness = basis.T @ stiffness_matrix(structure) @ basis
    mass = basis.T @ mass_matrix(structure) @ basis
    try:
        squares, vectors = eigh(stiffness, mass)
    except np.linalg.LinAlgError as error:
        raise InputError(
            "the mass matrix is singular: a node has no mass; add [[bodies]] to the robot's file"
        ) from error
    if squares[0] <= 0:
        raise InputError(f"the structure is not held: lowest omega^2 = {squares[0]:.3g}; check joints and links")
    shapes = (basis @ vectors).T.reshape(len(squares), -1, 6)
    return StructureModes(structure, squares, shapes)


def modal_model_at(
    robot: SpatialRobot,
    q: Real,
    *,
    axes: Real | None = None,
    rotations: bool = False,
    highest_frequency: float = np.inf,
) -> ModalModel:
    """Give the modal model at the tool tip in a posture, damped as the robot says (Rayleigh, or one ratio).

    Parameters
    ----------
    robot
        Robot whose structure is computed.
    q : (n_moving,), rad or m
        Joint values of the posture.
    axes : (3, 3) or None
        Axes X, Y, Z of the wanted frame (feed, normal, axial) as columns in the base frame; None: the base frame.
    rotations
        Whether rotations and moments are included: six degrees of freedom instead of three.
    highest_frequency : Hz
        Highest natural frequency that is kept; higher modes, and overdamped ones, are left as their static flexibility.
    """
    return model_of_modes(
        modes_at(robot, q), robot, axes=axes, rotations=rotations, highest_frequency=highest_frequency
    )


def model_of_modes(
    modes: StructureModes,
    robot: SpatialRobot,
    *,
    axes: Real | None = None,
    rotations: bool = False,
    highest_frequency: float = np.inf,
) -> ModalModel:
    """The same from modes that are known."""
    turn = six_by_six(np.eye(3) if axes is None else np.asarray(axes, dtype=float)).T
    tip = modes.shapes[:, modes.structure.tip] @ turn.T
    labels = (*TIP, *TIP_ROTATIONS) if rotations else TIP
    shapes = tip[:, : len(labels)].T
    if any(joint.damping for joint in robot.joints):
        unit, stiffness = np.eye(len(modes.squares)), np.diag(modes.squares)
        return modal_model(unit, damping_of_modes(robot, modes), stiffness, shapes, labels, highest_frequency)
    damping = modal_damping(robot, modes.squares)
    return from_real_modes(modes.squares, shapes, damping, np.eye(len(labels)), labels, highest_frequency)


def modal_damping(robot: SpatialRobot, squares: Real) -> Real:
    """``2 zeta omega`` of every mode: ``a + b omega^2`` (Mousavi et al., Eq. 10) or one ratio; rad/s, (n_modes,)."""
    if robot.damping_ratio is not None:
        return np.asarray(2 * robot.damping_ratio * np.sqrt(squares))
    a, b = robot.rayleigh
    return a + b * squares


def damping_of_modes(robot: SpatialRobot, modes: StructureModes) -> Real:
    """Damping matrix over mass-normalised modes, ``diag(2 zeta omega) + sum_j c_j b_j b_j^T``, rad/s, (n, n).

    ``b_j`` holds each mode's motion in joint j, about or along the joint's axis; c_j is that joint's own damping.

    Raises
    ------
    InputError
        A direction that is not damped: the joints' damping of negative sign is more than the robot's.
    """
    whole = np.diag(modal_damping(robot, modes.squares))
    if not any(joint.damping for joint in robot.joints):
        return whole
    motions = {frame.name: drive_direction(frame) for frame in robot.mechanism.frames}
    for joint, spring in zip(robot.joints, modes.structure.springs, strict=True):
        if joint.damping:
            before, after = (part[motions[joint.frame]] for part in spring.motions(modes.structure.positions))
            first, second = spring.nodes
            moved = modes.shapes[:, second] @ after - modes.shapes[:, first] @ before
            whole += joint.damping * np.outer(moved, moved)
    least = float(np.linalg.eigvalsh(whole)[0])
    if least < -1e-9 * float(np.abs(whole).max()):
        raise InputError(
            f"the joints' damping leaves a motion with {least:.3g} 1/s: it must not be negative; "
            "raise damping_nms_per_rad, or the robot's [damping]"
        )
    return whole


def damping_warnings(robot: SpatialRobot, modes: StructureModes) -> tuple[str, ...]:
    """Warn in one sentence of large Rayleigh damping in high modes; empty where all stay below 20 %."""
    ratios = np.diag(damping_of_modes(robot, modes)) / (2 * np.sqrt(modes.squares))
    high = modes.frequencies > 20.0
    if not np.any(ratios[high] > 0.2):
        return ()
    first = modes.frequencies[high & (ratios > 0.2)][0]
    count = int(np.sum(ratios >= 1))
    return (
        f"Rayleigh damping gives more than 20 % from {first:.0f} Hz on, and {count} modes are overdamped; "
        "two measured ratios at low frequencies say nothing about high ones: give a ratio instead",
    )


def frf_at(robot: SpatialRobot, q: Real, frequencies: Real, *, axes: Real | None = None) -> Frf:
    """Receptance at the tool tip, all modes, overdamped ones included exactly; frequencies in Hz."""
    modes = modes_at(robot, q)
    turn = np.eye(3) if axes is None else np.asarray(axes, dtype=float)
    tip = modes.shapes[:, modes.structure.tip, :3] @ turn
    omega = 2 * np.pi * np.asarray(frequencies, dtype=float)[:, None]
    damping = damping_of_modes(robot, modes)
    if any(joint.damping for joint in robot.joints):
        stiffness = np.eye(len(damping)) * (modes.squares - omega**2)[:, None, :]
        values = tip.T @ np.linalg.solve(stiffness + 1j * omega[:, :, None] * damping, tip.astype(complex))
    else:
        gain = 1 / (modes.squares - omega**2 + 1j * omega * np.diag(damping))
        values = np.einsum("kr,rp,rq->kpq", gain, tip, tip, optimize=True)
    valid = np.ones(len(omega), dtype=bool)
    return Frf(omega[:, 0] / (2 * np.pi), values, TIP, TIP, "receptance", "m/N", valid)
