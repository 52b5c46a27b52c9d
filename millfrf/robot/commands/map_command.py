"""`millfrf robot map`: lowest frequency and depth limit over an area."""

from pathlib import Path
from typing import Annotated

import typer

from .options import Feed, Robot, Speed


def map_command(
    robot: Robot,
    picture: Annotated[Path | None, typer.Option("--picture", metavar="FILE", help="Map over the area.")] = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE.csv", help="Frequency, limit, status, joints of every place.")
    ] = None,
    x: Annotated[tuple[float, float, int], typer.Option("--x", metavar="LO HI N", help="Area, m.")] = (0.5, 1.4, 19),
    y: Annotated[tuple[float, float, int], typer.Option("--y", metavar="LO HI N", help="m.")] = (-0.7, 0.7, 29),
    z: Annotated[float, typer.Option("--z", metavar="M", help="Height of the tool's tip, m.")] = 0.8,
    feed: Feed = 0.0,
    cutting: Annotated[
        Path | None, typer.Option("--cutting", metavar="CUT.toml", help="Depth limits too, at one spindle speed.")
    ] = None,
    speed: Speed = None,
    max_depth: Annotated[float, typer.Option("--max-depth", metavar="M", help="Largest depth looked at, m.")] = 0.02,
) -> None:
    """Lowest natural frequency of a vertical tool over an area, and with --cutting the depth limit."""
    from millfrf.steps.robot.maps import Area, write_workspace_map

    write_workspace_map(robot, picture, Area(x, y, z, feed), cutting, speed, max_depth, out)
