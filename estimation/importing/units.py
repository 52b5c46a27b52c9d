"""What an FRF is and how its numbers become SI, read from its unit as laboratories and analysers write it."""

import re
from dataclasses import dataclass

from foundation import InputError, unit_factor

SI = {"receptance": "m/N", "mobility": "m/s/N", "accelerance": "m/s^2/N"}
"""FRF quantities whose unit is fixed, and that unit."""

_INVERSE = {"dynamic stiffness": "N/m", "impedance": "N s/m", "apparent mass": "N s^2/m"}
_GRAVITY = re.compile(r"(?<![\w.])(?:g|gn|g0|G)(?![\w.])")
_SIGNS = (
    ("²", "^2"),
    ("\N{REPLACEMENT CHARACTER}", "^2"),  # a superscript in an old code page, which readers of text cannot tell
    ("·", "*"),
    ("⋅", "*"),
    ("µ", "u"),
    ("μ", "u"),
    ("[", "("),
    ("]", ")"),
)


@dataclass(frozen=True)
class FrfUnit:
    """What a unit says of an FRF.

    Parameters
    ----------
    quantity
        ``receptance``, ``mobility`` or ``accelerance``.
    factor
        Takes a number in the unit to SI: to m/N, m/s/N or m/s^2/N.
    """

    quantity: str
    factor: float


def frf_unit(text: str) -> FrfUnit:
    """Quantity and factor of an FRF's unit; ``g`` is standard gravity, for no FRF has grams.

    Parameters
    ----------
    text
        ``m/s^2/N``, ``g/N``, ``(m/s²)/(N)``, ``um/N``, ``mm/s/kN``, ``in/lbf`` ...

    Raises
    ------
    InputError
        Not a unit, the unit of a stiffness, or a unit of anything that is no motion over force.

    Examples
    --------
    >>> frf_unit("g/N")
    FrfUnit(quantity='accelerance', factor=9.80665)
    >>> frf_unit("um/kN").quantity, round(frf_unit("um/kN").factor, 15)
    ('receptance', 1e-09)
    """
    plain = _plain(text)
    if not plain:
        raise InputError('the unit of the FRF is empty; write it as in unit = "m/s^2/N"')
    spellings = [plain, _GRAVITY.sub("standard_gravity", plain)]
    beside = re.fullmatch(r"\(([^()]+)\)\s*\(([^()]+)\)", plain)  # side by side, as SignalCalc writes
    if beside is not None:
        ratio = f"({beside[1]})/({beside[2]})"
        spellings += [ratio, _GRAVITY.sub("standard_gravity", ratio)]
    for spelling in spellings:
        for quantity, unit in SI.items():
            factor = unit_factor(spelling, unit)
            if factor is not None:
                return FrfUnit(quantity, factor)
    for name, unit in _INVERSE.items():
        if any(unit_factor(spelling, unit) is not None for spelling in spellings):
            raise InputError(f"unit {text!r} is that of a {name}, force over motion; give the FRF, its inverse")
    raise InputError(
        f"unit {text!r} is no motion over force; write it as m/N, um/N, m/s/N, m/s^2/N or g/N, or give "
        'quantity = "transfer" where it is another ratio'
    )


def _plain(text: str) -> str:
    plain = text.strip()
    for written, read in _SIGNS:
        plain = plain.replace(written, read)
    return re.sub(r"(?<![a-zA-Z])s2(?![0-9])", "s^2", plain)
