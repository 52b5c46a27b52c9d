"""Roles of the columns of a table, where its headings leave no doubt."""

import re
from collections.abc import Mapping

from foundation import InputError

from .numbers import stated_frequency_unit
from .text_table import TextTable

_ROLES = {
    "frequency": r"freq\w*",
    "real": r"re|real\w*",
    "imaginary": r"im|imag\w*",
    "magnitude": r"mag\w*|amp\w*|abs|absolute|modulus|betrag",
    "phase": r"phase|phas|phs|arg|angle",
    "coherence": r"coh\w*|gamma2?",
}
_WAYS = (("real", "imaginary"), ("magnitude", "phase"))
_WORD = r"(?:^|[\s_.:,;|(\[-])(?:{})(?:$|[\s_.:,;|(\[)\]-])"


def column_roles(table: TextTable) -> dict[str, int]:
    """Find the column, counted from 1, of each part that is certain.

    Certain is a frequency that one heading names, and with it either a real and an imaginary part or a magnitude and a
    phase, each named once, with the coherence.

    Parameters
    ----------
    table
        Table of numbers with headings.
    """
    found: dict[str, list[int]] = {role: [] for role in _ROLES}
    for number, heading in enumerate(table.headings, 1):
        for role, words in _ROLES.items():
            if re.search(_WORD.format(words), heading, re.IGNORECASE):
                found[role].append(number)
    if not found["frequency"]:
        found["frequency"] = [k for k, unit in enumerate(table.units, 1) if stated_frequency_unit(unit) is not None]
    once = {role: places[0] for role, places in found.items() if len(places) == 1}
    for way in _WAYS:
        if all(len(found[role]) == 1 for role in ("frequency", *way)):
            kept = ("frequency", *way, "coherence")
            return {role: place for role, place in once.items() if role in kept}
    return {role: place for role, place in once.items() if role == "frequency"}


def column(table: TextTable, place: int | str, part: str) -> int:
    """A column's number, counted from 0, by its number from 1 or its heading.

    Raises
    ------
    InputError
        No such column, or a heading that several have.
    """
    if isinstance(place, int) and place <= len(table.headings):
        return place - 1
    same = [k for k, heading in enumerate(table.headings) if heading == place]
    if len(same) == 1:
        return same[0]
    raise InputError(f"{table.path}: {part} = {place!r} is no column of it; it has {described(table)}")


def described(table: TextTable) -> str:
    """Columns by number, heading and unit: ``1 Frequency (Hz), 2 Real``."""
    shown = []
    for number, (heading, unit) in enumerate(zip(table.headings, table.units, strict=True), 1):
        told = f"({unit})" if unit and unit not in heading else ""
        shown.append(" ".join(filter(None, (str(number), heading, told))))
    return ", ".join(shown)


def unit_of(table: TextTable, roles: Mapping[str, int | str]) -> str:
    """Unit of the FRF's column: of its complex values, its real part or its magnitude; empty where none is stated."""
    place = next((roles[part] for part in ("values", "real", "magnitude") if part in roles), None)
    return "" if place is None else table.units[column(table, place, "unit")]
