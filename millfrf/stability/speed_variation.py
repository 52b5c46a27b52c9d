"""`SpeedVariation`: a spindle speed that varies sinusoidally over the spindle's angle."""

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from millfrf.core import InputError, Real

ROUNDING = 1e-6  # relative, of a typed fraction such as 0.333333
LARGEST_DENOMINATOR = 24  # revolutions, at most, in which a variation and the teeth must repeat together


@dataclass(frozen=True)
class SpeedVariation:
    """Sinusoidal variation of the spindle speed, ``speed (1 + amplitude sin(frequency angle))``.

    Parameters
    ----------
    amplitude
        Share of the mean speed, 0 to below 1.
    frequency
        Periods of the variation per revolution.
    """

    amplitude: float
    frequency: float

    def __post_init__(self) -> None:
        if not (0 <= self.amplitude < 1 and 0 < self.frequency < math.inf):
            raise InputError(
                f"speed variation of {self.amplitude!r} of the speed, {self.frequency!r} times a revolution: give an "
                "amplitude of 0 to below 1, and a frequency above 0"
            )

    def durations(self, angles: Real, step: float, speed: float) -> Real:
        """Return the time (s) of steps of ``step`` rad whose middles are at spindle angles (rad); ``speed`` in rad/s.

        Examples
        --------
        >>> SpeedVariation(0.2, 1.0).durations(np.array([0.0, np.pi / 2]), 0.01, 100.0).round(7).tolist()
        [0.0001, 8.33e-05]
        """
        return np.asarray(step / (speed * (1 + self.amplitude * np.sin(self.frequency * angles))))

    def tooth_passings(self, teeth: int) -> int:
        """Return after how many passings of a tooth teeth and speed repeat together.

        Raises
        ------
        InputError
            They do not repeat within 24 revolutions.

        Examples
        --------
        >>> [SpeedVariation(0.2, frequency).tooth_passings(3) for frequency in (0.5, 3.0, 1.5)]
        [6, 1, 2]
        """
        share = Fraction(self.frequency).limit_denominator(LARGEST_DENOMINATOR)
        share = max(share, Fraction(1, LARGEST_DENOMINATOR))
        if abs(float(share) - self.frequency) > ROUNDING * self.frequency:
            raise InputError(
                f"a variation {self.frequency:g} times a revolution does not repeat within {LARGEST_DENOMINATOR} "
                f"revolutions; give a fraction of small numbers, such as {float(share):.7g}"
            )
        passings = teeth * share.denominator
        return passings // math.gcd(passings, share.numerator)
