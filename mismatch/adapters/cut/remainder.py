"""Residual of a fit beyond noise and beyond the error of a right force model, and the spindle orders that hold it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammainccinv

from ...inference import Remainder
from .fits import CutHypothesis, MeasuredCut
from .settings import CutSettings

Real = NDArray[np.float64]
Place = TypeVar("Place", float, str)

MOST_TOLD = 8
"""Spindle orders that are told."""

WORTH_TELLING = 0.01
"""Share of what is left from which an order or a channel is told."""


@dataclass(frozen=True)
class CutRemainder:
    """Residual power of a cut beyond noise and usual error, and where it sits.

    Parameters
    ----------
    left
        Power of the lines that stand out, as a share of the residual's power, and in N^2.
    orders
        Spindle orders that hold most of it (multiples of the spindle's frequency), strongest first.
    channels
        Degrees of freedom in which it stands out, strongest first.
    """

    left: Remainder
    orders: tuple[float, ...]
    channels: tuple[str, ...]


def cut_remainder(cut: MeasuredCut, hypothesis: CutHypothesis, settings: CutSettings) -> CutRemainder:
    """Spectral lines with more power than noise has by chance, in a block or in the mean of all blocks.

    Parameters
    ----------
    cut
        Recordings with their noise.
    hypothesis
        Numbers of the fit.
    settings
        Thresholds: the chance, and how far a right force may be off.
    """
    power, total = 0.0, 0.0
    by_order: dict[float, float] = {}
    by_channel: dict[str, float] = {}
    for k, spectra in enumerate(cut.spectra):
        predicted = cut.predicted(k, hypothesis)
        rest = np.abs(spectra.measured - predicted) ** 2
        off = (settings.usual_errors * cut.force_error) ** 2 * np.abs(predicted) ** 2
        seen = np.where(_stands_out(rest, cut.noise[k].floor, off, settings.chance), rest, 0.0)
        power, total = power + float(seen.sum()), total + float(rest.sum())
        rotation = spectra.recording.law.speed / (2 * np.pi)
        for order, one in zip(spectra.frequencies / rotation, seen.sum(axis=(0, 2)), strict=True):
            near = round(order) if abs(order - round(order)) < 0.15 else round(float(order), 1)
            by_order[near] = by_order.get(near, 0.0) + float(one)
        for label, one in zip(spectra.recording.channels, seen.sum(axis=(0, 1)), strict=True):
            by_channel[label] = by_channel.get(label, 0.0) + float(one)
    left = Remainder(power / max(total, 1e-300), power)
    return CutRemainder(left, _strongest(by_order, power)[:MOST_TOLD], _strongest(by_channel, power))


def _stands_out(rest: Real, floor: Real, off: Real, chance: float) -> NDArray[np.bool_]:
    """Lines (n_blocks, n_lines, n_axes) whose power, alone or in the mean of blocks, noise reaches only by chance."""
    blocks = len(rest)
    alone = rest > gammainccinv(1, chance) * floor + off
    mean = rest.mean(axis=0) > gammainccinv(blocks, chance) / blocks * floor + off.mean(axis=0)
    return np.asarray(alone | mean)


def _strongest(powers: Mapping[Place, float], whole: float) -> tuple[Place, ...]:
    """Places with more than their share of the whole, strongest first."""
    ranked = sorted(powers, key=lambda place: -powers[place])
    return tuple(place for place in ranked if powers[place] > WORTH_TELLING * whole)
