"""Position tolerance of drilled holes, and holes widened by a drill that runs out."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from millfrf.core import InputError, Real
from millfrf.core.terminal import say
from millfrf.cutting import Drill, DrillingLoad, SettledDrill, bending_stiffness, fitted_to_catalogue, settled_drill
from millfrf.robot_model import (
    NO_MASSES,
    DeviationMap,
    LoadUncertainty,
    SpatialCase,
    SpatialRobot,
    UncertaintyBudget,
    counted_weight,
    drilling_wrench,
    lateral_uncertainty,
    measured_machining_uncertainty,
    orbit_radius,
    position_tolerance,
    process_deviation,
    sag_parts,
    tool_down,
)

from ..settings import ROBOT_STEPS
from .postures import Loads

DOWN = np.array([0.0, 0.0, -1.0])  # axis of the drill


@dataclass(frozen=True, eq=False)
class DrilledHoles:
    """Deviation of holes over an area, and the position tolerance that they need."""

    case: SpatialCase
    diameter: float  # of the drill, m
    load: DrillingLoad
    loads: Loads
    errors: LoadUncertainty
    repeatability: float | None  # m; pose repeatability (ISO 9283); None: that of the robot's file, if it has one
    deviations: DeviationMap

    @property
    def wrench(self) -> Real:
        """Force and moment on the tool, (6,), N and N m."""
        return drilling_wrench(self.load, DOWN)

    @cached_property
    def weight(self) -> Real:
        """Part of the deviation under weight that counts, (n, 3), m; zeros where masses are unknown."""
        sags = self.deviations.weight
        if not self.case.robot.bodies or self.loads.weight == "none":
            return np.zeros_like(sags)
        without_rotation = np.hstack([sags, np.where(np.isnan(sags), np.nan, 0.0)])
        return counted_weight(without_rotation, self.loads.weight)[:, :3]

    def across(self, hole: int) -> tuple[float, float]:
        """Distance across the drill at entry, under weight alone, and under full thrust, m.

        The axis of the hole must lie in its zone along the whole depth, so weight and thrust may not cancel.
        """
        weight = self.weight[hole]
        entry, full = (
            float(np.linalg.norm(moved[:2])) for moved in (weight, weight + self.deviations.deviations[hole])
        )
        return entry, full

    @cached_property
    def tolerances(self) -> Real:
        """Position tolerance that each hole needs, (n,), m; NaN where it is not reached."""
        needed = np.full(len(self.deviations.reached), np.nan)
        for hole in map(int, np.flatnonzero(self.deviations.reached)):
            needed[hole] = position_tolerance(max(self.across(hole)), self.budget(hole).work)
        return needed

    @property
    def worst(self) -> int:
        """Number of the hole that needs the largest tolerance."""
        return int(np.nanargmax(self.tolerances))

    def budget(self, hole: int) -> UncertaintyBudget:
        """Uncertainty budget of the position of a hole across the drill."""
        q, repeatability = self.deviations.q[hole], self.repeatability or self.case.repeatability
        across = lateral_uncertainty(self.case.robot, q, self.wrench, self.errors, DOWN, self._sag_by_joint(hole))
        try:
            machining: float | None = measured_machining_uncertainty(self.diameter)
        except InputError:
            machining = None
        return UncertaintyBudget(repeatability, across, machining)

    def _sag_by_joint(self, hole: int) -> Real | None:
        """Return the contribution of each joint to the deflection under weight; None if weight does not count."""
        robot, payload = self.case.robot, self.loads.payload
        if not robot.bodies or self.loads.weight == "none":
            return None
        own = sag_parts(robot, self.deviations.q[hole], payload)
        if self.loads.weight == "all":
            return own
        first = int(np.argmax(self.deviations.reached))
        return np.asarray(own - sag_parts(robot, self.deviations.q[first], payload))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Parts of the budget of the worst hole that are not known, one sentence each."""
        warnings, unknown = [], self.budget(self.worst).unknown
        if not self.case.robot.bodies and self.loads.weight != "none":
            warnings.append(NO_MASSES)
        if "robot without load" in unknown:
            warnings.append(
                "the robot's file gives no repeatability_m (ISO 9283) and --repeatability MM is not given: "
                "unknown and left out, so tolerances are lower bounds"
            )
        if "machining" in unknown:
            warnings.append(
                f"the uncertainty of machining is known for drills of 8 to 12 mm, not {1e3 * self.diameter:g} mm: "
                "left out, so tolerances are lower bounds"
            )
        return tuple(warnings)


def say_runout(
    robot: SpatialRobot, drill: Drill, feed: float, deviations: DeviationMap, turning: tuple[float, float, float]
) -> None:
    """Print the lateral force of a drill with runout, its bending, and the widest orbit of the robot.

    ``feed`` is in m per revolution; ``turning`` holds runout (reading of an indicator) and overhang, m, and spindle
    speed, rad/s.
    """
    runout, overhang, speed = turning
    settled = _worst_direction(drill, feed, runout, overhang)
    force, parts = settled.force, process_deviation(settled, runout)
    say(
        f"runout of {1e6 * runout:g} um: up to {force.size:.1f} N across the drill turn at "
        f"{speed / (2 * np.pi):.1f} Hz and bend it by {1e6 * parts.bending:.1f} um (carbide, {1e3 * overhang:g} mm): "
        f"its tip runs {1e6 * parts.tip:.1f} um off its axis"
    )
    if not robot.bodies:
        say("the robot's file gives no masses: the orbit of the robot under this force is not known")
        return
    orbits = np.full(len(deviations.q), np.nan)
    for hole in np.flatnonzero(deviations.reached):
        orbits[hole] = orbit_radius(robot, deviations.q[hole], force.size, speed, tool_down((0.0, 0.0, 0.0)).axes)
    widest = int(np.nanargmax(orbits))
    x, y, _ = deviations.positions[widest]
    say(
        f"the robot follows by {1e6 * orbits[widest]:.1f} um at x = {x:.2f} m, y = {y:.2f} m: holes are wider by up to "
        f"{2e6 * (parts.tip + orbits[widest]):.0f} um; what turns with the spindle moves no hole's axis"
    )


def _worst_direction(drill: Drill, feed: float, runout: float, overhang: float) -> SettledDrill:
    """Return the drill with its runout in the direction of the largest force, since the true direction is unknown."""
    compliance, forces = 1 / bending_stiffness(drill, overhang), fitted_to_catalogue(drill)
    tried = (
        settled_drill(drill, feed, *forces, runout, compliance, direction=angle)
        for angle in np.linspace(0, np.pi, ROBOT_STEPS.runout_directions, endpoint=False)
    )
    return max(tried, key=lambda settled: settled.force.size)
