"""`millfrf robot list`: the robots that come along, and what they assume."""

from typing import Annotated

import typer

from millfrf.core.terminal import say, tell


def list_robots(
    robot: Annotated[str | None, typer.Argument(metavar="[ROBOT]", help="Show what this one assumes.")] = None,
) -> None:
    """Robots that come along; with a name, every number in it that is assumed, and why."""
    from millfrf.robot_model import assumptions, named_posture, read_robot, robot_names

    if robot is None:
        tell(lambda: {"robots": [{"name": name, "assumed": assumptions(name)} for name in robot_names()]})
        for name in robot_names():
            say(f"{name}: {len(assumptions(name))} assumed tables")
        return
    case = read_robot(robot)
    driven = len(named_posture(case, None))
    tell(lambda: {"postures": tuple(case.poses), "driven_joints": driven, "assumed": assumptions(robot)})
    say(f"postures: {', '.join(case.poses) or 'none'}; {driven} driven joints")
    for line in assumptions(robot):
        say(line)
