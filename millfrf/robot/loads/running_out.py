"""A drill that runs out of true, on the command line: its transverse force, what bends, and how far the hole widens."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError
from millfrf.cutting import Drill, SettledDrill, bending_stiffness, fitted_to_catalogue, settled_drill
from millfrf.robot_model import DeviationMap, SpatialRobot, orbit_radius, process_deviation, tool_down

from ...terminal import say
from ..asked_loads import check_positive

LONGEST = 1.0
"""Longest drill that is taken, m."""

DIRECTIONS = 12
"""Directions of the runout against the edges that are tried."""


@dataclass(frozen=True)
class RunningOut:
    """Runout (m, indicator reading), overhang of the drill (m) and spindle speed (rad/s), as far as they were given."""

    runout: float | None = None
    overhang: float | None = None
    speed: float | None = None

    def check(self) -> None:
        """Refuse numbers that no drill has, and a runout without the rest.

        Raises
        ------
        InputError
            With the option and the remedy.
        """
        given = {"runout": self.runout, "overhang": self.overhang, "speed": self.speed}
        if all(value is None for value in given.values()):
            return
        missing = [f"--{name}" for name, value in given.items() if value is None]
        if missing:
            raise InputError(f"a drill that runs out of true: give {', '.join(missing)} too")
        check_positive("runout", 1e6 * (self.runout or 0.0), "micrometres", 1000)
        check_positive("overhang", 1e3 * (self.overhang or 0.0), "millimetres", 1e3 * LONGEST)
        check_positive("speed", (self.speed or 0.0) * 30 / np.pi, "rpm", 1e5)


def show_running_out(robot: SpatialRobot, diameter: float, feed: float, found: DeviationMap, asked: RunningOut) -> None:
    """Print the transverse force, the drill's bending and the robot's orbit where it is widest."""
    if asked.runout is None or asked.overhang is None or asked.speed is None:
        return
    settled = _worst(Drill(diameter), feed, asked.runout, asked.overhang)
    force, parts = settled.force, process_deviation(settled, asked.runout)
    say(
        f"runout of {1e6 * asked.runout:g} um: up to {force.size:.1f} N across the drill turn at "
        f"{asked.speed / (2 * np.pi):.1f} Hz and bend it by {1e6 * parts.bending:.1f} um (carbide, "
        f"{1e3 * asked.overhang:g} mm): its tip runs {1e6 * parts.tip:.1f} um off its axis"
    )
    if not robot.bodies:
        say("the robot's file gives no masses: how far the robot follows this force cannot be told")
        return
    orbits = _orbits(robot, found, force.size, asked.speed)
    widest = int(np.nanargmax(orbits))
    x, y, _ = found.positions[widest]
    say(
        f"the robot follows by {1e6 * orbits[widest]:.1f} um at x = {x:.2f} m, y = {y:.2f} m: holes are wider by up to "
        f"{2e6 * (parts.tip + orbits[widest]):.0f} um; what turns with the spindle moves no hole's axis"
    )


def _worst(drill: Drill, feed: float, runout: float, overhang: float) -> SettledDrill:
    """The drill settled with its runout in the direction, unknown here, that carries the largest force."""
    compliance, forces = 1 / bending_stiffness(drill, overhang), fitted_to_catalogue(drill)
    tried = (
        settled_drill(drill, feed, *forces, runout, compliance, direction=angle)
        for angle in np.linspace(0, np.pi, DIRECTIONS, endpoint=False)
    )
    return max(tried, key=lambda settled: settled.force.size)


def _orbits(robot: SpatialRobot, found: DeviationMap, force: float, speed: float) -> NDArray[np.float64]:
    axes = tool_down((0.0, 0.0, 0.0)).axes
    orbits = np.full(len(found.q), np.nan)
    for hole in np.flatnonzero(found.reached):
        orbits[hole] = orbit_radius(robot, found.q[hole], force, speed, axes)
    return orbits
