"""One door to all robots: by name or file, a posture, and the same results from every kind of model."""

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from foundation import InputError
from modal_fit import ModalModel

from .constrained_statics import tip_compliance
from .loop_closure import close_loops, posture_warnings
from .planar_file import PlanarCase, read_planar_robot
from .planar_robot import TIP_IN_PLANE
from .rigid_links import rigid_matrices, rigid_model, tip_jacobian
from .robot_files import read_table
from .spatial_file import SpatialCase, read_spatial_robot
from .spatial_modes import TIP, TIP_ROTATIONS, damping_warnings, model_of_modes, modes_at
from .spatial_robot import rigid_arms, structure_at

Real = NDArray[np.float64]


@dataclass(frozen=True)
class PostureResult:
    """What every model gives in a posture.

    Parameters
    ----------
    frequencies : (n_modes,), Hz
        All undamped natural frequencies; empty where the robot's file gives no masses.
    model
        Modal model at the tool tip, or None without masses.
    compliance : (n_dof, n_dof)
        At the tool over ``labels``, m/N, rad/N, rad/(N m).
    labels
        ``node:direction``.
    warnings
        Limits, singularities, damping: one sentence each.
    """

    frequencies: Real
    model: ModalModel | None
    compliance: Real
    labels: tuple[str, ...]
    warnings: tuple[str, ...]

    @property
    def stiffness(self) -> Real:
        """Inverse of the compliance; a displacement with all other degrees of freedom of the tool held."""
        return np.asarray(np.linalg.inv(self.compliance))

    def known_model(self) -> ModalModel:
        """The modal model.

        Raises
        ------
        InputError
            The robot's file gives no masses.
        """
        if self.model is None:
            raise InputError("this robot's file gives stiffness but no masses: it has statics, not modes")
        return self.model


def read_robot(robot: str | os.PathLike[str]) -> PlanarCase | SpatialCase:
    """Read a robot of any kind, by path or by the name of one that comes along.

    Raises
    ------
    InputError
        No such robot.
    FileFormatError
        A file of no known kind, or one that does not keep to its kind.
    """
    head = read_table(robot).get("robot")
    kind = head.get("kind") if isinstance(head, dict) else None
    return read_planar_robot(robot) if kind == "planar" else read_spatial_robot(robot)


def named_posture(case: PlanarCase | SpatialCase, name: str | None) -> Real:
    """Driven joint values (rad, m) of a posture in the robot's file; None: the first.

    Raises
    ------
    InputError
        No such posture.
    """
    if name is None and case.poses:
        return next(iter(case.poses.values()))
    if name is None:
        raise InputError("the robot's file names no posture; give the joint values, or add a [[poses]] table")
    if name not in case.poses:
        raise InputError(f"no posture {name!r}; the robot's file has {', '.join(case.poses) or 'none'}")
    return case.poses[name]


def in_posture(case: PlanarCase | SpatialCase, driven: Real, axes: Real | None = None) -> PostureResult:
    """Frequencies, modal model and compliance at driven joint values (rad; prismatic joints: m).

    Parameters
    ----------
    case
        Of either kind.
    driven
        As many as the robot has driven joints.
    axes : (3, 3) or None
        Frame of the tool's degrees of freedom, as columns in the base frame (robots in space only).
    """
    if isinstance(case, PlanarCase):
        return _planar(case, driven)
    robot = case.robot
    q = close_loops(robot.mechanism, driven)
    structure = structure_at(robot, q)
    compliance = tip_compliance(structure)
    if axes is not None:
        turn = np.kron(np.eye(2), np.asarray(axes))
        compliance = turn.T @ compliance @ turn
    warnings = (*posture_warnings(robot.mechanism, q), *rigid_arms(robot, structure))
    labels = (*TIP, *TIP_ROTATIONS)
    if not robot.bodies:
        return PostureResult(np.zeros(0), None, compliance, labels, warnings)
    modes = modes_at(robot, q)
    model = model_of_modes(modes, robot, axes=axes)
    return PostureResult(modes.frequencies, model, compliance, labels, (*warnings, *damping_warnings(robot, modes)))


def _planar(case: PlanarCase, driven: Real) -> PostureResult:
    mass, stiffness = rigid_matrices(case.robot, driven)
    tip = tip_jacobian(case.robot, driven)
    frequencies = np.sqrt(eigh(stiffness, mass, eigvals_only=True)) / (2 * np.pi)
    compliance = tip @ np.linalg.solve(stiffness, tip.T)
    return PostureResult(frequencies, rigid_model(case.robot, driven), compliance, TIP_IN_PLANE, ())
