"""`Change`: one thing that may be wrong with a robot's model, with one number and its companions."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..spatial.spatial_robot import SpatialRobot

Real = NDArray[np.float64]

Changed = tuple[SpatialRobot, Real]
"""A robot, and by how much its joints stand elsewhere than was said, rad, (n_moving,)."""


@dataclass(frozen=True)
class Companion:
    """A number that is fitted beside a change's own, with a prior belief: a place, a second direction.

    Parameters
    ----------
    name, unit
        Name and unit of the number, for people.
    bounds
        Lowest and highest value of the number, in ``unit``.
    centre, spread
        Mean and standard deviation of the belief.
    scale
        Size of the number at which its coordinate ``asinh(number / scale)`` turns from linear to logarithmic.
    """

    name: str
    unit: str
    bounds: tuple[float, float]
    centre: float
    spread: float
    scale: float = 1.0

    @property
    def neutral(self) -> float:
        """Number from which a fit starts."""
        return float(np.clip(self.centre, *self.bounds))

    def to_fit(self, number: float) -> float:
        """Coordinate in which it is fitted."""
        return float(np.arcsinh(number / self.scale))

    def from_fit(self, coordinate: float) -> float:
        """Back to the number, kept within its bounds."""
        return float(np.clip(self.scale * np.sinh(np.clip(coordinate, -50.0, 50.0)), *self.bounds))

    def slope(self, number: float) -> float:
        """Derivative of the number by its coordinate."""
        return float(np.hypot(number, self.scale))


@dataclass(frozen=True)
class Change:
    """One thing that may be wrong, with one number and, where it needs them, companions of that number.

    Parameters
    ----------
    name
        ``joint 3 stiffness``, ``links``, ``payload``, ``tool compliance``, ``posture of joint 3``, ``gravity``,
        ``damping``.
    kind
        ``stiffness``, ``links``, ``payload``, ``tool``, ``posture``, ``gravity`` or ``damping``.
    unit
        Unit of the number; "" for a factor.
    logarithmic
        Whether the number is positive and is fitted by its logarithm.
    values
        Numbers from which a search starts, from small to large change.
    bounds
        Lowest and highest value of the number, in ``unit``.
    neutral
        Number at which next to nothing is changed.
    apply
        Function that takes a robot, the number and the companions' numbers (their neutral ones where left out) and
        gives the changed robot and the offset of its joints.
    scale
        Scale of the number. Where it is positive, the number may have both signs and is fitted as ``asinh(number /
        scale)``.
    companions
        Further numbers that are fitted with it.
    """

    name: str
    kind: str
    unit: str
    logarithmic: bool
    values: tuple[float, ...]
    bounds: tuple[float, float]
    neutral: float
    apply: Callable[..., Changed]
    scale: float = 0.0
    companions: tuple[Companion, ...] = ()

    def to_fit(self, number: float) -> float:
        """Coordinate in which it is fitted: ln, asinh, or the number itself."""
        if self.scale:
            return float(np.arcsinh(number / self.scale))
        return float(np.log(number)) if self.logarithmic else number

    def from_fit(self, coordinate: float) -> float:
        """Back to the number, kept within its bounds."""
        number = coordinate
        if self.scale:
            number = self.scale * float(np.sinh(np.clip(coordinate, -50.0, 50.0)))
        elif self.logarithmic:
            number = float(np.exp(min(coordinate, 700.0)))
        return float(np.clip(number, *self.bounds))

    def slope(self, number: float) -> float:
        """Derivative of the number by its coordinate."""
        if self.scale:
            return float(np.hypot(number, self.scale))
        return number if self.logarithmic else 1.0


Numbered = tuple[Change | Companion, float]
"""A change or a companion with its number; companions follow their change."""
