"""How one mode moves from level to level, and over the time of a recording."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import Real

from .level_refit import RefittedModes


@dataclass(frozen=True)
class ModeTrend:
    """One mode by level.

    Parameters
    ----------
    mode
        Number of the mode, from 1.
    levels : (n_levels,)
        Root mean square of what drives the rig, rising.
    frequencies, frequency_errors : (n_levels,), Hz
        Natural frequency at each level and its standard error.
    damping, damping_errors : (n_levels,)
        Damping ratio and its standard error.
    shift, shift_error
        Natural frequency at the highest level over that at the lowest, minus one, and its standard error.
    gain, gain_error
        Damping ratio at the highest level minus that at the lowest, over the lowest, and its standard error.
    p_values
        Probability of such a shift and of such a gain by their errors.
    drift_p_value
        Probability of such a drift of the frequency within recordings; nan where none could be seen.
    drift
        Change of the natural frequency over a recording, as a share, average over the recordings.
    family, sentence
        Family of the behaviour (:data:`FAMILIES`), and all of it in words.
    """

    mode: int
    levels: tuple[float, ...]
    frequencies: tuple[float, ...]
    frequency_errors: tuple[float, ...]
    damping: tuple[float, ...]
    damping_errors: tuple[float, ...]
    shift: float
    shift_error: float
    gain: float
    gain_error: float
    p_values: tuple[float, float]
    drift: float
    drift_p_value: float
    family: str = ""
    sentence: str = ""


def mode_trends(refits: Sequence[RefittedModes], apart: float) -> list[ModeTrend]:
    """Join recordings of nearly one level and compare levels, mode by mode.

    Within a level the mean is weighted by the errors; where its recordings disagree by more than their errors, the
    error of the mean grows in that proportion (Birge, Phys. Rev. 40, 207, 1932).

    Parameters
    ----------
    refits
        Modes of each recording.
    apart
        Ratio from which two levels are two.
    """
    groups = _grouped(sorted(refits, key=lambda one: one.level), apart)
    means = [_joined(group) for group in groups]
    levels = tuple(float(np.mean([one.level for one in group])) for group in groups)
    freedom = tuple(sum(one.freedom for one in group) for group in (groups[0], groups[-1]))
    drift, chance = _drift(refits)
    trends = []
    for r in range(refits[0].values.shape[1]):
        logs, errors = np.array([mean[0][:, r] for mean in means]), np.array([mean[1][:, r] for mean in means])
        shift, gain = logs[-1] - logs[0]
        errors_of = np.hypot(errors[-1], errors[0])
        several = len(groups) > 1
        lowest = max(float(logs[0, 1]), 1e-9)
        frequencies = np.exp(logs[:, 0]) / (2 * np.pi)
        trends.append(
            ModeTrend(
                r + 1,
                levels,
                _plain(frequencies),
                _plain(frequencies * errors[:, 0]),
                _plain(logs[:, 1]),
                _plain(errors[:, 1]),
                float(np.expm1(shift)) if several else 0.0,
                float(errors_of[0]),
                float(gain) / lowest if several else 0.0,
                float(errors_of[1]) / lowest,
                _chances(np.array([shift, gain]), errors[[0, -1]], freedom) if several else (1.0, 1.0),
                float(drift[r]),
                float(chance[r]),
            )
        )
    return trends


def _chances(change: Real, errors: Real, freedom: tuple[int, ...]) -> tuple[float, float]:
    """Chance of the change of ln frequency and of damping ratio (2,), with the errors of both levels (2, 2)."""
    first, last = (
        _chance(float(change[k] / np.hypot(*errors[:, k])), _welch(errors[:, k], (freedom[0], freedom[1])))
        for k in range(2)
    )
    return first, last


def _plain(values: Real) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def _grouped(refits: list[RefittedModes], apart: float) -> list[list[RefittedModes]]:
    """Recordings by level: each level begins where the drive is ``apart`` times that of the level's first."""
    groups: list[list[RefittedModes]] = []
    for one in refits:
        if groups and one.level < apart * groups[-1][0].level:
            groups[-1].append(one)
        else:
            groups.append([one])
    return groups


def _joined(group: list[RefittedModes]) -> tuple[Real, Real]:
    """Weighted mean of one level and its error, each (2, n_modes)."""
    values, errors = np.array([one.values for one in group]), np.array([one.errors for one in group])
    weight = 1 / np.maximum(errors, 1e-12) ** 2
    mean = np.sum(weight * values, axis=0) / weight.sum(axis=0)
    error = 1 / np.sqrt(weight.sum(axis=0))
    if len(group) > 1:
        disagreement = np.sum(weight * (values - mean) ** 2, axis=0) / (len(group) - 1)
        error = error * np.sqrt(np.maximum(1.0, disagreement))
    return mean, error


def _drift(refits: Sequence[RefittedModes]) -> tuple[Real, Real]:
    """Change of each frequency over a recording, weighted over recordings, and its chance; each (n_modes,)."""
    seen = [one for one in refits if np.isfinite(one.drift).all()]
    if not seen:
        nothing = np.full(refits[0].values.shape[1], np.nan)
        return nothing, nothing
    values = np.array([one.drift[0] for one in seen])
    weight = 1 / np.maximum(np.array([one.drift_errors[0] for one in seen]), 1e-12) ** 2
    mean = np.sum(weight * values, axis=0) / weight.sum(axis=0)
    error = 1 / np.sqrt(weight.sum(axis=0))
    if len(seen) > 1:
        error = error * np.sqrt(np.maximum(1.0, np.sum(weight * (values - mean) ** 2, axis=0) / (len(seen) - 1)))
    freedom = sum(one.freedom - 1 for one in seen)
    return np.asarray(mean), np.array([_chance(sigmas, freedom) for sigmas in mean / error])


def _chance(sigmas: float, freedom: float) -> float:
    """Chance of as many standard errors either way, where these were estimated themselves (Student's t)."""
    return float(2 * scipy.special.stdtr(freedom, -abs(sigmas)))


def _welch(errors: Real, freedom: tuple[int, int]) -> float:
    """Degrees of freedom of a difference of two means with errors (2,) (Welch, Biometrika 34, 28, 1947)."""
    first, last = np.maximum(errors, 1e-12) ** 2
    return float((first + last) ** 2 / (first**2 / freedom[0] + last**2 / freedom[1]))
