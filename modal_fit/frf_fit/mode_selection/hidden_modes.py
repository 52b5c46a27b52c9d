"""Candidates where a fit leaves more than noise: partners of a mode that stands for two, and peaks of what is left."""

from collections.abc import Iterator

import numpy as np

from ..variable_projection.elimination import Elimination, Modes, Real
from ..variable_projection.neighbourhood import half_power_lines
from ..variable_projection.whitened_lines import MeasuredLines
from .steady_poles import Candidate

_COLOUR = 0.1  # correlation of neighbouring lines' errors from which a mode may stand for two
_SHIFTS = (-1.0, 1.0)  # half bandwidths from the mode
_PEAKS = 3
_ROUNDING = 1e-12  # share of the power below which nothing is left
_LEFT = 1.5  # times the noise expected: less is no reason to look
_SMOOTH = 5  # lines
_TRUST = 0.3  # as if three orders in ten had the pole


def hidden_candidates(modes: Modes, lines: MeasuredLines, found: Elimination) -> Iterator[Candidate]:
    """Poles to try beside modes whose errors have memory, and where most is left.

    Parameters
    ----------
    modes, lines, found
        The fit so far.
    """
    power = found.power(lines)
    if power.sum() < _ROUNDING * np.sum(np.abs(lines.values) ** 2):
        return
    for pole in modes.poles:
        here = half_power_lines(complex(pole), lines)
        if not here.any() or power[here].sum() < _LEFT * lines.noise[here].sum():
            continue
        if found.colour(lines, here) > max(_COLOUR, 3 / np.sqrt(here.sum() * lines.values[0].size)):
            for shift in _SHIFTS:
                yield _candidate(complex(pole) + 1j * shift * abs(pole.real), modes)
    if len(modes.poles):
        damping = float(np.median(modes.damping_ratios))
        for frequency in _peaks(lines, power):
            omega = 2 * np.pi * frequency
            yield _candidate(omega * complex(-damping, np.sqrt(1 - damping**2)), modes)


def _candidate(pole: complex, modes: Modes) -> Candidate:
    return Candidate(pole, _TRUST, 0, np.ones(modes.left.shape[1], dtype=complex))


def _peaks(lines: MeasuredLines, power: Real) -> list[float]:
    """Frequencies (Hz) of the largest separate maxima of the error's power, smoothed over a few lines."""
    if len(power) <= 2 * _SMOOTH:
        return []
    level = np.convolve(power / np.median(power), np.ones(_SMOOTH) / _SMOOTH, "same")
    top = np.flatnonzero((level[1:-1] > level[:-2]) & (level[1:-1] >= level[2:])) + 1
    expected = np.convolve(lines.noise / np.median(power), np.ones(_SMOOTH) / _SMOOTH, "same")
    top = top[level[top] > 2 * _LEFT * expected[top]]
    order = top[np.argsort(-level[top])][:_PEAKS]
    return [float(lines.frequencies[line]) for line in order]
