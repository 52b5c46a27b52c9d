"""Deviation of a robot while it drills: joint compliance, position gain, and runout of the drill."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError, Real
from millfrf.cutting import DrillingLoad, SettledDrill

from ..finite_elements.statics import gravity_torques, tip_compliance
from ..kinematics.mechanism import tool_jacobian
from ..settings import ROBOT
from ..spatial.spatial_modes import frf_at
from ..spatial.spatial_robot import SpatialRobot, drive_stiffness, structure_at
from ..spatial.weight import (
    NO_PAYLOAD,
    Payload,
    acceleration,
    payload_wrench,
    static_response,
    tool_attitude,
    weight_deflection,
)
from .cut_path import CutPlace, nearest_branch


def drilling_wrench(load: DrillingLoad, tool_axis: Real) -> Real:
    """Compute force and moment of drilling on the robot, base frame, (6,), N and N m.

    The thrust pushes the tool back along its axis; the torque acts against the rotation of the drill.
    """
    return np.concatenate([-load.thrust * tool_axis, -load.torque * tool_axis])


def joint_deformation(robot: SpatialRobot, q: Real, wrench: Real, position_gain: Real | None = None) -> Real:
    """Compute small motions of the driven joints, rad or m: ``phi = tau / k`` plus ``tau / K_pos`` of the controller.

    ``tau = J^T W`` are the torques of the process on the joints, with W (6,) the force and moment on the tool in the
    base frame; the simulated angles are ``psi + Delta psi_Kpos + phi`` (Ferreras-Higuero et al., Eq. 41). Only the
    stiffness of the joints in their direction of motion is used. ``position_gain`` (n_active,) is in N m/rad or N/m;
    without it the controller holds the motors at fixed angles.
    """
    if robot.mechanism.closures:
        raise InputError("this robot has closed loops; its deflection is tip_compliance @ wrench")
    servo = 0 if position_gain is None else 1 / np.asarray(position_gain, dtype=float)
    compliance = 1 / drive_stiffness(robot) + servo
    return np.asarray(compliance * (tool_jacobian(robot.mechanism, q).T @ wrench))


def joint_deviation(robot: SpatialRobot, q: Real, wrench: Real, position_gain: Real | None = None) -> Real:
    """Compute the vector from the real to the nominal place of the tool, m, (3,): ``q_TCP - q_TCP_sim`` of Eq. 21.

    The tool is placed with the deformed angles, so that large deformations are exact.
    """
    tool = robot.mechanism.index(robot.mechanism.tool)
    deformed = q + joint_deformation(robot, q, wrench, position_gain)
    return np.asarray((robot.mechanism.transforms(q) - robot.mechanism.transforms(deformed))[tool, :3, 3])


@dataclass(frozen=True)
class DeviationMap:
    """Deviation under a drilling load over places of the tool.

    Parameters
    ----------
    positions : (n, 3), m
        Nominal places of the tool.
    deviations : (n, 3), m
        Nominal minus real place; NaN exactly where the place is not reached.
    weight : (n, 3), m
        Nominal minus real place under own weight and payload alone; NaN where the place is not reached or masses are
        unknown.
    q : (n, 6), rad
        Joint values at each place; NaN where it is not reached.
    reached : (n,), bool
        Whether the robot reaches the place.
    switches : (n,), bool
        Whether the inverse kinematics changes its branch between the place before and this place: the deviation then
        jumps because of the robot, not of the material (Ferreras-Higuero et al., Fig. 13).
    """

    positions: Real
    deviations: Real
    weight: Real
    q: Real
    reached: NDArray[np.bool_]
    switches: NDArray[np.bool_]


def deviation_map(
    robot: SpatialRobot,
    places: list[CutPlace],
    load: DrillingLoad,
    *,
    position_gain: Real | None = None,
    links: bool = False,
    payload: Payload = NO_PAYLOAD,
) -> DeviationMap:
    """Compute the deviation at each place, on the branch nearest to the posture at the place before.

    Parameters
    ----------
    robot
        Robot, an open chain.
    places
        Tool axis and position of each hole.
    load
        Thrust and torque of the drill.
    position_gain : (n_active,), N m/rad or N/m, or None
        Position gain of the controller; None: it holds the motor's angle whatever the torque.
    links
        Whether to add the compliance of links and of the joints' other directions: the linear elastic structure.
    payload
        Load that the robot carries besides the bodies of its file.

    Raises
    ------
    InputError
        Links together with a position gain: that model holds the motors.
    """
    if links and position_gain is not None:
        raise InputError("deviation map: give either links or a position gain")
    n = len(places)
    deviations, sags = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    postures = np.full((n, len(robot.mechanism.moving)), np.nan)
    reached, switches = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    last: Real | None = None
    for i, place in enumerate(places):
        q = nearest_branch(robot.mechanism, place, last)
        if q is None:
            continue
        switches[i] = last is not None and np.abs(q - last).max() > ROBOT.branch_switch
        wrench = drilling_wrench(load, place.attitude[:, 2])
        if links:
            deviations[i] = -(tip_compliance(structure_at(robot, q)) @ wrench)[:3]
        else:
            deviations[i] = joint_deviation(robot, q, wrench, position_gain)
        if robot.bodies:
            sags[i] = -_sag(robot, q, payload, links)
        postures[i], reached[i], last = q, True, q
    positions = np.array([place.position for place in places]).reshape(n, 3)
    return DeviationMap(positions, deviations, sags, postures, reached, switches)


def sag_parts(robot: SpatialRobot, q: Real, payload: Payload = NO_PAYLOAD) -> Real:
    """Compute the tool's displacement by each driven joint under the robot's weight and payload, m, (3, n_active).

    Joint j contributes ``J_j tau_j / k_j`` with the torques of :func:`millfrf.robot_model.gravity_torques`.
    """
    jacobian = tool_jacobian(robot.mechanism, q)
    payload_torques = jacobian.T @ payload_wrench(robot, tool_attitude(robot.mechanism, q), payload)
    torques = gravity_torques(robot, q, structure_at(robot, q), acceleration(robot)) + payload_torques
    return np.asarray(jacobian[:3] * (torques / drive_stiffness(robot)))


def _sag(robot: SpatialRobot, q: Real, payload: Payload, links: bool) -> Real:
    """Compute the tool's displacement under the robot's weight and payload, (3,), m; with or without links."""
    if links:
        return weight_deflection(robot, q, static_response(robot, structure_at(robot, q)), payload)[:3]
    return np.asarray(sag_parts(robot, q, payload).sum(axis=1))


@dataclass(frozen=True)
class ProcessDeviation:
    """Parts of ``delta_mach``, m, as displacements of the drill's tip (Ferreras-Higuero et al., Eq. 5).

    Runout and bending turn with the spindle: they widen the hole, but move its axis only if the drill wanders to one
    side at entry. The sum of all parts is an upper bound of the deviation of the hole's axis.

    Parameters
    ----------
    axis
        delta_axis: offset of the tool's axis in its holder, which does not turn with the spindle.
    runout
        delta_rho: eccentricity of the tip at rest, half the runout's reading.
    bending
        delta_deftool: bending of the drill under the transverse force that runout causes.
    tip
        Distance of the tip from the axis of rotation as it cuts: vector sum of runout and bending.
    """

    axis: float
    runout: float
    bending: float
    tip: float

    @property
    def total(self) -> float:
        """``delta_mach = delta_axis + delta_rho + delta_deftool``, all to the same side, m."""
        return self.axis + self.runout + self.bending


def process_deviation(settled: SettledDrill, runout: float, axis: float = 0.0) -> ProcessDeviation:
    """Compute the parts of ``delta_mach`` for a drill with runout.

    Parameters
    ----------
    settled
        The drill in equilibrium with its transverse force (:func:`millfrf.cutting.settled_drill`).
    runout : m
        Total indicator reading at the tip, at rest.
    axis : m
        Offset of the tool's axis in its holder.

    Raises
    ------
    InputError
        A negative runout or offset.
    """
    if not (runout >= 0 and axis >= 0):
        raise InputError(f"runout {runout!r} m and offset {axis!r} m of a tool: give distances, 0 or more")
    bent, tip = (float(np.hypot(*place)) for place in (settled.bending, settled.eccentricity))
    return ProcessDeviation(axis, runout / 2, bent, tip)


def orbit_radius(robot: SpatialRobot, q: Real, force: float, spindle_speed: float, axes: Real) -> float:
    """Compute the largest displacement (m) across the tool axis that a force turning with the spindle causes.

    ``x = Re(H(Omega) f exp(i Omega t))``, ``f = F (1, -i)``, describes an ellipse; the result is its longer half axis
    ("a transverse excitation of the robot at the rotating frequency", Ferreras-Higuero et al., section 3).

    Parameters
    ----------
    robot
        Robot with its masses.
    q : (n_moving,), rad or m
        Joint values of the posture.
    force : N
        Size of the force.
    spindle_speed : rad/s
        Speed with which it turns.
    axes : (3, 3)
        Frame whose third column is the tool's axis, in the base frame.

    Raises
    ------
    InputError
        A spindle that does not turn, or a robot without masses.
    """
    if not spindle_speed > 0:
        raise InputError(f"spindle speed {spindle_speed!r} rad/s must be positive")
    if not robot.bodies and all(link.section is None for link in robot.links):
        raise InputError("this robot's file gives no masses: its response to a turning force is unknown")
    receptance = frf_at(robot, q, np.array([spindle_speed / (2 * np.pi)]), axes=axes).values[0, :2, :2]
    response = receptance @ np.array([1.0, -1.0j]) * force
    return float(np.linalg.svd(np.column_stack([response.real, response.imag]), compute_uv=False)[0])
