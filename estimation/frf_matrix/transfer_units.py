"""What drives and what answers in an FRF or a model of one, read from its unit."""

from itertools import product

from foundation import SI_UNITS, InputError

EXCITATIONS = ("force", "moment", "voltage", "acceleration")
"""Quantities that may drive a rig: the last one is that of a shaken base."""

FAMILIES = (
    ("displacement", "velocity", "acceleration"),
    ("angle", "angular_velocity"),
)
"""Responses that are one motion and its derivatives."""


def quantities_of_unit(unit: str) -> tuple[str, str]:
    """Quantities of response and excitation of an FRF in a unit such as ``m/N``, ``m/s^2/V`` or ``rad/(N m)``.

    Parameters
    ----------
    unit
        SI unit of the response, a stroke, SI unit of the excitation, with or without brackets around either.

    Raises
    ------
    InputError
        A unit that is not made of two that channels have.

    Examples
    --------
    >>> quantities_of_unit("m/s^2/N m"), quantities_of_unit("m/V")
    (('acceleration', 'moment'), ('displacement', 'voltage'))
    """
    plain = unit.replace("(", "").replace(")", "")
    for response, excitation in product(SI_UNITS, EXCITATIONS):
        if plain == f"{SI_UNITS[response]}/{SI_UNITS[excitation]}":
            return response, excitation
    raise InputError(
        f"unit {unit!r} does not say what drives and what answers; write response over excitation in SI units, "
        "such as m/N, m/V, rad/(N m) or m/s^2/V"
    )


def family_of(response: str) -> tuple[str, ...]:
    """Quantities that are the same motion as a response; the quantity alone where it is no motion.

    Examples
    --------
    >>> family_of("angular_velocity"), family_of("voltage")
    (('angle', 'angular_velocity'), ('voltage',))
    """
    return next((family for family in FAMILIES if response in family), (response,))
