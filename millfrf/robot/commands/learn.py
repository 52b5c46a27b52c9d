"""`millfrf robot learn`: modal models measured in some postures, for predictions in all."""

from pathlib import Path
from typing import Annotated

import typer

from millfrf.core import InputError

from .options import Robot


def learn(
    robot: Robot,
    models: Annotated[
        list[Path], typer.Argument(metavar="MODEL.json...", help="Modal models at the tip, one a posture.")
    ],
    out: Annotated[Path, typer.Option("--out", metavar="POSTURES.json", help="What was learned.")],
    pose: Annotated[
        list[str] | None,
        typer.Option("--pose", metavar="POSE", help="Posture of each model in turn: a name, or DEG,DEG,..."),
    ] = None,
    feed: Annotated[
        float | None,
        typer.Option("--channels-turned", metavar="DEG", help="Channel X from the base's x; Z up. Default: base."),
    ] = None,
    next_postures: Annotated[
        int | None, typer.Option("--next", metavar="N", help="Say which N postures are most worth measuring next.")
    ] = None,
    x: Annotated[
        tuple[float, float, int] | None, typer.Option("--x", metavar="LO HI N", help="Area for --next, m.")
    ] = None,
    y: Annotated[tuple[float, float, int] | None, typer.Option("--y", metavar="LO HI N", help="m.")] = None,
    z: Annotated[float, typer.Option("--z", metavar="M", help="Height of the tool's tip there, m.")] = 0.8,
) -> None:
    """Learn how measured modes differ from the robot's model over postures; `frf` takes it as --learned."""
    from millfrf.steps.robot.learn import LearningFrom, WorkArea, learn_from_files

    if (x is None) != (y is None) or (x is not None and next_postures is None):
        raise InputError("an area of --next needs both --x LO HI N and --y LO HI N, and --next N")
    area = None if x is None or y is None else WorkArea(x, y, z)
    learn_from_files(robot, models, LearningFrom(tuple(pose or ()), feed, next_postures, area), out)
