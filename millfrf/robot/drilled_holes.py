"""`millfrf robot deviation`: deviation of drilled holes over a work area, and its uncertainty budget."""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import typer

from cutting import Drill, drilling_load, fitted_to_catalogue
from foundation import InputError, writing_whole_file
from robot_model import (
    DeviationMap,
    LoadUncertainty,
    UncertaintyBudget,
    deformation_uncertainty,
    deviation_map,
    drilling_wrench,
    measured_machining_uncertainty,
    monte_carlo_deformation,
    read_robot,
    tolerance_grade,
    tool_down,
)
from robot_model.uncertainty_budget import ROBOT_REPEATABILITY

from ..commands.options import check_output
from ..tables import Table, show
from .postures import spatial


@dataclass(frozen=True)
class DrillingArea:
    """Drill diameter and feed per revolution, m; the area of holes, m; whether links give way too."""

    diameter: float
    feed: float
    x: tuple[float, float, int]
    y: tuple[float, float, int]
    z: float
    links: bool


def show_deviation(robot: str, area: DrillingArea, out: Path | None, picture: Path | None) -> None:
    """Largest and mean deviation over the area, budget at the worst hole, CSV and map where asked."""
    for path, suffixes in ((out, (".csv",)), (picture, (".png", ".pdf"))):
        if path is not None:
            check_output(path, suffixes)
    case = spatial(read_robot(robot))
    drill = Drill(area.diameter)
    load = drilling_load(drill, area.feed, *fitted_to_catalogue(drill))
    places = [tool_down([x, y, area.z]) for x in np.linspace(*area.x) for y in np.linspace(*area.y)]
    found = deviation_map(case.robot, places, load, links=area.links)
    if not found.reached.any():
        raise InputError("no hole of the area is reached; move --x, --y or --z")
    sizes = np.linalg.norm(found.deviations, axis=1)
    worst = int(np.nanargmax(sizes))
    typer.echo(f"thrust {load.thrust:.0f} N, torque {load.torque:.2f} N m")
    typer.echo(f"{found.reached.sum()} of {len(places)} holes reached; the branch changes at {found.switches.sum()}")
    typer.echo(f"deviation: mean {1e3 * np.nanmean(sizes):.3f} mm, largest {1e3 * sizes[worst]:.3f} mm")
    _show_budget(robot, area, found, worst)
    if out is not None:
        _write_deviations(out, found)
        typer.echo(f"wrote {out}")
    if picture is not None:
        from .picture import draw_deviation

        draw_deviation(picture, found, (area.x[2], area.y[2]))
        typer.echo(f"wrote {picture}")


def _show_budget(robot: str, area: DrillingArea, found: DeviationMap, worst: int) -> None:
    case = spatial(read_robot(robot))
    drill = Drill(area.diameter)
    wrench = drilling_wrench(drilling_load(drill, area.feed, *fitted_to_catalogue(drill)), np.array([0.0, 0.0, -1.0]))
    try:
        machining = measured_machining_uncertainty(area.diameter)
    except InputError as error:
        typer.echo(f"no uncertainty budget: {error}")
        return
    deformation = deformation_uncertainty(case.robot, found.q[worst], wrench, LoadUncertainty())
    _, trial = monte_carlo_deformation(case.robot, found.q[worst], wrench, LoadUncertainty(), trials=400)
    budget = UncertaintyBudget(ROBOT_REPEATABILITY, deformation, machining)
    parts = (
        ("robot without load", budget.robot_position),
        ("deformation under load", budget.robot_deformation),
        ("the same, 400 Monte Carlo trials", trial),
        ("machining", budget.machining),
        ("hole position", budget.work),
    )
    rows = tuple((name, f"{1e6 * value:.1f}", _grade(2 * value, area.diameter)) for name, value in parts)
    title = "Expanded uncertainty at the worst hole (forces 5 %, joint stiffness 10 %: assumed)"
    show(Table(title, ("part", "U, k = 2 (um)", "2 U fits in"), rows))


def _grade(width: float, diameter: float) -> str:
    grade = tolerance_grade(width, diameter)
    return f"IT{grade}" if grade <= 16 else "none"


def _write_deviations(out: Path, found: DeviationMap) -> None:
    with writing_whole_file(out) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        names = ("x_m", "y_m", "z_m", "deviation_x_m", "deviation_y_m", "deviation_z_m")
        writer.writerow((*names, *(f"q{i + 1}_deg" for i in range(6))))
        for position, moved, q in zip(found.positions, found.deviations, found.q, strict=True):
            cells = (*position, *moved, *np.degrees(q))
            writer.writerow(["" if np.isnan(cell) else f"{cell:.9g}" for cell in cells])
