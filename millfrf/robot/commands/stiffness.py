"""`millfrf robot stiffness`: compliance and deflection in a posture."""

from pathlib import Path
from typing import Annotated

import typer

from .options import At, Feed, Joints, Links, Numbers, PayloadAt, PayloadMass, Picture, Pose, Redundancy, Robot, Turn


def stiffness(
    robot: Robot,
    pose: Pose = None,
    joints: Joints = None,
    at: At = None,
    feed: Feed = 0.0,
    turn: Turn = 0.0,
    redundancy: Redundancy = "tool",
    links: Links = False,
    tip_force: Annotated[
        float, typer.Option("--tip-force", metavar="N", help="Force at the tip to deflect it with.")
    ] = 650.0,
    payload: PayloadMass = 0.0,
    payload_at: PayloadAt = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE.json", help="The same as numbers, with the warnings.")
    ] = None,
    picture: Picture = None,
    table: Numbers = None,
) -> None:
    """Compliance at the tool tip, softest and stiffest directions, deflection under a force, weight and payload."""
    from millfrf.steps.robot.postures import Asked, loads_of
    from millfrf.steps.robot.stiffness import show_stiffness

    asked = Asked(pose, joints, at, feed, turn, redundancy)
    show_stiffness(robot, asked, tip_force, loads_of(payload, payload_at), links, out, (picture, table))
