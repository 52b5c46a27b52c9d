"""Tables that robots in space and serial robots share: postures, damping, and the axis against weight."""

from collections.abc import Sequence
from math import hypot

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from foundation import InputError

from ..finite_elements import rayleigh_constants
from ..kinematics import Mechanism, named_values
from .robot_files import Table


class Damping(Table):
    """Either two ratios at two frequencies (Rayleigh), or one ratio for all modes.

    Parameters
    ----------
    frequencies_hz : Hz
        Two frequencies at which the ``ratios`` hold (Rayleigh).
    ratios
        Damping ratios there, 0 to below 1; 4 % is 0.04.
    ratio
        One damping ratio for all modes, instead; 4 % is 0.04.
    """

    frequencies_hz: tuple[float, float] | None = None
    ratios: tuple[float, float] | None = None
    ratio: float | None = Field(None, ge=0, lt=1)


class Pose(Table):
    """A posture: ``driven`` in degrees, of prismatic joints in metres; ``driven_deg`` is its older name.

    Parameters
    ----------
    name
        Name of the posture.
    driven : deg; prismatic joints m
        Values of the driven joints in the order of the frames.
    driven_deg : deg; prismatic joints m
        Older name of ``driven``: prismatic joints are in metres here too.
    """

    name: str
    driven: list[float] | None = None
    driven_deg: list[float] | None = None


def named_postures(poses: Sequence[Pose], mechanism: Mechanism) -> dict[str, NDArray[np.float64]]:
    """Postures of a file by name, rad and m."""
    typed = []
    for pose in poses:
        given = [values for values in (pose.driven, pose.driven_deg) if values is not None]
        if len(given) != 1:
            raise InputError(f"posture {pose.name!r}: give driven = [...] once: degrees, prismatic joints in metres")
        typed.append((pose.name, given[0]))
    return named_values(mechanism, typed)


def rayleigh_of(damping: Damping | None) -> tuple[float, float]:
    """Rayleigh's constants of a file's damping, 1/s and s; zero where it gives one ratio."""
    if damping is None:
        return (0.0, 0.0)
    if damping.ratio is not None:
        if damping.ratios is not None or damping.frequencies_hz is not None:
            raise InputError("damping: give one ratio, or frequencies_hz and ratios (two each), not both")
        return (0.0, 0.0)
    if damping.frequencies_hz is None or damping.ratios is None:
        raise InputError("damping: give frequencies_hz and ratios (two each), or one ratio")
    if not all(0 <= ratio < 1 for ratio in damping.ratios):
        raise InputError(f"damping: ratios = {list(damping.ratios)} must be 0 or more and below 1; 4 % is 0.04")
    return rayleigh_constants(damping.frequencies_hz, damping.ratios)


def upwards(given: tuple[float, float, float]) -> tuple[float, float, float]:
    """Unit vector against weight."""
    length = hypot(*given)
    if not length > 0:
        raise InputError(f"up = {list(given)} has no direction; give the base frame's axis against weight: [0, 0, 1]")
    return given[0] / length, given[1] / length, given[2] / length
