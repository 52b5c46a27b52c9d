"""Step ``robot deviation``: deviation of drilled holes over a work area."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Gt, Le

from millfrf.core import InputError, Real, write_csv
from millfrf.core.provenance import origin
from millfrf.core.steps import Grid, Typed, step
from millfrf.core.terminal import Table, say, say_written, show, tell, warn
from millfrf.cutting import Drill, drilling_load, fitted_to_catalogue
from millfrf.figures import save_figure
from millfrf.robot_model import (
    LoadUncertainty,
    UncertaintyBudget,
    deformation_uncertainty,
    deviation_map,
    monte_carlo_deformation,
    position_verdict,
    read_robot,
    tool_down,
)

from ..given import Height, Kilograms, NearTip, Picture, Robot, Speed, TableFile, Weight
from ..settings import RPM
from .drilled_holes import DrilledHoles, say_runout
from .pictures import deviation_figure
from .postures import check_axis, loads_of, spatial


@step
def robot_deviation(
    robot: Robot,
    /,
    *,
    drill: Annotated[float, Typed("MM"), Ge(0.1), Le(100)] = 10.0,
    feed_per_rev: Annotated[float, Typed("MM"), Gt(0), Le(5)] = 0.2,
    x: Grid = (0.6, 1.4, 9),
    y: Grid = (-0.6, 0.6, 13),
    z: Height = 0.8,
    links: bool = False,
    payload: Kilograms = 0.0,
    payload_at: NearTip = None,
    weight: Weight = "all",
    repeatability: Annotated[float | None, Typed("MM"), Gt(0), Le(5)] = None,
    position_tolerance: Annotated[float | None, Typed("MM"), Gt(0), Le(50)] = None,
    force_uncertainty: Annotated[float, Typed("PERCENT"), Ge(0), Le(100)] = 5.0,
    stiffness_uncertainty: Annotated[float, Typed("PERCENT"), Ge(0), Le(100)] = 10.0,
    runout: Annotated[float | None, Typed("UM"), Gt(0), Le(1000)] = None,
    overhang: Annotated[float | None, Typed("MM"), Gt(0), Le(1000)] = None,
    speed: Speed | None = None,
    out: TableFile = None,
    picture: Picture = None,
) -> DrilledHoles:
    """Deviation of drilled holes over a work area (vertical drill, aluminium), and the position tolerance for it.

    Parameters
    ----------
    robot
        Robot file (.toml), or a name that `robot list` shows.
    drill : mm
        Diameter of the drill.
    feed_per_rev : mm
        Feed per revolution.
    x : m
        Lowest and highest x of the holes, and their number.
    y : m
        Lowest and highest y of the holes, and their number.
    z : m
        Height of the holes.
    links
        Include the flexibility of links and bearings, not of joints alone.
    payload : kg
        Mass that the robot carries besides the bodies of its file.
    payload_at : m
        Centre of mass of the payload from the tip, in the tool frame; without it the tip.
    weight
        Deflection under weight that counts: all; its change from the first place, where the work was touched off; none.
    repeatability : mm
        Pose repeatability (ISO 9283); without it that of the robot's file.
    position_tolerance : mm
        Position tolerance of the drawing (ISO 1101) to compare with.
    force_uncertainty : %
        Standard error of the drilling forces; the default is an assumption.
    stiffness_uncertainty : %
        Standard error of the joint stiffnesses; the default is an assumption.
    runout : um
        Runout of the drill's tip, as an indicator reads it at rest, for the widening of the holes.
    overhang : mm
        Length of the drill out of its holder, with --runout.
    speed : rpm
        Spindle speed, with --runout.
    out
        Table of all holes to write.
    picture
        Map of deviation and position tolerance to write.

    Returns
    -------
    DrilledHoles
        Deviations, position tolerances, uncertainty budgets and warnings.

    Raises
    ------
    InputError
        An area without a place that the robot reaches, or a runout without overhang and speed.

    Examples
    --------
    ::

        $ millfrf robot deviation kuka_kr90_r3100 --drill 8 --z 0.7 --out holes.csv
    """
    turning = {"runout": runout, "overhang": overhang, "speed": speed}
    missing = [f"--{name}" for name, value in turning.items() if value is None]
    if 0 < len(missing) < len(turning):
        raise InputError(f"a drill that runs out of true: give {', '.join(missing)} too")
    check_axis("x", x)
    check_axis("y", y)
    loads = loads_of(payload, payload_at, weight)
    errors = LoadUncertainty(1e-2 * force_uncertainty, 1e-2 * stiffness_uncertainty)
    case = spatial(read_robot(robot))
    warn(case.assumed)
    tool, feed = Drill(1e-3 * drill), 1e-3 * feed_per_rev
    load = drilling_load(tool, feed, *fitted_to_catalogue(tool))
    places = [tool_down([across, along, z]) for across in np.linspace(*x) for along in np.linspace(*y)]
    deviations = deviation_map(case.robot, places, load, links=links, payload=loads.payload)
    if not deviations.reached.any():
        raise InputError("no hole of the area is reached; move --x, --y or --z")
    known = None if repeatability is None else 1e-3 * repeatability
    holes = DrilledHoles(case, tool.diameter, load, loads, errors, known, deviations)
    _say_deviations(holes)
    if runout is not None and overhang is not None and speed is not None:
        say_runout(case.robot, tool, feed, deviations, (1e-6 * runout, 1e-3 * overhang, speed * RPM))
    _say_tolerances(holes, None if position_tolerance is None else 1e-3 * position_tolerance)
    tell(lambda: _numbers(holes))
    warn(holes.warnings)
    if out is not None:
        options = {"drill_mm": drill, "feed_per_rev_mm": feed_per_rev, "x_m": x, "y_m": y, "z_m": z, "links": links}
        options |= {"loads": loads, "repeatability_mm": repeatability, "errors": errors}
        _write_deviations(Path(out), holes, origin("robot deviation", [robot], options))
        say_written([out])
    if picture is not None:
        least = "at least " if holes.budget(holes.worst).unknown else ""
        save_figure(deviation_figure(deviations, (x[2], y[2]), holes.tolerances, least), picture)
        say_written([picture])
    return holes


def _numbers(holes: DrilledHoles) -> dict[str, Any]:
    """Return deviations and tolerances over the area for JSON."""
    deviations, needed = holes.deviations, holes.tolerances
    return {
        "thrust_n": holes.load.thrust,
        "torque_n_m": holes.load.torque,
        "holes": len(deviations.reached),
        "holes_reached": deviations.reached.sum(),
        "largest_deviation_m": np.nanmax(np.linalg.norm(deviations.deviations, axis=1)),
        "largest_position_tolerance_m": needed[holes.worst],
        "smallest_position_tolerance_m": np.nanmin(needed),
        "unknown": holes.budget(holes.worst).unknown,
    }


def _say_deviations(holes: DrilledHoles) -> None:
    """Print the loads, the number of places that are reached, and the sizes of the deviations."""
    deviations = holes.deviations
    say(f"thrust {holes.load.thrust:.0f} N, torque {holes.load.torque:.2f} N m")
    say(
        f"{deviations.reached.sum()} of {len(deviations.reached)} holes reached; the branch changes at "
        f"{deviations.switches.sum()}"
    )
    _say_sizes("deviation under thrust", deviations.deviations)
    if holes.case.robot.bodies:
        _say_sizes("deflection under weight", deviations.weight)


def _say_sizes(what: str, deviations: Real) -> None:
    sizes = 1e3 * np.linalg.norm(deviations, axis=1)
    say(f"{what}: mean {np.nanmean(sizes):.3f} mm, largest {np.nanmax(sizes):.3f} mm")


def _say_tolerances(holes: DrilledHoles, allowed: float | None) -> None:
    """Print budget and tolerance of the worst hole, and how many holes hold the drawing's tolerance (m)."""
    worst, needed = holes.worst, holes.tolerances
    budget = holes.budget(worst)
    show(_budget_table(holes, worst, budget))
    entry, full = holes.across(worst)
    resting, thrust = holes.weight[worst][2], holes.deviations.deviations[worst][2]
    say(
        f"systematic there: {1e3 * max(entry, full):.3f} mm across the drill, the larger of entry (weight alone, "
        f"{1e3 * entry:.3f}) and full thrust ({1e3 * full:.3f}); along it (depth) "
        f"{1e3 * abs(resting):.3f} mm at entry, {1e3 * abs(thrust + resting):.3f} mm under full thrust"
    )
    least = "at least " if budget.unknown else ""
    say(
        f"position tolerance needed (ISO 1101, diameter of the zone = 2 (systematic + U)): {least}"
        f"{1e3 * needed[worst]:.3f} mm there, {least}{1e3 * np.nanmin(needed):.3f} mm at the best hole; "
        "an IT grade of ISO 286 is of a size, not of a position"
    )
    if allowed is not None:
        verdicts = [position_verdict(float(value), allowed, budget.unknown) for value in needed[~np.isnan(needed)]]
        counts = ", ".join(f"{word} at {verdicts.count(word)}" for word in ("holds", "does not hold", "cannot tell"))
        say(f"position tolerance of {1e3 * allowed:g} mm, {len(verdicts)} holes: {counts}")


def _budget_table(holes: DrilledHoles, worst: int, budget: UncertaintyBudget) -> Table:
    robot, q, errors = holes.case.robot, holes.deviations.q[worst], holes.errors
    length = deformation_uncertainty(robot, q, holes.wrench, errors)
    _, trial = monte_carlo_deformation(robot, q, holes.wrench, errors, trials=400)
    assumed = " (assumed)" if errors == LoadUncertainty() else ""
    parts = (
        (
            "robot without load (ISO 9283)",
            budget.robot_position,
            "--repeatability" if holes.repeatability else "the robot's file",
        ),
        (
            "deformation across the drill",
            budget.robot_deformation,
            f"forces {100 * errors.wrench:g} %, stiffness {100 * errors.stiffness:g} %{assumed}",
        ),
        ("machining", budget.machining, "Ferreras-Higuero et al., their spindle"),
        ("hole position together", budget.work, "of what is known" if budget.unknown else "quadratic sum"),
        ("length of the deviation under thrust", length, "first order, not in the sum"),
        ("the same, 400 Monte Carlo trials", trial, "without linearisation"),
    )
    rows = tuple(
        (name, "unknown" if value is None else f"{1e6 * value:.1f}", "left out" if value is None else source)
        for name, value, source in parts
    )
    x, y, _ = holes.deviations.positions[worst]
    title = f"Expanded uncertainty at the worst hole, x = {x:.2f} m, y = {y:.2f} m"
    return Table(title, ("part", "U, k = 2 (um)", "from"), rows)


def _write_deviations(path: Path, holes: DrilledHoles, provenance: Mapping[str, Any]) -> None:
    deviations = holes.deviations
    names = [f"{what}{axis}_m" for what in ("", "deviation_", "weight_") for axis in "xyz"]
    columns = (*names, "position_tolerance_m", *(f"q{i + 1}_deg" for i in range(6)))
    values = np.column_stack(
        (deviations.positions, deviations.deviations, deviations.weight, holes.tolerances, np.degrees(deviations.q))
    )
    write_csv(path, columns, values, warnings=holes.warnings, provenance=provenance)
