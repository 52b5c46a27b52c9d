"""`millfrf robot frf`: receptance at the tool tip in a posture."""

from pathlib import Path
from typing import Annotated

import typer

from millfrf.core import InputError

from .options import At, Feed, Joints, Learned, Links, Numbers, Picture, Pose, Redundancy, Robot, Turn


def frf(
    robot: Robot,
    out: Annotated[
        Path, typer.Option("--out", metavar="FILE", help=".h5: FRF; .json: modal model; .csv: band (--learned).")
    ],
    pose: Pose = None,
    joints: Joints = None,
    at: At = None,
    feed: Feed = 0.0,
    turn: Turn = 0.0,
    redundancy: Redundancy = "tool",
    links: Links = False,
    band: Annotated[tuple[float, float], typer.Option("--band", metavar="LO HI", help="Hz.")] = (1.0, 100.0),
    lines: Annotated[int, typer.Option("--lines", help="Frequency lines.")] = 1000,
    sensor: Annotated[
        tuple[float, float, float] | None,
        typer.Option("--sensor-at", metavar="X Y Z", help="Housing sensor, m from the tip: its motion too (.json)."),
    ] = None,
    learned: Learned = None,
    picture: Picture = None,
    table: Numbers = None,
) -> None:
    """Receptance at the tool tip in a posture, as an FRF file or as the modal model behind it."""
    from millfrf.steps.robot.postures import Asked

    asked = Asked(pose, joints, at, feed, turn, redundancy)
    if learned is not None:
        from millfrf.steps.robot.learned import write_learned_receptance

        if sensor is not None or links or picture is not None or table is not None:
            raise InputError(
                "--sensor-at, --links, --picture and --table have no place beside --learned, which knows the tip of "
                "robots in space"
            )
        write_learned_receptance(robot, learned, asked, out, band, lines)
        return
    from millfrf.steps.robot.common import write_receptance

    write_receptance(robot, asked, out, band, lines, sensor, links, (picture, table))
