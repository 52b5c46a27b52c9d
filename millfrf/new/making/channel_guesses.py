"""`guessed_channel`: what a column's heading and unit say of it; what they leave open is asked."""

import re
from collections.abc import Mapping
from typing import Any

from millfrf.core import SI_UNITS, InputError, si_factor

from .questions import Question

_UNIT = re.compile(r"^(?P<name>.*?)[\s_]*[\[(](?P<unit>[^\[\]()]+)[\])]\s*$")
_PLACES = {"tip": "TCP", "tcp": "TCP", "housing": "HOUSING", "spindle": "HOUSING"}
_TURNED = ("neg", "negative", "minus", "inv", "inverted")
_STEMS: Mapping[str, tuple[str, ...]] = {
    "force": ("hammer", "force", "kraft", "f"),
    "acceleration": ("acceleration", "beschleunigung", "accel", "acc", "a"),
    "velocity": ("velocity", "geschwindigkeit", "vel", "v"),
    "displacement": ("displacement", "weg", "disp", "d", "s"),
    "moment": ("moment", "torque", "m"),
}
"""Beginnings of names by quantity, longest first. A single letter counts only with an axis behind it: A1 may be a
joint, a1 an input, f1 a frequency."""

_AFTER_WORD, _AFTER_LETTER = r"[\s_.-]*[xyz]?[\s_.-]*\d*", r"[ _]?[xyz]\d*"
"""What may follow such a beginning: ``acc x 1``; ``fx``, ``fx1``."""

_TRIED = ("force", "acceleration", "velocity", "displacement", "moment", "voltage", "angular_velocity", "angle")
_PLACED = ("force", "moment", "acceleration", "velocity", "displacement")
_AXIS_ASKED = Question("along which axis does it count positive, such as +X, and at which node; else no FRF has it")
_COUNTS = "; its values are whole numbers: of a converter's counts give sensitivity (counts per unit) and offset too"


def split_heading(heading: str) -> tuple[str, str]:
    """Name and unit of a heading such as ``Fx [kN]``, ``acc (g)`` or ``Fx / kN``; where it has none the unit is empty.

    Examples
    --------
    >>> split_heading("Fx [kN]"), split_heading("Fx / kN"), split_heading("ax")
    (('Fx', 'kN'), ('Fx', 'kN'), ('ax', ''))
    """
    found = _UNIT.match(heading.strip())
    if found:
        return found["name"].strip(), found["unit"].strip()
    name, slash, unit = heading.partition("/")
    if slash and (unit.strip() in ("s", "ms", "us", "µs") or any(_is_unit(one, unit.strip()) for one in _TRIED)):
        return name.strip(), unit.strip()
    return heading.strip(), ""


def guessed_channel(heading: str, unit: str = "", *, whole: bool = False) -> dict[str, Any]:
    """Keys of a mapping's channel that heading and unit tell, and a question for each that they leave open.

    A unit tells the quantity; without one the name does, and the unit is asked. Where name and unit contradict each
    other both are asked.

    Parameters
    ----------
    heading
        Heading of the column, or name of the array.
    unit
        Unit that stands elsewhere, such as in a row below; empty: none.
    whole
        Whether all values are whole numbers, as a converter counts them.

    Examples
    --------
    >>> guessed_channel("Fx", "kN")
    {'name': 'Fx', 'quantity': 'force', 'unit': 'kN', 'node': 'TCP', 'direction': '+X'}
    >>> guessed_channel("Fx", "g")["unit"].text
    'the name says force, g is a unit of acceleration: which is it'
    """
    name, bracketed = split_heading(heading)
    unit = unit or bracketed
    quantity, asked = _quantity(name, unit)
    found: dict[str, Any] = {"name": name or heading.strip() or "channel"}
    found["quantity"] = quantity or Question(asked or "what does it measure")
    if unit and not asked:
        found["unit"] = unit
    else:
        found["unit"] = Question((asked or "in which unit are its values") + (_COUNTS if whole else ""))
    return found | _place(name, quantity)


def _quantity(name: str, unit: str) -> tuple[str, str]:
    """Quantity, empty where it is open; and what is asked of quantity and unit, empty where they agree."""
    named = _of_name(name)
    if not unit:
        return named, ""
    fitting = [quantity for quantity in _TRIED if _is_unit(quantity, unit)]
    if named in fitting or (not named and len(fitting) == 1):
        return named or fitting[0], ""
    if not fitting:
        hint = ", if it turns so: rpm" if unit in ("1/min", "min-1", "min^-1", "/min") else ""
        return named, f"the file says {unit}, which is no unit that is known here{hint}: how is it written"
    if not named:
        return "", f"{unit} is a unit of {' or '.join(fitting)}: which is it"
    if unit.endswith("V"):
        return "", f"the name says {named}, the values are in {unit}: give {named}, its unit and sensitivity"
    return "", f"the name says {named}, {unit} is a unit of {' or '.join(fitting)}: which is it"


def _place(name: str, quantity: str) -> dict[str, Any]:
    """Node and direction that the name tells; a direction whose sign is in doubt is asked."""
    words = [word.lower() for word in re.split(r"[^A-Za-z]+", name) if word]
    axes = {axis for word in words if (axis := _axis(word))}
    places = {_PLACES[word] for word in words if word in _PLACES}
    if len(axes) != 1 or len(places) > 1 or not (places or quantity in _PLACED):
        return {"direction": _AXIS_ASKED} if quantity in _PLACED else {}
    axis = axes.pop()
    node = places.pop() if places else "TCP" if quantity in ("force", "moment") else "HOUSING"
    if re.search(rf"-\w*{axis}(?![A-Za-z])", name, re.IGNORECASE) or any(word in _TURNED for word in words):
        return {"node": node, "direction": Question(f"does it count positive along +{axis} or -{axis}", '"?"')}
    return {"node": node, "direction": f"+{axis}"}


def _axis(word: str) -> str:
    """The axis that a word of a name is, or ends on behind a quantity: ``x``, ``fx``, ``accx``."""
    stems = [stem for group in _STEMS.values() for stem in group]
    return word[-1].upper() if word[-1] in "xyz" and (word[:-1] in stems or len(word) == 1) else ""


def _is_unit(quantity: str, unit: str) -> bool:
    try:
        si_factor(quantity, unit)
    except InputError:
        return False
    return True


def _of_name(name: str) -> str:
    plain = re.sub(r"^(?:tip|tcp|housing|spindle)[\s_.-]+", "", name.strip().lower())
    for quantity, stems in _STEMS.items():
        for stem in stems:
            ending = _AFTER_WORD if len(stem) > 1 else _AFTER_LETTER
            if plain.startswith(stem) and re.fullmatch(ending, plain.removeprefix(stem)):
                return quantity
    return "" if plain not in SI_UNITS else plain
