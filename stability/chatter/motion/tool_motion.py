"""How much motion of the tool changes the chip: chatter is large enough to take the teeth out of the cut."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .families import Family

Real = NDArray[np.float64]


@dataclass(frozen=True)
class ToolMotion:
    """Channels that hold the tool's motion across its axis, and the chip that it changes.

    A linear cut that is not stable grows until teeth leave the cut (Balachandran, Phil. Trans. R. Soc. A 359, 2001),
    which takes a motion of the size of the chip. What a stable cut's own noise does is smaller.

    Parameters
    ----------
    chip
        Thickest chip of the cut without vibration, m.
    teeth
        Number of teeth.
    spindle
        Frequency of the spindle, Hz.
    scales : (n_channels,)
        Unit of each channel of the evidence, in that of the samples; 0 for channels that do not count.
    derivatives : (n_channels,)
        2 for acceleration, 1 for velocity, 0 for displacement.
    """

    chip: float
    teeth: int
    spindle: float
    scales: Real
    derivatives: tuple[int, ...]

    def change(self, orders: Real, power: Real, *, alike: bool = False) -> float:
        """Root mean square of the chip's change from pass to pass over the thickest chip.

        At a frequency f the chip changes by ``x (1 - exp(-2 pi i f tau))``, tau the time from tooth to tooth.

        Parameters
        ----------
        orders : (n_lines,)
            Frequencies over the spindle's, all positive.
        power : (n_lines, n_channels)
            Mean square of the evidence's channels.
        alike
            Motion itself instead of its change from pass to pass.
        """
        omega = 2 * math.pi * self.spindle * orders
        passed = np.ones(len(orders)) if alike else np.abs(1 - np.exp(-2j * np.pi * orders / self.teeth)) ** 2
        gains = self.scales**2 / omega[:, None] ** (2 * np.array(self.derivatives))
        return math.sqrt(float(np.sum(power * gains * passed[:, None]))) / self.chip

    def of_family(self, family: Family) -> float:
        """The same for lines that belong together."""
        orders = np.array([line.order for line in family.lines])
        return self.change(orders, np.array([line.amplitude for line in family.lines]) ** 2)
