"""Step ``robot deviation``: deviation of drilled holes over a work area."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError, Real, warning_lines, writing_whole_file
from millfrf.core.provenance import add_comment, origin
from millfrf.core.terminal import Table, say, show, tell
from millfrf.cutting import (
    Drill,
    DrillingLoad,
    SettledDrill,
    bending_stiffness,
    drilling_load,
    fitted_to_catalogue,
    settled_drill,
)
from millfrf.options import check_output
from millfrf.robot_model import (
    NO_MASSES,
    DeviationMap,
    LoadUncertainty,
    SpatialCase,
    SpatialRobot,
    UncertaintyBudget,
    counted_weight,
    deformation_uncertainty,
    deviation_map,
    drilling_wrench,
    lateral_uncertainty,
    measured_machining_uncertainty,
    monte_carlo_deformation,
    orbit_radius,
    position_tolerance,
    position_verdict,
    process_deviation,
    read_robot,
    sag_parts,
    tool_down,
)

from .common import say_doubts
from .postures import Loads, check_axis, check_places, check_positive, spatial

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


DOWN = np.array([0.0, 0.0, -1.0])
"""Axis of the drill."""

THINNEST = 1e-4
"""Thinnest drill that is taken, m."""


@dataclass(frozen=True)
class DrillingArea:
    """Drill diameter and feed per revolution, m; the area of holes, m; whether links give way too."""

    diameter: float
    feed: float
    x: tuple[float, float, int]
    y: tuple[float, float, int]
    z: float
    links: bool


@dataclass(frozen=True)
class Accuracy:
    """Accuracy of the robot as far as it is known, and the tolerance of the drawing.

    Parameters
    ----------
    repeatability
        Pose repeatability after ISO 9283, m; None: that of the robot's file, if it has one.
    allowed
        Position tolerance of the drawing (diameter of the zone), m; None: not asked.
    known
        Errors of forces and joint stiffness.
    """

    repeatability: float | None = None
    allowed: float | None = None
    known: LoadUncertainty = field(default_factory=LoadUncertainty)


@dataclass(frozen=True)
class _Holes:
    """Deviations of one area and what the position tolerance is made of."""

    case: SpatialCase
    area: DrillingArea
    accuracy: Accuracy
    loads: Loads
    found: DeviationMap
    load: DrillingLoad

    @property
    def wrench(self) -> Real:
        return drilling_wrench(self.load, DOWN)

    def weight(self) -> Real:
        """Part of the weight's deviation that counts, m, (n, 3); zeros where masses are unknown."""
        if not self.case.robot.bodies or self.loads.weight == "none":
            return np.zeros_like(self.found.weight)
        sags = np.hstack([self.found.weight, np.where(np.isnan(self.found.weight), np.nan, 0.0)])
        return counted_weight(sags, self.loads.weight)[:, :3]

    def budget(self, hole: int) -> UncertaintyBudget:
        """Give the budget of the position of one hole across the drill."""
        repeatability = self.accuracy.repeatability or self.case.repeatability
        known = self.accuracy.known
        across = lateral_uncertainty(self.case.robot, self.found.q[hole], self.wrench, known, DOWN, self._resting(hole))
        try:
            machining: float | None = measured_machining_uncertainty(self.area.diameter)
        except InputError:
            machining = None
        return UncertaintyBudget(repeatability, across, machining)

    def warnings(self, worst: int) -> list[str]:
        """List what is not known; one sentence each. ``worst``: the hole that needs the largest tolerance."""
        found, unknown = [], self.budget(worst).unknown
        if not self.case.robot.bodies and self.loads.weight != "none":
            found.append(NO_MASSES)
        if "robot without load" in unknown:
            found.append(
                "the robot's file gives no repeatability_m (ISO 9283) and --repeatability MM is not given: "
                "unknown and left out, so tolerances are lower bounds"
            )
        if "machining" in unknown:
            found.append(
                f"the uncertainty of machining is known for drills of 8 to 12 mm, not "
                f"{1e3 * self.area.diameter:g} mm: left out, so tolerances are lower bounds"
            )
        return found

    def _resting(self, hole: int) -> Real | None:
        robot, payload = self.case.robot, self.loads.payload
        if not robot.bodies or self.loads.weight == "none":
            return None
        own = sag_parts(robot, self.found.q[hole], payload)
        if self.loads.weight == "all":
            return own
        return np.asarray(own - sag_parts(robot, self.found.q[int(np.argmax(self.found.reached))], payload))


def show_deviation(
    robot: str,
    area: DrillingArea,
    out: Path | None,
    picture: Path | None,
    accuracy: Accuracy,
    loads: Loads,
    turning: RunningOut = RunningOut(),
) -> None:
    """Deviation under thrust and weight, the position tolerance that holes need; CSV and map where asked."""
    for path, suffixes in ((out, (".csv",)), (picture, (".png", ".pdf"))):
        if path is not None:
            check_output(path, suffixes)
    _check(area, accuracy)
    turning.check()
    case = spatial(read_robot(robot))
    say_doubts(case.assumed)
    drill = Drill(area.diameter)
    load = drilling_load(drill, area.feed, *fitted_to_catalogue(drill))
    places = [tool_down([x, y, area.z]) for x in np.linspace(*area.x) for y in np.linspace(*area.y)]
    found = deviation_map(case.robot, places, load, links=area.links, payload=loads.payload)
    if not found.reached.any():
        raise InputError("no hole of the area is reached; move --x, --y or --z")
    holes = _Holes(case, area, accuracy, loads, found, load)
    weight = holes.weight()
    say(f"thrust {load.thrust:.0f} N, torque {load.torque:.2f} N m")
    say(f"{found.reached.sum()} of {len(places)} holes reached; the branch changes at {found.switches.sum()}")
    _show_sizes("deviation under thrust", found.deviations)
    if case.robot.bodies:
        _show_sizes("deflection under weight", found.weight)
    show_running_out(case.robot, area.diameter, area.feed, found, turning)
    needed = np.full(len(places), np.nan)
    radial = np.maximum(*_radial(found.deviations, weight))
    for hole in np.flatnonzero(found.reached):
        needed[hole] = position_tolerance(float(radial[hole]), holes.budget(int(hole)).work)
    _show_position(holes, weight, needed)
    worst = int(np.nanargmax(needed))
    tell(lambda: _told(holes, needed, worst))
    warnings = holes.warnings(worst)
    for warning in warnings:
        say(f"warning: {warning}")
    if out is not None:
        with writing_whole_file(out) as unfinished:
            _write_deviations(unfinished, found, needed, warnings)
            add_comment(unfinished, origin("robot deviation", [robot], {"area": area, "accuracy": accuracy}))
        say(f"wrote {out}")
    if picture is not None:
        from .pictures import draw_deviation

        unknown = holes.budget(int(np.nanargmax(needed))).unknown
        draw_deviation(picture, found, (area.x[2], area.y[2]), needed, "at least " if unknown else "")
        say(f"wrote {picture}")


def _told(holes: _Holes, needed: Real, worst: int) -> dict[str, Any]:
    """Deviations and tolerances over the area, for a script."""
    found = holes.found
    return {
        "thrust_n": holes.load.thrust,
        "torque_n_m": holes.load.torque,
        "holes": len(found.reached),
        "holes_reached": found.reached.sum(),
        "largest_deviation_m": np.nanmax(np.linalg.norm(found.deviations, axis=1)),
        "largest_position_tolerance_m": needed[worst],
        "smallest_position_tolerance_m": np.nanmin(needed),
        "unknown": holes.budget(worst).unknown,
    }


def _radial(thrust: Real, weight: Real) -> tuple[Real, Real]:
    """Distance across the drill at entry (weight alone) and under full thrust, m, each (n,).

    The axis of the hole must lie in its zone along the whole depth, so weight and thrust may not cancel each other.
    """
    return np.linalg.norm(weight[:, :2], axis=1), np.linalg.norm((weight + thrust)[:, :2], axis=1)


def _check(area: DrillingArea, accuracy: Accuracy) -> None:
    check_positive("drill", 1e3 * area.diameter, "millimetres", 100)
    if area.diameter < THINNEST:
        raise InputError(f"--drill {1e3 * area.diameter:g}: give millimetres, {1e3 * THINNEST:g} or more")
    check_positive("feed-per-rev", 1e3 * area.feed, "millimetres", 5)
    check_axis("x", area.x)
    check_axis("y", area.y)
    check_places(z=area.z)
    if accuracy.repeatability is not None:
        check_positive("repeatability", 1e3 * accuracy.repeatability, "millimetres (ISO 9283)", 5)
    if accuracy.allowed is not None:
        check_positive("position-tolerance", 1e3 * accuracy.allowed, "millimetres", 50)


def _show_sizes(what: str, deviations: Real) -> None:
    sizes = 1e3 * np.linalg.norm(deviations, axis=1)
    say(f"{what}: mean {np.nanmean(sizes):.3f} mm, largest {np.nanmax(sizes):.3f} mm")


def _show_position(holes: _Holes, weight: Real, needed: Real) -> None:
    """Budget and position tolerance at the hole that needs the largest, and the verdict on the drawing's."""
    worst = int(np.nanargmax(needed))
    budget = holes.budget(worst)
    _show_budget(holes, worst, budget)
    thrust, resting = holes.found.deviations[worst], weight[worst]
    entry, full = (float(one[0]) for one in _radial(thrust[None], resting[None]))
    say(
        f"systematic there: {1e3 * max(entry, full):.3f} mm across the drill, the larger of entry (weight alone, "
        f"{1e3 * entry:.3f}) and full thrust ({1e3 * full:.3f}); along it (depth) "
        f"{1e3 * abs(resting[2]):.3f} mm at entry, {1e3 * abs(thrust[2] + resting[2]):.3f} mm under full thrust"
    )
    least = "at least " if budget.unknown else ""
    say(
        f"position tolerance needed (ISO 1101, diameter of the zone = 2 (systematic + U)): {least}"
        f"{1e3 * needed[worst]:.3f} mm there, {least}{1e3 * np.nanmin(needed):.3f} mm at the best hole; "
        "an IT grade of ISO 286 is of a size, not of a position"
    )
    if holes.accuracy.allowed is not None:
        allowed = holes.accuracy.allowed
        verdicts = [position_verdict(float(value), allowed, budget.unknown) for value in needed[~np.isnan(needed)]]
        counts = ", ".join(f"{word} at {verdicts.count(word)}" for word in ("holds", "does not hold", "cannot tell"))
        say(f"position tolerance of {1e3 * allowed:g} mm, {len(verdicts)} holes: {counts}")


def _show_budget(holes: _Holes, worst: int, budget: UncertaintyBudget) -> None:
    robot, q, known = holes.case.robot, holes.found.q[worst], holes.accuracy.known
    length = deformation_uncertainty(robot, q, holes.wrench, known)
    _, trial = monte_carlo_deformation(robot, q, holes.wrench, known, trials=400)
    assumed = " (assumed)" if known == LoadUncertainty() else ""
    errors = f"forces {100 * known.wrench:g} %, stiffness {100 * known.stiffness:g} %{assumed}"
    where = "--repeatability" if holes.accuracy.repeatability else "the robot's file"
    parts = (
        ("robot without load (ISO 9283)", budget.robot_position, where),
        ("deformation across the drill", budget.robot_deformation, errors),
        ("machining", budget.machining, "Ferreras-Higuero et al., their spindle"),
        ("hole position together", budget.work, "of what is known" if budget.unknown else "quadratic sum"),
        ("length of the deviation under thrust", length, "first order, beside it"),
        ("the same, 400 Monte Carlo trials", trial, "without linearisation"),
    )
    rows = tuple(
        (name, "unknown" if value is None else f"{1e6 * value:.1f}", "left out" if value is None else source)
        for name, value, source in parts
    )
    x, y, _ = holes.found.positions[worst]
    title = f"Expanded uncertainty at the worst hole, x = {x:.2f} m, y = {y:.2f} m"
    show(Table(title, ("part", "U, k = 2 (um)", "from"), rows))


def _write_deviations(out: Path, found: DeviationMap, needed: Real, warnings: Sequence[str]) -> None:
    with out.open("w", newline="", encoding="utf-8") as stream:
        stream.writelines(warning_lines(warnings))
        writer = csv.writer(stream)
        names = [f"{what}{axis}_m" for what in ("", "deviation_", "weight_") for axis in "xyz"]
        writer.writerow((*names, "position_tolerance_m", *(f"q{i + 1}_deg" for i in range(6))))
        rows = zip(found.positions, found.deviations, found.weight, needed, found.q, strict=True)
        for position, moved, sag, tolerance, q in rows:
            cells = (*position, *moved, *sag, tolerance, *np.degrees(q))
            writer.writerow(["" if np.isnan(cell) else f"{cell:.9g}" for cell in cells])
