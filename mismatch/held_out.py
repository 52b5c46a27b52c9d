"""What an explanation is worth on a recording that it was not fitted to."""

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft
from scipy.stats import wilcoxon

from .assessment import least_misfit, through_structure
from .diagnosis import Improvement
from .explanation import Explanation, predict_lines
from .fitting import fit
from .noise_model import NoiseModel
from .pruning import zero_of
from .side_by_side import side_by_side
from .windowed_lines import WindowedLines

Real = NDArray[np.float64]

BLOCK = 2.0
"""Length of a block for the test of significance, s."""

ITERATIONS = 30
"""At most: without the causes the modes may have far to go."""


@dataclass(frozen=True)
class HeldOut:
    """What an explanation is worth elsewhere.

    Parameters
    ----------
    improvement
        Errors on the recording held out.
    linear, improved
        Modal parameters alone, and the whole explanation, fitted to the other recordings.
    """

    improvement: Improvement
    linear: Explanation
    improved: Explanation


def held_out_improvement(lines: list[WindowedLines], final: Explanation, noises: tuple[NoiseModel, ...]) -> HeldOut:
    """Fit on all recordings but one, compare errors on that one.

    The middle level is held out (of two, the weaker), so that the others bracket it. With a single recording nothing
    can be held out; errors are then those of the fit, the p-value is 1.

    Parameters
    ----------
    lines
        Recordings, weakest first.
    final
        What was found on all of them; its numbers are fitted anew on the others.
    noises
        From the fit on all.
    """
    nominal = zero_of(final.shape)
    kept = (len(lines) - 1) // 2
    others = [one for k, one in enumerate(lines) if k != kept] or lines
    starts = [nominal, final] if final.causes or final.shape.added else [nominal]
    tasks = [partial(fit, others, start, iterations=ITERATIONS) for start in starts]
    fitted = [one.explanation for one in side_by_side(tasks)]
    linear, improved = fitted[0], fitted[-1]
    here = lines[kept]
    blocks = [_block_errors(explanation, here) for explanation in (nominal, linear, improved)]
    power = float(np.sum(np.abs(here.measured) ** 2))
    errors = [_line_error(explanation, here) for explanation in (nominal, linear, improved)]
    floor = np.trace(noises[kept].covariance(here.frequencies, through_structure(final, here)), axis1=1, axis2=2)
    p_value, evidence = 1.0, 0.0
    if len(lines) > 1 and improved is not linear:
        p_value = float(wilcoxon(blocks[1] - blocks[2], alternative="greater").pvalue)
        evidence = least_misfit(linear, here) - least_misfit(improved, here)
    improvement = Improvement(
        here.trial.name,
        errors[0],
        errors[1],
        errors[2],
        float(np.sqrt(np.sum(floor.real) / power)),
        p_value,
        _interval(blocks[0], blocks[2]),
        evidence,
    )
    return HeldOut(improvement, linear, improved)


def _line_error(explanation: Explanation, lines: WindowedLines) -> float:
    rest = lines.measured - predict_lines(explanation, lines).response
    return float(np.sqrt(np.sum(np.abs(rest) ** 2) / np.sum(np.abs(lines.measured) ** 2)))


def _block_errors(explanation: Explanation, lines: WindowedLines) -> Real:
    """Squared error in blocks of time, all channels in units of their own power, (n_blocks,)."""
    spectrum = predict_lines(explanation, lines).spectrum
    n = len(lines.trial.force)
    frequencies = lines.padded_frequencies
    inside = (frequencies >= lines.frequencies[0]) & (frequencies <= lines.frequencies[-1])
    shown = irfft(spectrum * inside[:, None], n=lines.padded, axis=0)[:n]
    measured = irfft(
        np.fft.rfft(lines.trial.response, n=lines.padded, axis=0) * inside[:, None], n=lines.padded, axis=0
    )
    rest = (measured[:n] - shown)[lines.start : n - int(lines.trial.rate)]
    size = np.mean(measured[lines.start : n] ** 2, axis=0)
    length = int(BLOCK * lines.trial.rate)
    count = len(rest) // length
    return np.asarray((rest[: count * length] ** 2 / size).reshape(count, -1).mean(axis=1))


def _interval(before: Real, after: Real) -> tuple[float, float]:
    """95 % bootstrap interval of the ratio of errors over blocks."""
    draw = np.random.default_rng(0).integers(0, len(before), (1000, len(before)))
    ratio = np.sqrt(after[draw].sum(axis=1) / before[draw].sum(axis=1))
    low, high = np.quantile(ratio, [0.025, 0.975])
    return float(low), float(high)
