"""`millfrf robot lobes`: depth limit in a posture or over a redundancy angle."""

from pathlib import Path
from typing import Annotated

import typer

from millfrf.core import InputError

from .options import At, Feed, Joints, Learned, Links, Pose, Redundancy, Robot, Speed, Turn


def lobes(
    robot: Robot,
    cutting: Annotated[Path, typer.Option("--cutting", metavar="CUT.toml", help="Cutter, engagement, coefficients.")],
    max_depth: Annotated[float, typer.Option("--max-depth", metavar="M", help="Largest depth looked at, m.")],
    out: Annotated[Path, typer.Option("--out", metavar="FILE.csv", help="Lobes, or with --turns a posture map.")],
    at: At = None,
    pose: Pose = None,
    joints: Joints = None,
    feed: Feed = 0.0,
    turn: Turn = 0.0,
    redundancy: Redundancy = "table",
    links: Links = False,
    speeds: Annotated[
        tuple[float, float, int] | None, typer.Option("--speeds", metavar="LO HI N", help="Spindle speeds, rpm.")
    ] = None,
    angles: Annotated[
        tuple[float, float, int] | None, typer.Option("--turns", metavar="LO HI N", help="Redundancy angles, degrees.")
    ] = None,
    speed: Speed = None,
    method: Annotated[str, typer.Option("--method", help="Solver of the lobes, as `millfrf lobes`.")] = "certified",
    picture: Annotated[
        Path | None, typer.Option("--picture", metavar="FILE", help="Picture of the lobes or the posture map.")
    ] = None,
    depth: Annotated[
        float | None, typer.Option("--depth", metavar="M", help="Cut to mark in the picture of a posture map, m.")
    ] = None,
    learned: Learned = None,
) -> None:
    """Stability lobes in a posture (--speeds), or the depth limit over a redundancy angle (--turns and --speed)."""
    from millfrf.steps.robot.lobes import write_lobes_in_posture, write_map_over_redundancy
    from millfrf.steps.robot.postures import Asked

    asked = Asked(pose, joints, at, feed, turn, redundancy)
    if learned is not None:
        from millfrf.steps.robot.learned import write_learned_lobes

        if angles is not None or links:
            raise InputError("--learned gives lobes in one posture: leave --turns and --links out")
        write_learned_lobes(robot, learned, asked, (cutting, speeds, max_depth, method), out, picture)
    elif angles is not None:
        write_map_over_redundancy(robot, asked, cutting, angles, speed, max_depth, out, (picture, depth))
    else:
        write_lobes_in_posture(robot, asked, cutting, speeds, max_depth, method, out, picture, links)
