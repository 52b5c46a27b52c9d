"""Ranges of the numbers in a robot's file, by the unit that a key ends on: millimetres and gigapascals are caught."""

from collections.abc import Iterator
from typing import Any

from foundation import FileFormatError

_RANGES = (
    # ending of the key, smallest and largest size of a number that is not 0, and what to give
    ("kg_per_m3", 100.0, 25e3, "a density in kg/m^3; aluminium has 2700"),
    ("nm_per_rad", 1e-6, 1e12, "a stiffness in N m/rad"),
    ("n_per_m", 1.0, 1e13, "a stiffness in N/m"),
    ("m_per_s2", 0.1, 30.0, "metres per second squared"),
    ("kg_m2", 1e-9, 1e5, "a moment of inertia in kg m^2"),
    ("nm2", 1.0, 1e12, "a bending stiffness E I in N m^2"),
    ("_pa", 1e8, 2e12, "pascals; aluminium has 69e9"),
    ("_kg", 1e-6, 2e4, "kilograms"),
    ("_hz", 1e-3, 1e5, "hertz"),
    ("_deg", 0.0, 1080.0, "degrees"),
    ("_n", 1.0, 1e13, "newtons"),
    ("repeatability_m", 1e-6, 5e-3, "the pose repeatability of ISO 9283 in metres; 0.06 mm is 6e-5"),
    ("_m", 0.0, 20.0, "metres"),
)
_OWN_CHECK = ("driven", "driven_deg", "angles_deg", "limits_m", "limits_deg", "measured_first_mode_hz", "inertia_kg_m2")
"""Joint values and limits: their unit follows from the joint's motion; inertias are judged as a whole."""


def check_ranges(content: Any) -> None:
    """Refuse the first number of a file that its unit cannot mean.

    Parameters
    ----------
    content
        The file as tables and lists.

    Raises
    ------
    FileFormatError
        With the key, the value, the unit and the range.
    """
    for place, key, value in _numbers(content, ""):
        for ending, least, most, unit in _RANGES:
            if key.endswith(ending):
                if value and not least <= abs(value) <= most:
                    raise FileFormatError(f"{place} = {value!r}: give {unit} (size {least:g} to {most:g})")
                break


def _numbers(part: Any, place: str, key: str = "") -> Iterator[tuple[str, str, float]]:
    """Every number with its place (``links[1].tube.outer_m``) and the key that it stands under."""
    if isinstance(part, dict):
        for name, entry in part.items():
            if name not in _OWN_CHECK:
                yield from _numbers(entry, f"{place}.{name}".lstrip("."), name)
    elif isinstance(part, list):
        for index, entry in enumerate(part):
            yield from _numbers(entry, f"{place}[{index + 1}]", key)
    elif isinstance(part, (int, float)) and not isinstance(part, bool):
        yield place, key, float(part)
