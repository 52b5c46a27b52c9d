"""`millfrf robot show`: a robot in a posture, in the browser."""

from pathlib import Path
from typing import Annotated

import typer

from millfrf.core.terminal import say

from .options import At, Feed, Joints, Pose, Redundancy, Robot, Turn


def show(
    robot: Robot,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE.html", help="Page to write; default: robot.html, or robot-2.html..."),
    ] = None,
    pose: Pose = None,
    joints: Joints = None,
    at: At = None,
    feed: Feed = 0.0,
    turn: Turn = 0.0,
    redundancy: Redundancy = "tool",
    browser: Annotated[bool, typer.Option("--browser", help="Open the page in the browser.")] = False,
) -> None:
    """A page with the robot, its joints, its posture and its mode shapes: one file, no network."""
    from millfrf.core import free_name
    from millfrf.steps.robot.postures import Asked
    from millfrf.steps.robot.robot_page import show_robot

    for line in show_robot(
        robot, Asked(pose, joints, at, feed, turn, redundancy), out or free_name(Path("robot.html")), browser
    ):
        say(line)
