"""Lines that belong together: chatter is modulated by the teeth and has a line at every tooth passing beside it."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .lines import Line

Real = NDArray[np.float64]

TOLERANCE = 1.2
"""Lines of resolution by which lines of one family may differ."""
SHARP = 0.85
"""Sharpness from which a line is a periodic motion rather than noise through a lightly damped mode."""
_SHARP_SIDES = 2


@dataclass(frozen=True)
class Family:
    """Lines at ``+-f + k f_tooth``: one periodic disturbance and what the teeth make of it.

    Parameters
    ----------
    lines
        Lines of the family, strongest first.
    share
        Root mean square of the lines over that of the motion, in the channel where it is largest.
    place
        Distance from the nearest multiple of the tooth passing, in orders of the spindle, 0 to half the teeth.
    """

    lines: tuple[Line, ...]
    share: float
    place: float

    @property
    def sharp(self) -> bool:
        """Whether the strongest line and two or more side lines are as narrow as the record is long."""
        sharp_sides = sum(line.sharpness > SHARP for line in self.lines[1:])
        return self.lines[0].sharpness > SHARP and sharp_sides >= _SHARP_SIDES

    @property
    def p_value(self) -> float:
        """Probability that noise alone has a line as strong as the most significant one."""
        return min(line.p_value for line in self.lines)


def folded(order: float, teeth: int) -> float:
    """Distance (orders) from the nearest multiple of the number of teeth."""
    return abs((order + teeth / 2) % teeth - teeth / 2)


def families_of(lines: tuple[Line, ...], teeth: int, resolution: float, size: Real) -> tuple[Family, ...]:
    """Gather lines by their place between two multiples of the tooth passing; families with most power come first.

    Parameters
    ----------
    lines
        Lines of the spectrum, strongest first.
    teeth
        Number of teeth.
    resolution
        Distance between two lines of the spectrum, in orders of the spindle.
    size : (n_channels,)
        Root mean square of the motion in each channel.
    """
    left = list(lines)
    found = []
    while left:
        place = folded(left[0].order, teeth)
        own = [line for line in left if abs(folded(line.order, teeth) - place) < TOLERANCE * resolution]
        left = [line for line in left if line not in own]
        power = np.sum([line.amplitude**2 for line in own], axis=0)
        found.append(Family(tuple(own), float(np.max(np.sqrt(power) / size)), place))
    return tuple(sorted(found, key=lambda family: -family.share))


def largest_motion(lines: tuple[Line, ...], derivative: tuple[int, ...], natural: tuple[float, ...]) -> Line:
    """The line of a family at which the tool moves most, or, with natural frequencies, the one nearest to a mode.

    Chatter vibrates close to a mode of the structure (Altintas, Manufacturing Automation, 2nd ed., section 3.3); its
    other lines are what the teeth make of it. Lines weaker than a tenth of the largest motion are not taken.

    Parameters
    ----------
    lines
        Lines of one family.
    derivative : (n_channels,)
        2 for acceleration, 1 for velocity, 0 for displacement.
    natural
        Natural frequencies of the structure, Hz; empty: not known.
    """

    def motion(line: Line) -> float:
        sizes = [a / line.frequency**power for a, power in zip(line.amplitude, derivative, strict=True)]
        return math.sqrt(sum(size**2 for size in sizes))

    largest = max(motion(line) for line in lines)
    if not natural:
        return max(lines, key=motion)
    strong = [line for line in lines if motion(line) > 0.1 * largest]
    return min(strong, key=lambda line: min(abs(math.log(line.frequency / mode)) for mode in natural))
