"""Start and exit angle from the way a cutter is led: up, down, slot, central."""

import math

from foundation import InputError

IMMERSIONS = ("up", "down", "slot", "central")


def immersion_angles(kind: str, radial_depth: float, diameter: float) -> tuple[float, float]:
    """Give the immersion of a cutter that takes ``radial_depth`` (m) of its diameter.

    Up milling enters at 0 with no chip and leaves at ``acos(1 - 2 b / D)``; down milling is its mirror image; a central
    cut lies evenly about pi/2 (Altintas, Manufacturing Automation, 2nd ed., section 2.6).

    Parameters
    ----------
    kind
        Way the cutter is led: ``up``, ``down``, ``slot`` or ``central``.
    radial_depth : m
        Radial depth of cut b; it has no effect in a slot.
    diameter : m
        Diameter D of the cutter.

    Returns
    -------
    start, exit
        rad.

    Raises
    ------
    InputError
        An unknown kind, or a radial depth outside 0 < b <= D.

    Examples
    --------
    >>> [round(math.degrees(angle)) for angle in immersion_angles("down", 0.005, 0.01)]
    [90, 180]
    """
    if kind not in IMMERSIONS:
        raise InputError(f"immersion {kind!r} is not known; use one of {', '.join(IMMERSIONS)}")
    if kind == "slot":
        return 0.0, math.pi
    if not 0 < radial_depth <= diameter:
        raise InputError(
            f"radial depth {radial_depth!r} m must be above 0 and at most the diameter, {diameter:g} m; "
            "give metres, not mm"
        )
    width = math.acos(1 - 2 * radial_depth / diameter)
    if kind == "up":
        return 0.0, width
    if kind == "down":
        return math.pi - width, math.pi
    half = math.asin(radial_depth / diameter)
    return math.pi / 2 - half, math.pi / 2 + half
