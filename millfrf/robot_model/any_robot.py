"""One door to all robots: by name or file, a posture, and the same results from every kind of model."""

import os
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy

from millfrf.core import TIP, InputError, Real
from modal_fit import ModalModel

from .files.planar_file import PlanarCase, read_planar_robot
from .files.robot_files import read_table
from .files.serial_file import read_serial_robot
from .files.spatial_file import SpatialCase, read_spatial_robot
from .kinematics.mechanism import close_loops, posture_warnings
from .planar import TIP_IN_PLANE, flexible_chain, planar_compliance, planar_sag, rigid_matrices, rigid_model
from .spatial.spatial_modes import TIP_ROTATIONS, damping_warnings, modal_model_at, model_of_modes, modes_at
from .spatial.spatial_robot import rigid_arms, structure_at
from .spatial.weight import NO_MASSES, static_response
from .uncertain_robot.bands import below_new_modes, with_model_covariance


@dataclass(frozen=True)
class PostureResult:
    """Results that every robot model gives in a posture.

    Parameters
    ----------
    frequencies : (n_modes,), Hz
        All undamped natural frequencies; empty where the robot's file gives no masses.
    model
        Modal model at the tool tip, or None without masses; with the covariance that an update left, where there was
        one; its highest modes are static flexibility then.
    compliance : (n_dof, n_dof), m/N, rad/N, rad/(N m)
        Static compliance at the tool over ``labels``.
    labels
        Degrees of freedom at the tool, ``node:direction``.
    warnings
        Doubts about limits, singularities, damping and missing data of the file: one sentence each.
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
    if kind == "planar":
        return read_planar_robot(robot)
    return read_serial_robot(robot) if kind == "serial" else read_spatial_robot(robot)


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
        Whether a planar robot's link sections count, not the joints alone (robots in space always count them).
    """
    if isinstance(case, PlanarCase):
        return _planar(case, driven, links)
    robot = case.robot
    q = close_loops(robot.mechanism, driven)
    structure = structure_at(robot, q)
    static = static_response(robot, structure)
    turn = np.eye(6) if axes is None else np.kron(np.eye(2), np.asarray(axes))
    compliance = turn.T @ static.compliance @ turn
    warnings = (*case.assumed, *posture_warnings(robot.mechanism, q), *rigid_arms(robot, structure))
    labels = (*TIP, *TIP_ROTATIONS)
    if static.own_weight is None:
        return PostureResult(np.zeros(0), None, compliance, labels, (*warnings, NO_MASSES))
    modes = modes_at(robot, q)
    model = model_of_modes(modes, robot, axes=axes)
    if case.uncertainty is not None:
        top = below_new_modes(robot, case.uncertainty, lambda changed: modes_at(changed, q).frequencies)
        given = partial(modal_model_at, q=q, axes=axes, highest_frequency=top)
        model = with_model_covariance(robot, case.uncertainty, given)
    warnings = (*warnings, *damping_warnings(robot, modes))
    return PostureResult(modes.frequencies, model, compliance, labels, warnings, turn.T @ static.own_weight)


def _planar(case: PlanarCase, driven: Real, links: bool) -> PostureResult:
    robot = case.robot
    rigid = rigid_model(robot, driven)
    if robot.sections is None:
        return PostureResult(
            _undamped(*rigid_matrices(robot, driven)),
            rigid,
            planar_compliance(robot, driven),
            TIP_IN_PLANE,
            (),
            planar_sag(robot, driven),
        )
    flexible = flexible_chain(robot, driven)
    if links:
        compliance = flexible.compliance()
        return PostureResult(flexible.frequencies(), flexible.model(), compliance, TIP_IN_PLANE, (), flexible.sag())
    frequencies = _undamped(*rigid_matrices(robot, driven))
    compliance = planar_compliance(robot, driven)
    lower, softer = flexible.frequencies()[0], flexible.compliance()
    share = 100 * (np.linalg.norm(softer[:2, :2], 2) / np.linalg.norm(compliance[:2, :2], 2) - 1)
    left_out = (
        f"the links are taken as rigid: the file's {len(robot.sections)} link sections are left out; with them the "
        f"first mode is at {lower:.2f} Hz instead of {frequencies[0]:.2f} Hz and the tip {share:.2g} % softer "
        "(links=True, --links, takes them in)"
    )
    return PostureResult(frequencies, rigid, compliance, TIP_IN_PLANE, (left_out,), planar_sag(robot, driven))


def _undamped(mass: Real, stiffness: Real) -> Real:
    return np.asarray(np.sqrt(scipy.linalg.eigh(stiffness, mass, eigvals_only=True)) / (2 * np.pi))
