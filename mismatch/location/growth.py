"""Growth of a residual with the level of excitation, which shows the kind of omission."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation import WindowedSpectrum

from ..inference import LOCATION, LocationSettings
from ..models import Fit, Hypothesis
from .residual_maps import normalised, overlap

Real = NDArray[np.float64]


@dataclass(frozen=True)
class Growth:
    """Residual above noise against force, recording by recording.

    Parameters
    ----------
    force : (n_recordings,), N
        Root mean square force, all directions together.
    amplitude, error : (n_recordings,)
        Root mean square residual without the noise's power, and its standard error. Every channel counts in units of
        its own response averaged over the recordings. The amplitude is zero where nothing stands above the noise.
    noise : (n_recordings,)
        Root mean square noise, in the unit of ``amplitude``.
    exponent, exponent_error
        Exponent of ``amplitude ~ force^exponent`` and its standard error; nan where fewer than two levels show it.
    """

    force: Real
    amplitude: Real
    error: Real
    noise: Real
    exponent: float
    exponent_error: float


def growth(
    hypothesis: Hypothesis,
    reference: Fit,
    lines: Sequence[WindowedSpectrum],
    bands: Sequence[tuple[float, float]],
    spread: float,
    settings: LocationSettings = LOCATION,
) -> Growth:
    """Return how a hypothesis's residual grows with the force inside bands.

    The residual of a linear omission grows as the force and that of a cubic one as its third power; that of dry
    friction does not grow.

    Parameters
    ----------
    hypothesis
        Hypothesis about the structure whose residual is measured.
    reference
        Fit whose noise is taken off the residual.
    lines
        Windowed spectra of the recordings, in the order of that fit.
    bands
        Bands in which the residual was found, as low and high edge, Hz; empty for all frequencies.
    spread
        Relative standard deviation of the noise's variance, beyond chance.
    settings
        From where a residual counts, and how far levels must be apart.
    """
    unit = np.sqrt(np.mean([np.mean(np.abs(one.measured) ** 2, axis=0) for one in lines], axis=0))
    rows = []
    for number, one in enumerate(lines):
        single, _, variance = normalised(hypothesis, reference, number, one)
        inside = _inside(one.frequencies, bands)
        floor = variance[inside] / unit**2
        power = np.abs(single[inside]) ** 2 * floor
        excess = float(power.sum() - floor.sum())
        chance = 0.5 * float(np.sum(power**2)) * overlap(one.window)
        error = float(np.sqrt(chance + (spread * float(floor.sum())) ** 2))
        rows.append((one.recording.level, excess / power.size, error / power.size, float(floor.mean())))
    force, excess_, error_, noise = np.array(rows).T
    amplitude = np.sqrt(np.maximum(excess_, 0.0))
    spreads = error_ / (2 * np.maximum(amplitude, np.sqrt(error_)))
    seen = excess_ > settings.seen * error_
    exponent, exponent_error = _slope(
        force[seen], amplitude[seen], spreads[seen] / amplitude[seen], settings.levels_apart
    )
    return Growth(force, amplitude, spreads, np.sqrt(noise), exponent, exponent_error)


def _inside(frequencies: Real, bands: Sequence[tuple[float, float]]) -> NDArray[np.bool_]:
    inside = np.zeros(len(frequencies), dtype=bool)
    for low, high in bands or [(0.0, np.inf)]:
        inside |= (frequencies >= low) & (frequencies <= high)
    return inside


def _slope(force: Real, amplitude: Real, relative: Real, apart: float) -> tuple[float, float]:
    """Return the weighted slope of the logarithms and its standard error, enlarged by the misfit of the line."""
    if len(force) < 2 or np.ptp(np.log(force)) < apart:
        return float("nan"), float("nan")
    weight = 1 / np.maximum(relative, 1e-3) ** 2
    x, y = np.log(force), np.log(amplitude)
    x0, y0 = np.average(x, weights=weight), np.average(y, weights=weight)
    size = float(np.sum(weight * (x - x0) ** 2))
    slope = float(np.sum(weight * (x - x0) * (y - y0)) / size)
    error = 1 / np.sqrt(size)
    if len(force) > 2:
        misfit = np.sum(weight * (y - y0 - slope * (x - x0)) ** 2) / (len(force) - 2)
        error *= np.sqrt(max(1.0, float(misfit)))
    return slope, float(error)
