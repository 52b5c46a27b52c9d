"""`millfrf robot update`: a robot's file brought to what was measured, all its numbers together."""

from pathlib import Path
from typing import Annotated

import typer

from millfrf.core.terminal import say


def update(
    robot: Annotated[str, typer.Argument(metavar="ROBOT", help="A robot file (.toml), or a name.")],
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="Recordings, FRFs (.h5, .uff) or modal models (.json).")
    ],
    out: Annotated[Path, typer.Option("--out", metavar="UPDATED.toml", help="The updated robot file.")],
    pose: Annotated[
        list[str] | None,
        typer.Option("--pose", metavar="POSE", help="Posture of each file in turn: a name, or DEG,DEG,..."),
    ] = None,
    report: Annotated[
        Path | None, typer.Option("--report", metavar="FILE.json", help="All numbers, errors and directions.")
    ] = None,
    feed: Annotated[
        float | None,
        typer.Option("--channels-turned", metavar="DEG", help="Channel X from the base's x; Z up. Default: base."),
    ] = None,
    band: Annotated[
        tuple[float, float] | None, typer.Option("--band", metavar="LO HI", help="Hz; default: about the first modes.")
    ] = None,
    sensor: Annotated[
        tuple[float, float, float] | None,
        typer.Option("--sensor-at", metavar="X Y Z", help="Housing sensor, m from the tip in the channels' axes."),
    ] = None,
    stream: Annotated[str | None, typer.Option("--stream", help="Sample clock of recordings.")] = None,
) -> None:
    """Fit all of a robot's numbers to measurements, say which are wrong, and write the updated file.

    Joint stiffnesses and dampings, links, payload and tool mass, compliance of tool, tip and base are free together.
    The file is written only if the updated robot predicts postures better that were left out of its update.
    """
    from millfrf.steps.robot.update import Asking, update_robot_file

    asking = Asking(tuple(pose or ()), feed, band, sensor, stream)
    for line in update_robot_file(robot, files, out, report, asking):
        say(line)
