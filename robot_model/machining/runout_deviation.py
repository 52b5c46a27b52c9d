"""What drilling adds to a robot's deviation: runout, the drill's bending, what the robot follows of them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cutting import SettledDrill
from foundation import InputError

from ..spatial import SpatialRobot, frf_at

Real = NDArray[np.float64]


@dataclass(frozen=True)
class ProcessDeviation:
    """Parts of ``delta_mach``, m, as distances of the drill's tip (Ferreras-Higuero et al., Eq. 5).

    Runout and bending turn with the spindle: they widen the hole, and move its axis only as far as the drill wanders to
    one side at entry. Their sum is the most that the axis of the hole can be off by them.

    Parameters
    ----------
    axis
        delta_axis: offset of the tool's axis in its holder, which stands still; it has to be told.
    runout
        delta_rho: eccentricity of the tip at rest, half the runout's reading.
    bending
        delta_deftool: bending of the drill under the transverse force that runout causes.
    tip
        Distance of the tip from the axis of rotation as it cuts: runout and bending with their directions.
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
    """Give the parts of ``delta_mach`` for a drill that runs out of true.

    Parameters
    ----------
    settled
        The drill in equilibrium with its transverse force (:func:`cutting.settled_drill`).
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
    """Largest distance that a force turning with the spindle moves the tool across its axis, m.

    ``x = Re(H(Omega) f exp(i Omega t))``, ``f = F (1, -i)``: an ellipse; its longer half axis is given ("a transverse
    excitation of the robot at the rotating frequency", Ferreras-Higuero et al., section 3).

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
        raise InputError("this robot's file gives no masses: how it follows a turning force cannot be told")
    receptance = frf_at(robot, q, np.array([spindle_speed / (2 * np.pi)]), axes=axes).values[0, :2, :2]
    moved = receptance @ np.array([1.0, -1.0j]) * force
    return float(np.linalg.svd(np.column_stack([moved.real, moved.imag]), compute_uv=False)[0])
