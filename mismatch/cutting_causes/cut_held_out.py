"""Error of a computed cutting force on blocks of time that it was not fitted to."""

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student
from scipy.stats import ttest_1samp

from ..diagnosis import Improvement
from .cut_fit import CutFit
from .cut_setting import Attempt, CutSetting

Real = NDArray[np.float64]

FITTED, TESTED = slice(0, None, 2), slice(1, None, 2)
"""Every other block is fitted, the ones between are tested."""


def held_out_gain(without: CutFit, with_it: CutFit) -> float:
    """Gain in misfit on the tested blocks."""
    pairs = zip(without.block_misfits, with_it.block_misfits, strict=True)
    return float(sum(np.sum(one[TESTED] - other[TESTED]) for one, other in pairs))


def improvement(setting: CutSetting, nominal: CutFit, base: CutFit, final: CutFit) -> Improvement:
    """Errors on the tested blocks, relative to the force; fits must have been made without these.

    Parameters
    ----------
    setting
        All blocks.
    nominal, base, final
        As the file says, coefficients refitted, with causes.
    """
    before, refitted, after = (_powers(setting, one.attempt) for one in (nominal, base, final))
    forces = [np.abs(lines.measured[TESTED]) ** 2 for lines in setting.lines]
    total = sum(float(one.sum()) for one in forces)
    floors = [noise.floor.sum() * len(one) for noise, one in zip(setting.noise, forces, strict=True)]
    pairs = zip(base.block_misfits, final.block_misfits, strict=True)
    gains = np.concatenate([one[TESTED] - other[TESTED] for one, other in pairs])
    p_value = float(ttest_1samp(gains, 0.0, alternative="greater").pvalue) if np.ptp(gains) > 0 else 1.0
    names = ", ".join(lines.recording.name for lines in setting.lines)
    return Improvement(
        f"{names}, every other block",
        *(float(np.sqrt(one.sum() / total)) for one in (before, refitted, after)),
        float(np.sqrt(sum(floors) / total)),
        p_value,
        _interval(np.sqrt(after / before)),
        float(gains.sum()),
    )


def _powers(setting: CutSetting, attempt: Attempt) -> Real:
    """Power of the residual in each tested block of all recordings."""
    rests = [
        lines.measured[TESTED] - setting.shown(k, attempt)[TESTED] for k, lines in enumerate(setting.lines)
    ]
    return np.concatenate([np.sum(np.abs(rest) ** 2, axis=(1, 2)) for rest in rests])


def _interval(ratios: Real) -> tuple[float, float]:
    """95 % interval of the mean ratio, on a logarithmic scale."""
    logs = np.log(ratios)
    half = float(student.ppf(0.975, len(logs) - 1) * logs.std(ddof=1) / np.sqrt(len(logs)))
    return float(np.exp(logs.mean() - half)), float(np.exp(logs.mean() + half))
