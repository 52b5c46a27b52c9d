"""Step ``robot list``: the robots that come with the program."""

from typing import Annotated

from millfrf.core.steps import File, Reads, step
from millfrf.core.terminal import say, tell
from millfrf.robot_model import assumptions, named_posture, read_robot, robot_names


@step
def list_robots(robot: Annotated[File | None, Reads("[ROBOT]", str)] = None, /) -> dict[str, tuple[str, ...]]:
    """List the robots that come with the program; with a name, every assumed number of that robot and its reason.

    Parameters
    ----------
    robot
        Robot file (.toml), or a name of this list, whose assumptions are shown.

    Returns
    -------
    dict of tuple of str
        Assumptions by the robot's name.

    Raises
    ------
    InputError
        No such robot.

    Examples
    --------
    ::

        $ millfrf robot list kuka_kr90_r3100
    """
    names = robot_names() if robot is None else (str(robot),)
    assumed = {name: tuple(assumptions(name)) for name in names}
    if robot is None:
        tell(lambda: {"robots": [{"name": name, "assumed": lines} for name, lines in assumed.items()]})
        for name, lines in assumed.items():
            say(f"{name}: {len(lines)} assumed tables")
        return assumed
    case = read_robot(robot)
    driven = len(named_posture(case, None))
    tell(lambda: {"postures": tuple(case.poses), "driven_joints": driven, "assumed": assumed[str(robot)]})
    say(f"postures: {', '.join(case.poses) or 'none'}; {driven} driven joints")
    for line in assumed[str(robot)]:
        say(line)
    return assumed
