"""`guessed_channel`: what a column's heading and unit say of it; what they do not say is left open."""

import re
from collections.abc import Mapping

from foundation import SI_UNITS, InputError, si_factor

_UNIT = re.compile(r"^(?P<name>.*?)[\s_]*[\[(](?P<unit>[^\[\]()]+)[\])]\s*$")
_AXIS = re.compile(r"(?:^|[^a-z])?([xyz])(?:[^a-z]|$)|([xyz])$", re.IGNORECASE)
_PLACE = re.compile("tip|tcp|housing|spindle", re.IGNORECASE)
_STEMS: Mapping[str, tuple[str, ...]] = {
    "force": ("hammer", "force", "kraft", "load", "f"),
    "acceleration": ("acceleration", "beschleunigung", "accel", "acc", "a"),
    "velocity": ("velocity", "geschwindigkeit", "vel", "v"),
    "displacement": ("displacement", "weg", "disp", "d", "s"),
    "moment": ("moment", "torque", "m"),
}
"""Beginnings of names by quantity, longest first; a single letter counts only with an axis or number behind it."""

_AFTER_WORD, _AFTER_FORCE, _AFTER_LETTER = r"[\s_.-]*[xyz]?[\s_.-]*\d*", r"[ _]?(?:[xyz]\d*|\d+)", r"_?[xyz]\d*"
"""What may follow such a beginning: ``acc x 1``; ``f1``, ``fx``; ``dx``."""

_TRIED = ("force", "acceleration", "velocity", "displacement", "moment", "voltage", "angular_velocity", "angle")


def split_heading(heading: str) -> tuple[str, str]:
    """Name and unit of a heading such as ``Fx [kN]`` or ``acc (g)``; without brackets the unit is empty.

    Examples
    --------
    >>> split_heading("Fx [kN]"), split_heading("ax")
    (('Fx', 'kN'), ('ax', ''))
    """
    found = _UNIT.match(heading.strip())
    return (found["name"].strip(), found["unit"].strip()) if found else (heading.strip(), "")


def guessed_channel(heading: str, unit: str = "") -> dict[str, str]:
    """Keys of a mapping's channel that heading and unit tell: name, and where they are told quantity, unit, place.

    A unit tells the quantity; without one the name does, and the unit stays open.

    Examples
    --------
    >>> guessed_channel("Fx", "kN")
    {'name': 'Fx', 'quantity': 'force', 'unit': 'kN', 'node': 'TCP', 'direction': '+X'}
    >>> guessed_channel("channel 3")
    {'name': 'channel 3'}
    """
    name, bracketed = split_heading(heading)
    unit = unit or bracketed
    quantity = _of_unit(name, unit) if unit else _of_name(name)
    found = {"name": name or heading.strip()}
    if quantity:
        found["quantity"] = quantity
        if unit:
            found["unit"] = unit
    axis, stated = _AXIS.search(name), _PLACE.search(name)
    if axis and (stated or quantity in ("force", "moment", "acceleration", "velocity", "displacement")):
        at_tip = quantity in ("force", "moment") if stated is None else stated[0].lower() in ("tip", "tcp")
        found["node"] = "TCP" if at_tip else "HOUSING"
        found["direction"] = f"+{(axis[1] or axis[2]).upper()}"
    return found


def _of_unit(name: str, unit: str) -> str:
    """The quantity of which this is a unit; the one that the name says where several could be."""
    fitting = [quantity for quantity in _TRIED if _is_unit(quantity, unit)]
    named = _of_name(name)
    return named if named in fitting else fitting[0] if len(fitting) == 1 else ""


def _is_unit(quantity: str, unit: str) -> bool:
    try:
        si_factor(quantity, unit)
    except InputError:
        return False
    return True


def _of_name(name: str) -> str:
    plain = name.strip().lower()
    for quantity, stems in _STEMS.items():
        for stem in stems:
            ending = _AFTER_WORD if len(stem) > 1 else _AFTER_FORCE if stem in "fa" else _AFTER_LETTER
            if plain.startswith(stem) and re.fullmatch(ending, plain.removeprefix(stem)):
                return quantity
    return "" if plain not in SI_UNITS else plain
