"""`millfrf robot learn`: modal models measured in some postures, for predictions in all."""

from pathlib import Path
from typing import Annotated

import typer

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
        float | None, typer.Option("--feed", metavar="DEG", help="Channel X from the base's x; Z up. Default: base.")
    ] = None,
) -> None:
    """Learn how measured modes differ from the robot's model over postures; `frf` takes it as --learned."""
    from ..learned import LearningFrom, learn_from_files

    learn_from_files(robot, models, LearningFrom(tuple(pose or ()), feed), out)
