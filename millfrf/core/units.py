"""Conversion of units where data enters; everything else works in SI units."""

import re
import sys
from functools import cache
from tokenize import TokenError
from typing import TYPE_CHECKING, Any

from .errors import InputError

if TYPE_CHECKING:
    import pint


PLACED = ("force", "moment", "acceleration", "velocity", "displacement")
"""Quantities that an FRF has, if the point and direction of their sensor are known."""

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
"""Quantities a channel may have, with their SI units."""

_LETTERS = re.compile(r"[\w\s.*/^()+-]+")
"""Characters of units; pint would evaluate other texts by Python's rules."""

_UNREADABLE = (AttributeError, ValueError, AssertionError, TypeError, ArithmeticError, SyntaxError, TokenError)
"""Errors that pint raises in addition to its own: it reads units with Python's tokenizer and evaluates them."""

_ALIASES = {
    "acceleration": {
        "g": "standard_gravity",
        "G": "standard_gravity",
        "g0": "standard_gravity",
        "gn": "standard_gravity",
    },
    "dimensionless": {"1": ""},
    "angular_velocity": {"rev/min": "rpm", "U/min": "rpm"},
    "moment": {"Nm": "N m", "kNm": "kN m", "Nmm": "N mm"},
}
"""Units as laboratories write them, by quantity."""

_TURNS = ("radian", "degree", "revolution", "turn", "revolutions_per_minute", "arcminute", "arcsecond", "grade")
"""Parts of the names of units of angle; `1/min`, `Hz` and `count` do not state the angle."""


@cache
def _registry() -> "pint.UnitRegistry[float]":
    import pint

    return pint.UnitRegistry()


SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}
"""Units of times, in seconds."""

_TIME_SPELLINGS = {"µs": "us", "μs": "us", "sec": "s", "secs": "s", "second": "s", "seconds": "s", "msec": "ms"} | {
    "milliseconds": "ms",
    "microseconds": "us",
    "usec": "us",
    "sekunden": "s",
}


def time_unit(text: str) -> str | None:
    """Read a unit of time in any of its spellings; None for another text.

    Examples
    --------
    >>> time_unit("[ms]"), time_unit("Seconds"), time_unit("V")
    ('ms', 's', None)
    """
    plain = text.strip(" []()").lower()
    plain = _TIME_SPELLINGS.get(plain, plain)
    return plain if plain in SECONDS else None


def plain_unit(unit: str) -> str:
    """Write a unit of a file as the unit library spells it.

    Examples
    --------
    >>> plain_unit("m/s²"), plain_unit("m/s2"), plain_unit("Newton"), plain_unit("Volts"), plain_unit("µm")
    ('m/s^2', 'm/s^2', 'newton', 'volts', 'um')
    """
    for spelling, replacement in (("²", "^2"), ("·", "*"), ("⋅", "*"), ("µ", "u"), ("μ", "u")):
        unit = unit.replace(spelling, replacement)
    unit = re.sub(r"(?<![a-zA-Z])(s|sec)\^?2(?![0-9])", "s^2", unit)
    return re.sub(r"[A-Z][a-z]{3,}", lambda word: word[0].lower(), unit)


def si_factor(quantity: str, unit: str) -> float:
    """Return the factor that converts a value in ``unit`` to the SI unit of ``quantity``.

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
        Unknown quantity, unknown unit, a unit of another dimension, one with an offset (degC), or one of an angle that
        leaves the angle open (1/min, Hz, counts).

    Examples
    --------
    >>> si_factor("force", "kN"), si_factor("moment", "Nm")
    (1000.0, 1.0)
    >>> round(si_factor("acceleration", "g"), 5)
    9.80665
    """
    if quantity not in SI_UNITS:
        raise InputError(f"unknown quantity {quantity!r}; use one of {', '.join(SI_UNITS)}")
    target = SI_UNITS[quantity]
    if unit == target:
        return 1.0
    import pint

    aliases = _ALIASES.get(quantity, {})
    try:
        quantity_in_unit = _registry().Quantity(1.0, aliases.get(unit, aliases.get(plain_unit(unit), plain_unit(unit))))
        factor = float(quantity_in_unit.to(aliases.get(target, target)).magnitude)
    except (pint.PintError, *_UNREADABLE) as error:
        raise InputError(f"unit {unit!r} is not a unit of {quantity}; use {target} or one convertible to it") from error
    if quantity in ("angle", "angular_velocity") and not _has_turn(quantity_in_unit):
        remedy = "rpm for 1/min, or turn/s for Hz" if quantity == "angular_velocity" else "rad, deg or turn"
        raise InputError(f"unit {unit!r} does not say how large an angle one of it is; write {remedy}")
    return factor


def unit_factor(unit: str, target: str) -> float | None:
    """Return the factor that converts a value in ``unit`` to ``target``; None if ``unit`` measures another quantity.

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
        one_unit = _registry().Quantity(1.0, unit)
        return float(one_unit.to(target).magnitude) if one_unit.is_compatible_with(target) else None
    except (pint.PintError, *_UNREADABLE):
        return None


def without_unit(value: Any, unit: str) -> Any:
    """Convert a quantity of pint, or a list with quantities, to numbers in ``unit``; return other values unchanged.

    Parameters
    ----------
    value
        What a user gave.
    unit
        Unit of the result; empty: the value has none.

    Raises
    ------
    InputError
        A quantity with a unit that is not converted to ``unit``: a unit of an angle is not one of a frequency.

    Examples
    --------
    >>> import pint
    >>> units = pint.UnitRegistry()
    >>> without_unit((0.5 * units.kHz, 60), "Hz"), without_unit(12.0, "mm")
    ((500.0, 60), 12.0)
    """
    pint = sys.modules.get("pint")  # a quantity exists only where pint has been imported
    if pint is None:
        return value
    if isinstance(value, list | tuple):
        return tuple(without_unit(part, unit) for part in value)
    if not isinstance(value, pint.Quantity):
        return value
    try:
        converted = value.to(unit or "dimensionless")
    except (pint.PintError, *_UNREADABLE):
        converted = None
    if converted is None or _has_turn(converted) != _has_turn(value):
        remedy = f"give it in {unit}, or in a unit that is converted to {unit}" if unit else "give a plain number"
        raise InputError(f"{value}: {remedy}")
    return converted.magnitude


def _has_turn(quantity: "pint.Quantity[float]") -> bool:
    return any(turn in str(quantity.units) for turn in _TURNS)


_OTHER_UNITS = ("", "-", "NaN", "nan", "n/a", "Hz", "A", "mA", "°C", "degC", "1/min", "pC", "bar")
"""Units, and marks of a missing unit, of quantities that no channel has."""


def is_unit(cell: str) -> bool:
    """Return whether a text is a unit or a mark of a missing unit."""
    return cell in _OTHER_UNITS or time_unit(cell) is not None or any(_fits(quantity, cell) for quantity in SI_UNITS)


def quantities_of(unit: str) -> tuple[str, ...]:
    """Return the quantities of which a text is a unit.

    Examples
    --------
    >>> quantities_of("kN"), quantities_of("g"), quantities_of("furlong^3")
    (('force',), ('acceleration',), ())
    """
    return tuple(quantity for quantity in SI_UNITS if _fits(quantity, unit))


def _fits(quantity: str, cell: str) -> bool:
    try:
        si_factor(quantity, cell)
    except InputError:
        return False
    return True
