"""What a fit leaves beyond noise and beyond what a right force model is off, and at which spindle orders it sits."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammainccinv

from .cut_setting import Attempt, CutSetting

Real = NDArray[np.float64]

CHANCE = 1e-7
"""That a line of noise passes for something left over."""

ERRORS = 3.0
"""Times its usual error by which a line of the computed force may be off."""

MOST_ORDERS = 8


@dataclass(frozen=True)
class CutLeftover:
    """What is left of the recordings.

    Parameters
    ----------
    power
        Of the lines that stand out, N^2.
    share
        The same as a share of the whole residual.
    orders
        Spindle orders that hold most of it (multiples of the spindle's frequency), strongest first.
    channels
        Degrees of freedom in which it stands out, strongest first.
    """

    power: float
    share: float
    orders: tuple[float, ...]
    channels: tuple[str, ...]


def leftover(setting: CutSetting, attempt: Attempt) -> CutLeftover:
    """Lines with more power than noise has by chance, in a block or in the mean of all blocks.

    Parameters
    ----------
    setting
        With its noise.
    attempt
        A fit's numbers.
    """
    power, total = 0.0, 0.0
    by_order: dict[float, float] = {}
    by_channel: dict[str, float] = {}
    for k, lines in enumerate(setting.lines):
        shown = setting.shown(k, attempt)
        rest = np.abs(lines.measured - shown) ** 2
        off = (ERRORS * setting.force_error) ** 2 * np.abs(shown) ** 2
        floor = setting.noise[k].floor
        alone = rest > gammainccinv(1, CHANCE) * floor + off
        mean = rest.mean(axis=0) > gammainccinv(lines.blocks, CHANCE) / lines.blocks * floor + off.mean(axis=0)
        seen = np.where(alone | mean, rest, 0.0)
        power, total = power + float(seen.sum()), total + float(rest.sum())
        rotation = lines.recording.law.speed / (2 * np.pi)
        for order, one in zip(lines.frequencies / rotation, seen.sum(axis=(0, 2)), strict=True):
            near = round(order) if abs(order - round(order)) < 0.15 else round(float(order), 1)
            by_order[near] = by_order.get(near, 0.0) + float(one)
        for label, one in zip(lines.recording.channels, seen.sum(axis=(0, 1)), strict=True):
            by_channel[label] = by_channel.get(label, 0.0) + float(one)
    orders = [order for order in sorted(by_order, key=lambda o: -by_order[o]) if by_order[order] > 0.01 * power]
    channels = [label for label in sorted(by_channel, key=lambda c: -by_channel[c]) if by_channel[label] > 0.01 * power]
    return CutLeftover(power, power / max(total, 1e-300), tuple(orders[:MOST_ORDERS]), tuple(channels))
