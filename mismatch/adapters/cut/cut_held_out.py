"""Error of a computed cutting force on blocks of time that it was not fitted to."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student
from scipy.stats import ttest_1samp

from ...inference.diagnosis import Improvement
from .cut_fit import CutFit, fit_cut
from .cut_setting import Attempt, CutSetting

Real = NDArray[np.float64]

FOLDS = (slice(0, None, 2), slice(1, None, 2))
"""Every other block; each half is tested with numbers fitted to the other."""

SIGNIFICANT = 0.01
"""Chance below which the error of blocks held out is taken to have fallen."""

Halves = tuple[CutFit, CutFit]


def fit_halves(setting: CutSetting, start: Attempt, freed: Sequence[str], *, refit: bool = True) -> Halves:
    """The same fit to either half of the blocks."""
    first, second = (fit_cut(setting, start, freed, part=part, refit=refit) for part in FOLDS)
    return first, second


def held_out_gain(without: Halves, with_it: Halves) -> float:
    """Gain in misfit on the blocks that were not fitted, both halves together."""
    return float(np.sum(_tested(without) - _tested(with_it)))


def improvement(setting: CutSetting, nominal: Halves, base: Halves, final: Halves) -> Improvement:
    """Errors on blocks that were not fitted, relative to the force.

    Parameters
    ----------
    setting
        All blocks.
    nominal, base, final
        As the file says, coefficients refitted, with causes.
    """
    before, refitted, after = (_powers(setting, one) for one in (nominal, base, final))
    total = sum(float(np.sum(np.abs(lines.measured) ** 2)) for lines in setting.lines)
    floor = sum(noise.floor.sum() * lines.blocks for noise, lines in zip(setting.noise, setting.lines, strict=True))
    gains = _tested(base) - _tested(final)
    p_value = _chance(_tested(base), _tested(final))
    names = ", ".join(lines.recording.name for lines in setting.lines)
    errors = [float(np.sqrt(one.sum() / total)) for one in (before, refitted, after)]
    return Improvement(
        f"{names}: every other block of time",
        errors[0],
        errors[1],
        errors[2],
        float(np.sqrt(floor / total)),
        p_value,
        _interval(np.sqrt(after / before)),
        float(gains.sum()),
    )


def lowers(setting: CutSetting, without: Halves, with_it: Halves) -> bool:
    """Whether the error of the force on blocks that were not fitted falls, and by more than chance."""
    falls = float(_powers(setting, with_it).sum()) < float(_powers(setting, without).sum())
    return falls and _chance(_tested(without), _tested(with_it)) < SIGNIFICANT


def _chance(without: Real, with_it: Real) -> float:
    """p-value that the misfit of blocks does not fall: Student's test of its fall."""
    gains = without - with_it
    return float(ttest_1samp(gains, 0.0, alternative="greater").pvalue) if np.ptp(gains) > 0 else 1.0


def _tested(halves: Halves) -> Real:
    """Misfit of every block by the fit that did not see it."""
    parts = [one[part] for fitted, part in zip(halves, FOLDS[::-1], strict=True) for one in fitted.block_misfits]
    return np.concatenate(parts)


def _powers(setting: CutSetting, halves: Halves) -> Real:
    """Power of the residual in each block by the fit that did not see it."""
    parts = []
    for fitted, part in zip(halves, FOLDS[::-1], strict=True):
        for k, lines in enumerate(setting.lines):
            rest = (lines.measured - setting.shown(k, fitted.attempt))[part]
            parts.append(np.sum(np.abs(rest) ** 2, axis=(1, 2)))
    return np.concatenate(parts)


def _interval(ratios: Real) -> tuple[float, float]:
    """95 % interval of the mean ratio, on a logarithmic scale."""
    logs = np.log(ratios)
    half = float(student.ppf(0.975, len(logs) - 1) * logs.std(ddof=1) / np.sqrt(len(logs)))
    return float(np.exp(logs.mean() - half)), float(np.exp(logs.mean() + half))
