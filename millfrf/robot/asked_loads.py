"""Loads and errors of a robot's statics as a user types them, as checked numbers."""

from dataclasses import dataclass

import numpy as np

from millfrf.core import InputError
from millfrf.robot_model import Payload

FURTHEST = 20.0
"""Largest coordinate of a place that is taken, m."""


@dataclass(frozen=True)
class Loads:
    """Payload, and the part of the weight's deflection that counts: ``all``, ``change`` or ``none``."""

    payload: Payload
    weight: str = "all"


def loads_of(payload: float, at: tuple[float, float, float] | None, weight: str = "all") -> Loads:
    """Options ``--payload KG``, ``--payload-at X Y Z`` and ``--weight``.

    Raises
    ------
    InputError
        A place without a mass, or numbers that no payload has.
    """
    if at is not None and not payload:
        raise InputError("--payload-at says where a payload is: give its mass too, --payload KG")
    return Loads(Payload(payload, (0.0, 0.0, 0.0) if at is None else at), weight)


def check_places(**coordinates: float) -> None:
    """Refuse coordinates that are no numbers, or that look like millimetres.

    Raises
    ------
    InputError
        With the option, the value and the remedy.
    """
    for name, value in coordinates.items():
        if not abs(value) <= FURTHEST:
            raise InputError(f"--{name} {value:g}: give metres from the robot's base, at most {FURTHEST:g}")


def check_axis(name: str, axis: tuple[float, float, int]) -> None:
    """Refuse an area's axis ``LO HI N`` that is empty, falls, or looks like millimetres.

    Raises
    ------
    InputError
        With the option, the values and the remedy.
    """
    low, high, count = axis
    for value in (low, high):
        check_places(**{name: value})
    if low > high or not 1 <= count <= 1000:
        raise InputError(f"--{name} {low:g} {high:g} {count}: give LO HI N with LO <= HI and 1 to 1000 places")


def check_near(name: str, place: tuple[float, float, float]) -> None:
    """Refuse a place at the tool that is no number, or that looks like millimetres.

    Raises
    ------
    InputError
        With the option, the values and the remedy.
    """
    if not all(abs(value) <= 5 for value in place):
        raise InputError(f"--{name} {' '.join(f'{v:g}' for v in place)}: give metres from the tool tip, at most 5")


def check_degrees(**angles: float) -> None:
    """Refuse angles that are no numbers or more than three turns.

    Raises
    ------
    InputError
        With the option, the value and the remedy.
    """
    for name, value in angles.items():
        if not abs(value) <= 1080:
            raise InputError(f"--{name} {value:g}: give degrees, at most 1080")


def check_positive(name: str, value: float, unit: str, most: float) -> None:
    """Refuse a number that is not positive, not finite or beyond what the option can mean.

    Raises
    ------
    InputError
        With the option, the value and the remedy.
    """
    if not (np.isfinite(value) and 0 < value <= most):
        raise InputError(f"--{name} {value:g}: give {unit}, above 0 and at most {most:g}")
