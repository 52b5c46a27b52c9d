"""`millfrf robot modes`: natural frequencies and mode shapes in a posture."""

from pathlib import Path
from typing import Annotated

import typer

from .options import At, Feed, Joints, Links, Pose, Redundancy, Robot, Turn


def modes(
    robot: Robot,
    pose: Pose = None,
    joints: Joints = None,
    at: At = None,
    feed: Feed = 0.0,
    turn: Turn = 0.0,
    redundancy: Redundancy = "tool",
    links: Links = False,
    count: Annotated[int, typer.Option("--modes", help="Modes to show.")] = 10,
    picture: Annotated[
        Path | None, typer.Option("--picture", metavar="FILE", help=".png or .pdf, or .html: a page to turn and play.")
    ] = None,
) -> None:
    """Natural frequencies and damping in a posture, and a picture of the robot and its mode shapes."""
    from millfrf.steps.robot.common import show_modes
    from millfrf.steps.robot.postures import Asked

    show_modes(robot, Asked(pose, joints, at, feed, turn, redundancy), count, picture, links)
