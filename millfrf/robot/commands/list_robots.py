"""`millfrf robot list`: the robots that come along, and what they assume."""

from typing import Annotated

import typer

from ...terminal import say


def list_robots(
    robot: Annotated[str | None, typer.Argument(metavar="[ROBOT]", help="Show what this one assumes.")] = None,
) -> None:
    """Robots that come along; with a name, every number in it that is assumed, and why."""
    from robot_model import assumptions, named_posture, read_robot, robot_names

    if robot is None:
        for name in robot_names():
            say(f"{name}: {len(assumptions(name))} assumed tables")
        return
    case = read_robot(robot)
    say(f"postures: {', '.join(case.poses) or 'none'}; {len(named_posture(case, None))} driven joints")
    for line in assumptions(robot):
        say(line)
