"""Units are converted where data enters; inside, everything is SI."""

import re
from functools import cache
from tokenize import TokenError
from typing import TYPE_CHECKING

from .errors import InputError

if TYPE_CHECKING:
    import pint

SI_UNITS = {
    "force": "N",
    "acceleration": "m/s^2",
    "velocity": "m/s",
    "displacement": "m",
    "moment": "N m",
    "angle": "rad",
    "angular_velocity": "rad/s",
    "voltage": "V",
    "temperature": "K",
    "dimensionless": "1",
}
"""Quantities a channel may have, with the unit each is kept in."""

_LETTERS = re.compile(r"[\w\s.*/^()+-]+")
"""What units are written with; pint reads other texts by Python's rules, quotation marks and all."""

_UNREADABLE = (AttributeError, ValueError, AssertionError, TypeError, ArithmeticError, SyntaxError, TokenError)
"""What pint raises besides its own, since it reads units with Python's tokenizer and calculates with them."""

_SPOKEN = {"g": "standard_gravity", "g0": "standard_gravity", "gn": "standard_gravity", "1": "", "rpm": "rpm"}


@cache
def _registry() -> "pint.UnitRegistry[float]":
    import pint

    return pint.UnitRegistry()


def si_factor(quantity: str, unit: str) -> float:
    """Return the factor that takes a value in ``unit`` to the SI unit of ``quantity``.

    Parameters
    ----------
    quantity
        Name of the quantity, one of :data:`SI_UNITS`.
    unit
        Unit as a lab writes it: ``N``, ``kN``, ``m/s^2``, ``mm/s**2``, ``g`` (standard gravity when the quantity is an
        acceleration), ``um``, ``mV`` ...

    Raises
    ------
    InputError
        Unknown quantity, unknown unit, a unit of another dimension, or one with an offset (degC).

    Examples
    --------
    >>> si_factor("force", "kN")
    1000.0
    >>> round(si_factor("acceleration", "g"), 5)
    9.80665
    """
    if quantity not in SI_UNITS:
        raise InputError(f"unknown quantity {quantity!r}; use one of {', '.join(SI_UNITS)}")
    target = SI_UNITS[quantity]
    if unit == target:
        return 1.0
    import pint

    spoken = _SPOKEN.get(unit, unit) if quantity in ("acceleration", "dimensionless", "angular_velocity") else unit
    try:
        registry = _registry()
        return float(registry.Quantity(1.0, spoken).to(_SPOKEN.get(target, target)).magnitude)
    except (pint.PintError, *_UNREADABLE) as error:
        raise InputError(f"unit {unit!r} is not a unit of {quantity}; use {target} or one convertible to it") from error


def unit_factor(unit: str, target: str) -> float | None:
    """Return the factor that takes a value in ``unit`` to ``target``; None where ``unit`` is no such unit.

    Parameters
    ----------
    unit
        Unit to convert from, such as one read from a file; unlike in :func:`si_factor`, ``g`` is gram here.
    target
        A unit that is known to be one, such as ``m/s^2/N``.

    Examples
    --------
    >>> unit_factor("mm/kN", "m/N"), unit_factor("mm/kN", "m/s/N"), unit_factor("dB!", "m/N")
    (1e-06, None, None)
    """
    if not _LETTERS.fullmatch(unit):
        return None
    import pint

    try:
        found = _registry().Quantity(1.0, unit)
        return float(found.to(target).magnitude) if found.is_compatible_with(target) else None
    except (pint.PintError, *_UNREADABLE):
        return None
