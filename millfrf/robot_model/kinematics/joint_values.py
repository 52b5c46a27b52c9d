"""Joint values as a user types and reads them: degrees of revolute joints, metres of prismatic ones."""

from collections.abc import Sequence

import numpy as np

from millfrf.core import InputError, Real

from .mechanism import Frame, Mechanism

LARGEST_ANGLE = 1080.0
"""Largest value of a revolute joint that is taken, degrees: three turns."""

LARGEST_TRAVEL = 50.0
"""Largest value of a prismatic joint that is taken, m."""

_IN_RADIANS = 6.3
"""Where no angle passes it, and some are no whole numbers, the angles may be radians."""


def joint_unit(frame: Frame) -> str:
    """``deg`` of a revolute joint, ``m`` of a prismatic one."""
    return "m" if frame.motion == "prismatic" else "deg"


def driven_values(mechanism: Mechanism, typed: Sequence[float]) -> Real:
    """Convert what a user typed to joint values in rad and m: degrees for revolute joints, metres for prismatic ones.

    Parameters
    ----------
    mechanism
        Mechanism whose joints are driven.
    typed : (n_active,)
        Typed values in the order of the driven frames.

    Raises
    ------
    InputError
        Another number of values, or one that no joint can have; the line names the joint and its unit.

    Examples
    --------
    >>> rail = Mechanism((Frame("rail", "0", motion="prismatic"), Frame("1", "rail")), "1")
    >>> driven_values(rail, [2.0, 90.0]).round(4).tolist()
    [2.0, 1.5708]
    """
    frames = _driven(mechanism)
    if len(typed) != len(frames):
        units = ", ".join(f"{frame.name} ({joint_unit(frame)})" for frame in frames)
        raise InputError(f"{len(typed)} joint values for {len(frames)} driven joints; give one each: {units}")
    return np.array([_taken(frame, float(value)) for frame, value in zip(frames, typed, strict=True)], dtype=float)


def named_values(mechanism: Mechanism, typed: Sequence[tuple[str, Sequence[float]]]) -> dict[str, Real]:
    """Postures of a file by name, in rad and m.

    Raises
    ------
    InputError
        A name twice, or values that no joint has; the line names the posture.
    """
    found: dict[str, Real] = {}
    for name, values in typed:
        if name in found:
            raise InputError(f"two postures are named {name!r}; name each once")
        try:
            found[name] = driven_values(mechanism, values)
        except InputError as error:
            raise InputError(f"posture {name!r}: {error}") from error
    return found


def typed_values(mechanism: Mechanism, driven: Real) -> Real:
    """The way back: degrees and metres from driven joint values (rad, m), shape (n_active,)."""
    scale = np.array([1.0 if frame.motion == "prismatic" else 180 / np.pi for frame in _driven(mechanism)])
    return np.asarray(np.asarray(driven, dtype=float) * scale)


def shown_values(mechanism: Mechanism, driven: Real) -> str:
    """Driven joint values (rad, m) as one line with units: ``0.0, -20.0 deg``, or ``2.000 m, 0.0 deg`` where mixed.

    Examples
    --------
    >>> rail = Mechanism((Frame("rail", "0", motion="prismatic"), Frame("1", "rail")), "1")
    >>> shown_values(rail, np.array([2.0, 0.5]))
    '2.000 m, 28.6 deg'
    """
    frames, values = _driven(mechanism), typed_values(mechanism, driven)
    if all(frame.motion != "prismatic" for frame in frames):
        return ", ".join(f"{value:.1f}" for value in values) + " deg"
    cells = (
        f"{value:.3f} m" if frame.motion == "prismatic" else f"{value:.1f} deg"
        for frame, value in zip(frames, values, strict=True)
    )
    return ", ".join(cells)


def unit_doubts(mechanism: Mechanism, typed: Sequence[float]) -> tuple[str, ...]:
    """A sentence where the angles look like radians: none passes 6.3, and some are no whole numbers; else empty.

    Examples
    --------
    >>> turning = Mechanism((Frame("1", "0"), Frame("2", "1")), "2")
    >>> len(unit_doubts(turning, [1.57, -0.35])), len(unit_doubts(turning, [90.0, -20.5]))
    (1, 0)
    """
    angles = [value for frame, value in zip(_driven(mechanism), typed, strict=False) if frame.motion != "prismatic"]
    small = bool(angles) and max(abs(value) for value in angles) <= _IN_RADIANS
    if len(angles) < 2 or not small or all(float(value).is_integer() for value in angles):
        return ()
    largest = max(angles, key=abs)
    return (
        f"no joint angle is larger than {abs(largest):.3g} degrees; if radians were meant, "
        f"{largest:.4g} rad is {np.degrees(largest):.4g} degrees",
    )


def _driven(mechanism: Mechanism) -> list[Frame]:
    return [mechanism.frames[index] for index in mechanism.moving if mechanism.frames[index].active]


def _taken(frame: Frame, value: float) -> float:
    """One value in rad or m."""
    if frame.motion == "prismatic":
        if not abs(value) <= LARGEST_TRAVEL:
            raise InputError(
                f"joint {frame.name} = {value:g}: a prismatic joint is given in metres, at most {LARGEST_TRAVEL:g}; "
                f"{value:g} mm would be {1e-3 * value:g}"
            )
        return value
    if not abs(value) <= LARGEST_ANGLE:
        raise InputError(
            f"joint {frame.name} = {value:g}: a revolute joint is given in degrees, at most {LARGEST_ANGLE:g}; "
            "check the value and the order of the joints"
        )
    return float(np.radians(value))
