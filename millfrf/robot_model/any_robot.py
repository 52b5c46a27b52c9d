"""Robots of any kind, by name or file, in any posture: the same results from every kind of model."""

import os
from dataclasses import dataclass
from functools import partial

import numpy as np

from millfrf.core import TIP, InputError, Real
from modal_fit import ModalModel

from .files.common_tables import SpatialCase
from .files.planar_file import PlanarCase, read_planar_robot
from .files.robot_files import kind_of, read_table
from .files.serial_file import read_serial_robot
from .files.spatial_file import read_spatial_robot
from .finite_elements.structure import undamped_frequencies
from .kinematics.mechanism import close_loops, posture_warnings
from .model_updating.bands import below_new_modes, with_model_covariance
from .planar import TIP_IN_PLANE, flexible_chain, planar_compliance, planar_sag, rigid_matrices, rigid_model
from .spatial.spatial_modes import TIP_ROTATIONS, damping_warnings, modal_model_at, model_of_modes, modes_at
from .spatial.spatial_robot import rigid_arm_warnings, structure_at
from .spatial.weight import NO_MASSES, static_response


@dataclass(frozen=True)
class PostureResult:
    """Results that every robot model gives in a posture.

    Parameters
    ----------
    frequencies : (n_modes,), Hz
        All undamped natural frequencies; empty if the robot's file gives no masses.
    model
        Modal model at the tool tip, or None without masses. After an update it has the covariance of the updated
        parameters, and its highest modes are replaced by their static flexibility.
    compliance : (n_dof, n_dof), m/N, rad/N, rad/(N m)
        Static compliance at the tool over ``labels``.
    labels
        Degrees of freedom at the tool, ``node:direction``.
    warnings
        Warnings about limits, singularities, damping and missing data of the file, one sentence each.
    own_weight : (n_dof,), m and rad, or None
        Deflection at the tool under the weight of links and bodies, over ``labels``; None: masses are unknown.
    """

    frequencies: Real
    model: ModalModel | None
    compliance: Real
    labels: tuple[str, ...]
    warnings: tuple[str, ...]
    own_weight: Real | None = None

    @property
    def stiffness(self) -> Real:
        """Return the inverse of the compliance: forces for a displacement of one degree of freedom, others held."""
        return np.asarray(np.linalg.inv(self.compliance))

    def known_model(self) -> ModalModel:
        """Return the modal model, or raise an `InputError` if the robot's file gives no masses."""
        if self.model is None:
            raise InputError("this robot's file gives stiffness but no masses: it has statics, not modes")
        return self.model


def read_robot(robot: str | os.PathLike[str]) -> PlanarCase | SpatialCase:
    """Read a robot of any kind, by path or by the name of a robot of this package.

    Raises
    ------
    InputError
        No such robot.
    FileFormatError
        A file of unknown kind, or with a key or number that its kind does not allow.
    """
    kind = kind_of(read_table(robot))
    if kind == "planar":
        return read_planar_robot(robot)
    return read_serial_robot(robot) if kind == "serial" else read_spatial_robot(robot)


def named_posture(case: PlanarCase | SpatialCase, name: str | None) -> Real:
    """Return the driven joint values (rad, m) of a named posture in the robot's file; None: of the first posture.

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


def in_posture(
    case: PlanarCase | SpatialCase, driven: Real, axes: Real | None = None, *, links: bool = False
) -> PostureResult:
    """Compute frequencies, modal model and compliance at driven joint values (rad; prismatic joints: m).

    Parameters
    ----------
    case
        Planar robot or robot in space, as read from its file.
    driven : (n_active,), rad or m
        Values of the driven joints.
    axes : (3, 3) or None
        Frame of the tool's degrees of freedom, as columns in the base frame (robots in space only).
    links
        Whether the link sections of a planar robot are used, not only its joints (robots in space always use them).
    """
    if isinstance(case, PlanarCase):
        return _planar(case, driven, links)
    robot = case.robot
    q = close_loops(robot.mechanism, driven)
    structure = structure_at(robot, q)
    static = static_response(robot, structure)
    turn = np.eye(6) if axes is None else np.kron(np.eye(2), np.asarray(axes))
    compliance = turn.T @ static.compliance @ turn
    warnings = (*case.assumed, *posture_warnings(robot.mechanism, q), *rigid_arm_warnings(robot, structure))
    labels = (*TIP, *TIP_ROTATIONS)
    if static.own_weight is None:
        return PostureResult(np.zeros(0), None, compliance, labels, (*warnings, NO_MASSES))
    modes = modes_at(robot, q)
    model = model_of_modes(modes, robot, axes=axes)
    if case.uncertainty is not None:
        # a rigid tool or base that becomes compliant by a small change adds modes, which have no covariance
        top = below_new_modes(robot, case.uncertainty, lambda changed: modes_at(changed, q).frequencies)
        model_of = partial(modal_model_at, q=q, axes=axes, highest_frequency=top)
        model = with_model_covariance(robot, case.uncertainty, model_of)
    warnings = (*warnings, *damping_warnings(robot, modes))
    return PostureResult(modes.frequencies, model, compliance, labels, warnings, turn.T @ static.own_weight)


def _planar(case: PlanarCase, driven: Real, links: bool) -> PostureResult:
    robot = case.robot
    flexible = None if robot.sections is None else flexible_chain(robot, driven)
    if flexible is not None and links:
        return PostureResult(
            flexible.frequencies(), flexible.model(), flexible.compliance(), TIP_IN_PLANE, (), flexible.sag()
        )
    frequencies = undamped_frequencies(*rigid_matrices(robot, driven))
    compliance = planar_compliance(robot, driven)
    warnings: tuple[str, ...] = ()
    if flexible is not None and robot.sections is not None:
        softer = np.linalg.norm(flexible.compliance()[:2, :2], 2) / np.linalg.norm(compliance[:2, :2], 2) - 1
        warnings = (
            f"the links are taken as rigid: the file's {len(robot.sections)} link sections are left out; with them the "
            f"first mode is at {flexible.frequencies()[0]:.2f} Hz instead of {frequencies[0]:.2f} Hz and the tip "
            f"{100 * softer:.2g} % softer (links=True, --links, takes them in)",
        )
    model = rigid_model(robot, driven)
    return PostureResult(frequencies, model, compliance, TIP_IN_PLANE, warnings, planar_sag(robot, driven))
