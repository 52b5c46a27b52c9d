"""`millfrf robot diagnose`: what is wrong with a robot's model."""

from pathlib import Path
from typing import Annotated

import typer

from millfrf.core.terminal import say, tell

from ...options import FigureFormat, Figures, check_shares


def diagnose(
    robot: Annotated[str, typer.Argument(metavar="ROBOT", help="A robot file (.toml), or a name.")],
    recordings: Annotated[list[Path], typer.Argument(metavar="REC...", help="Recordings, best in several postures.")],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for robot_diagnosis.json and report.html.")],
    pose: Annotated[
        list[str] | None,
        typer.Option("--pose", metavar="POSE", help="Posture of each recording in turn: a name, or DEG,DEG,..."),
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
    payload_at: Annotated[
        tuple[float, float, float] | None,
        typer.Option("--payload-at", metavar="X Y Z", help="Place of a payload, m from the tip, tool frame; else any."),
    ] = None,
    rigid_links: Annotated[
        bool, typer.Option("--rigid-links", help="Question the model with rigid links: is their flexibility missing?")
    ] = False,
    model_error: Annotated[
        tuple[float, float, float],
        typer.Option("--model-error", help="What a right model is still off: frequency, damping, shapes, as shares."),
    ] = (0.01, 0.15, 0.05),
    stream: Annotated[str | None, typer.Option("--stream", help="Sample clock.")] = None,
    figures: Figures = None,
    figure_format: FigureFormat = "svg",
) -> None:
    """Which is wrong in a robot's model: joint stiffness, link flexibility, payload, tool, posture, damping?"""
    from millfrf.mismatch import LabError
    from millfrf.report.results_page import asked_figures
    from millfrf.steps.answers import stored_answer
    from millfrf.steps.robot.diagnose import Asking, diagnose_robot_files

    check_shares("--model-error", model_error, (0.01, 0.15, 0.05))
    asking = Asking(tuple(pose or ()), feed, band, sensor, payload_at, rigid_links, LabError(*model_error), stream)
    drawn = asked_figures(figures, figure_format)
    for line in diagnose_robot_files(robot, recordings, out, asking, figures=drawn):
        say(line)
    tell(lambda: {"diagnosis": stored_answer(out / "robot_diagnosis.json")})
