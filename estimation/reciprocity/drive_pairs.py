"""Points that are both excited and measured."""

from collections.abc import Sequence
from dataclasses import dataclass

from foundation import DegreeOfFreedom, InputError


@dataclass(frozen=True)
class SharedPoint:
    """A node and axis that stand among responses and excitations.

    Parameters
    ----------
    name
        Node and axis, ``node:axis``, without a sign.
    row, column
        Row of the response and column of the excitation.
    response_sign, excitation_sign
        Direction of either along the axis, +1 or -1.
    """

    name: str
    row: int
    column: int
    response_sign: float
    excitation_sign: float


def shared_points(responses: Sequence[str], excitations: Sequence[str]) -> tuple[SharedPoint, ...]:
    """Points in the order of the responses, each once; opposite directions are one axis, other names are left out.

    Examples
    --------
    >>> [point] = shared_points(["TCP:+X", "HOUSING:-Y"], ["HOUSING:+Y", "BASE:+Z"])
    >>> point.name, point.row, point.column, point.response_sign, point.excitation_sign
    ('HOUSING:Y', 1, 0, -1.0, 1.0)
    """
    columns: dict[str, tuple[int, float]] = {}
    for column, label in enumerate(excitations):
        axis = _axis(label)
        if axis is not None:
            columns.setdefault(axis[0], (column, axis[1]))
    found: dict[str, SharedPoint] = {}
    for row, label in enumerate(responses):
        axis = _axis(label)
        if axis is not None and axis[0] in columns:
            column, sign = columns[axis[0]]
            found.setdefault(axis[0], SharedPoint(axis[0], row, column, axis[1], sign))
    return tuple(found.values())


def _axis(label: str) -> tuple[str, float] | None:
    """``node:axis`` and sign; None for a label that is no direction."""
    try:
        dof = DegreeOfFreedom.parse(label)
    except InputError:
        return None
    return None if dof.axis == "S" else (f"{dof.node}:{dof.axis}", dof.sign)
