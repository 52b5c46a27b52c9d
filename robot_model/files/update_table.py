"""Table ``[update]`` of a robot's file: what `robot update` changed, and what it left open."""

import numpy as np
from numpy.typing import NDArray

from ..full_update import UpdateParameter, changed_by
from ..spatial import SpatialRobot
from ..uncertain_robot import RobotUncertainty
from .robot_files import Table


class Number(Table):
    """A number that was freed; one that is not ``in_file`` has no key of its own there and is applied on reading.

    Parameters
    ----------
    name
        Name of the number.
    kind
        What it is: ``stiffness``, ``joint damping``, ``damping``, ``links``, ``inertia``, ``body``, ``payload``,
        ``tool mass``, ``sprung mass``, ``tool`` or ``base``.
    unit
        Unit of spread, value and standard error; empty: they are natural logarithms of a factor on the file's number
        (stiffness, links, damping, inertia), or ratios.
    frame
        Joint of a stiffness or of a joint's damping.
    group
        Directions of that joint, such as its gear or its bearing; empty for the others.
    axis
        Direction of a payload's place, 0 to 2, and 3 for its mass; of a tool or base 0 or 1.
    spread
        Standard deviation of the belief before the measurements, in ``unit``.
    value
        Change that was found, in ``unit``; where this is empty, 0.1 is a factor of 1.105.
    standard_error
        Standard error of ``value``, in ``unit``.
    told
        Whether the measurements tell it.
    in_file
        Whether the file has a key of its own for it.
    """

    name: str
    kind: str
    unit: str = ""
    frame: str = ""
    group: str = ""
    axis: int = 0
    spread: float
    value: float
    standard_error: float = 0.0
    told: bool = True
    in_file: bool = True


class UpdateTable(Table):
    """Verdict, names, numbers and their covariance.

    Parameters
    ----------
    verdict
        Verdict of the update.
    named
        Numbers that are surely wrong in the file before.
    covariance
        Covariance of the numbers, row by row.
    numbers
        Numbers that were freed, ``[[update.numbers]]``.
    """

    verdict: str
    named: list[str]
    covariance: list[list[float]]
    numbers: list[Number]


def uncertainty_of(table: UpdateTable) -> RobotUncertainty:
    """Numbers and covariance of an ``[update]`` table.

    Raises
    ------
    InputError
        A covariance of another size, or none.
    """
    values = np.array([row.value for row in table.numbers])
    return RobotUncertainty(_parameters(table.numbers), values, np.array(table.covariance, ndmin=2))


def left_open(table: UpdateTable) -> tuple[str, ...]:
    """A sentence for joint stiffnesses that the measurements of an update did not tell; empty where there are none."""
    rows = [row.name.removesuffix(" stiffness") for row in table.numbers if row.kind == "stiffness" and not row.told]
    if not rows:
        return ()
    return (
        f"the update's measurements do not tell the stiffness of {', '.join(dict.fromkeys(rows))}: it is the file's "
        "own, and only as good as that",
    )


def with_late_numbers(robot: SpatialRobot, table: UpdateTable) -> SpatialRobot:
    """The robot with the numbers that its file has no key for: a payload, a tool, a base that gives way."""
    late = [row for row in table.numbers if not row.in_file]
    values: NDArray[np.float64] = np.array([row.value for row in late])
    return changed_by(robot, _parameters(late), values) if late else robot


def _parameters(rows: list[Number]) -> tuple[UpdateParameter, ...]:
    return tuple(UpdateParameter(r.name, r.kind, r.unit, r.spread, r.frame, r.group, r.axis) for r in rows)
