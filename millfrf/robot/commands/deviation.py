"""`millfrf robot deviation`: deviation of drilled holes over a work area."""

from pathlib import Path
from typing import Annotated

import typer

from .options import PayloadAt, PayloadMass, Robot, Weight


def deviation(
    robot: Robot,
    drill: Annotated[float, typer.Option("--drill", metavar="MM", help="Diameter of the drill.")] = 10.0,
    feed_rev: Annotated[float, typer.Option("--feed-per-rev", metavar="MM", help="Feed a revolution.")] = 0.2,
    x: Annotated[tuple[float, float, int], typer.Option("--x", metavar="LO HI N", help="Area, m.")] = (
        0.6,
        1.4,
        9,
    ),
    y: Annotated[tuple[float, float, int], typer.Option("--y", metavar="LO HI N", help="m.")] = (-0.6, 0.6, 13),
    z: Annotated[float, typer.Option("--z", metavar="M", help="Height of the holes, m.")] = 0.8,
    links: Annotated[bool, typer.Option("--links", help="Flexible links and bearings too, not joints alone.")] = False,
    payload: PayloadMass = 0.0,
    payload_at: PayloadAt = None,
    weight: Weight = "all",
    repeatability: Annotated[
        float | None,
        typer.Option("--repeatability", metavar="MM", help="Pose repeatability, ISO 9283; default: the file's."),
    ] = None,
    position_tolerance: Annotated[
        float | None,
        typer.Option("--position-tolerance", metavar="MM", help="Of the drawing (ISO 1101): does it hold?"),
    ] = None,
    force_error: Annotated[
        float,
        typer.Option("--force-uncertainty", metavar="PERCENT", help="Standard error of the forces; 5 is assumed."),
    ] = 5.0,
    stiffness_error: Annotated[
        float, typer.Option("--stiffness-uncertainty", metavar="PERCENT", help="Of joint stiffnesses; 10 is assumed.")
    ] = 10.0,
    runout: Annotated[
        float | None,
        typer.Option("--runout", metavar="UM", help="Reading at the drill's tip, at rest: how holes widen."),
    ] = None,
    overhang: Annotated[
        float | None, typer.Option("--overhang", metavar="MM", help="Drill out of its holder, with --runout.")
    ] = None,
    spindle_speed: Annotated[float | None, typer.Option("--speed", metavar="RPM", help="With --runout.")] = None,
    out: Annotated[Path | None, typer.Option("--out", metavar="FILE.csv", help="Deviation of every hole.")] = None,
    picture: Annotated[Path | None, typer.Option("--picture", metavar="FILE", help="Map of the deviation.")] = None,
) -> None:
    """Deviation of drilled holes over a work area (vertical drill, aluminium), and the position tolerance they need."""
    from math import pi

    from millfrf.robot_model import LoadUncertainty
    from millfrf.steps.robot.deviation import Accuracy, DrillingArea, RunningOut, show_deviation
    from millfrf.steps.robot.postures import loads_of

    area = DrillingArea(1e-3 * drill, 1e-3 * feed_rev, x, y, z, links)
    known = LoadUncertainty(1e-2 * force_error, 1e-2 * stiffness_error)
    in_metres = [None if value is None else 1e-3 * value for value in (repeatability, position_tolerance)]
    accuracy = Accuracy(in_metres[0], in_metres[1], known)
    turning = RunningOut(
        None if runout is None else 1e-6 * runout,
        None if overhang is None else 1e-3 * overhang,
        None if spindle_speed is None else spindle_speed * pi / 30,
    )
    show_deviation(robot, area, out, picture, accuracy, loads_of(payload, payload_at, weight), turning)
