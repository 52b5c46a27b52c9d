"""`millfrf robot identify`: stiffnesses from measured deflections, written into the robot's file."""

from pathlib import Path
from typing import Annotated

import typer

from .options import Robot


def identify(
    robot: Robot,
    deflections: Annotated[
        Path, typer.Argument(metavar="DEFLECTIONS.csv", help="joint_1_deg ... fx_n fy_n fz_n dx_m dy_m dz_m.")
    ],
    out: Annotated[Path, typer.Option("--out", metavar="FILE.toml", help="The robot's file with the numbers found.")],
    error: Annotated[
        float, typer.Option("--error", metavar="UM", help="Standard error of a measured displacement, micrometres.")
    ],
    links: Annotated[
        bool, typer.Option("--links", help="Sections of flexible links too, not joint stiffnesses alone.")
    ] = False,
    prior: Annotated[
        float, typer.Option("--prior", metavar="FACTOR", help="How well the file's numbers are known: within a factor.")
    ] = 2.7,
) -> None:
    """Joint stiffnesses (and link sections) from deflections that a tracker measured, with errors and what is not told.

    A row is a posture, the change of force on the tool and the change of place that it caused, in the base frame.
    """
    from millfrf.steps.robot.identify import write_identified

    write_identified(robot, deflections, out, 1e-6 * error, links, prior)
