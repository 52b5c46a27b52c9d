"""What an explanation is worth on a recording that it was not fitted to."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft
from scipy.stats import wilcoxon

from estimation import WindowedSpectrum

from ...faults.shown_faults import FAULTS, with_faults
from ...inference.diagnosis import AcceptedCause, Improvement
from ...inference.process_pool import side_by_side
from ...models.fitting import Fit, fit
from ...models.hypothesis import Explanation, predict_lines
from ...models.misfit import least_misfit, through_structure
from ...noise.noise_model import NoiseModel, whitening
from .acceptance import HELD_OUT
from .pruning import zero_of

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

BLOCK = 2.0
"""Length of a block for the test of significance, s."""

ITERATIONS = 30
"""At most: without the causes the modes may have far to go."""

DRAWS = 1000
"""Of the bootstrap over blocks."""


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


@dataclass(frozen=True)
class Recordings:
    """The same recordings twice.

    Parameters
    ----------
    mended
        Without tones, clipped samples put back: what causes are fitted to. Weakest first.
    measured
        As they were measured: what errors are counted on.
    """

    mended: list[WindowedSpectrum]
    measured: list[WindowedSpectrum]

    @property
    def kept(self) -> int:
        """Number of the one that is held out: the middle level, of two the weaker, so that the others bracket it."""
        return (len(self.mended) - 1) // 2

    def others(self, which: list[WindowedSpectrum]) -> list[WindowedSpectrum]:
        """All but that one; all where there is only one."""
        return [one for k, one in enumerate(which) if k != self.kept] or which


def held_out_improvement(
    recordings: Recordings, final: Explanation, noises: tuple[NoiseModel, ...], causes: Sequence[AcceptedCause] = ()
) -> HeldOut:
    """Fit on all recordings but one, compare errors on that one as it was measured.

    With a single recording nothing can be held out; errors are then those of the fit, the p-value is 1.

    Parameters
    ----------
    recordings
        Mended and as measured.
    final
        What was found on all of them; its numbers are fitted anew on the others.
    noises
        From the fit on all.
    causes
        Accepted ones; of them the plain faults, which are no part of ``final``, are put into what it predicts.
    """
    nominal = zero_of(final.shape)
    mended, measured = recordings.others(recordings.mended), recordings.others(recordings.measured)
    tasks = [partial(fit, measured, nominal, iterations=ITERATIONS)]
    if final.causes or final.shape.added or any(a is not b for a, b in zip(mended, measured, strict=True)):
        tasks.append(partial(fit, mended, final, iterations=ITERATIONS))
    fitted: list[Fit] = side_by_side(tasks)
    return scored(recordings, (fitted[0].explanation, fitted[-1].explanation), noises, causes)


def scored(
    recordings: Recordings,
    elsewhere: tuple[Explanation, Explanation],
    noises: tuple[NoiseModel, ...],
    causes: Sequence[AcceptedCause],
) -> HeldOut:
    """Errors, and what is tested on them, of modal parameters alone and of the whole, both fitted to the others."""
    linear, improved = elsewhere
    here, kept = recordings.measured[recordings.kept], recordings.kept
    faults = [cause for cause in causes if cause.name in FAULTS]
    rests = [
        residual_lines(zero_of(improved.shape), here),
        residual_lines(linear, here),
        residual_lines(improved, here, faults),
    ]
    covariance = noises[kept].covariance(here.frequencies, through_structure(improved, here))
    power = float(np.sum(np.abs(here.measured) ** 2))
    before, refitted, after = (float(np.sqrt(np.sum(np.abs(rest) ** 2) / power)) for rest in rests)
    whole = improved is not linear
    evidence = 0.0
    if len(recordings.mended) > 1 and whole:
        mended = recordings.mended[kept]
        evidence = least_misfit(linear, mended) - least_misfit(improved, mended)
    against = "refitted" if whole and (faults or evidence > HELD_OUT) else "nominal"
    rival = rests[1] if against == "refitted" else rests[0]
    improvement = Improvement(
        here.recording.name,
        before,
        refitted,
        after,
        float(np.sqrt(np.sum(np.trace(covariance, axis1=1, axis2=2).real) / power)),
        chance_of_no_gain(here, covariance, rival, rests[2]) if len(recordings.mended) > 1 else 1.0,
        _interval(block_powers(here, rests[0]), block_powers(here, rests[2])),
        evidence,
        against,
    )
    return HeldOut(improvement, linear, improved)


def residual_lines(explanation: Explanation, lines: WindowedSpectrum, faults: Sequence[AcceptedCause] = ()) -> Complex:
    """What an explanation, with plain faults, leaves of a recording, (n_lines, n_responses)."""
    predicted = predict_lines(explanation, lines)
    if not faults:
        return lines.measured - predicted.response
    signal = np.asarray(irfft(predicted.spectrum, n=lines.padded, axis=0)[: len(lines.recording.force)])
    return lines.measured - lines.cut(
        with_faults(signal, lines.recording, lines.start, [asdict(one) for one in faults])
    )


def chance_of_no_gain(lines: WindowedSpectrum, covariance: Complex, rival: Complex, final: Complex) -> float:
    """p-value of a paired test over blocks of time that the final residual is no smaller than a rival's.

    Both are whitened by the same noise (V: (n_lines, n_responses, n_responses)), so that a quiet channel counts as much
    as a loud one (Wilcoxon's signed ranks).
    """
    white = whitening(covariance)
    powers = [block_powers(lines, np.einsum("kij,kj->ki", white, rest)) for rest in (rival, final)]
    difference = powers[0] - powers[1]
    return float(wilcoxon(difference, alternative="greater").pvalue) if difference.any() else 1.0


def block_powers(lines: WindowedSpectrum, rest: Complex) -> Real:
    """Power of residual lines in blocks of time, (n_blocks,): their sum is that of the lines (Parseval)."""
    spectrum = np.zeros((len(lines.window) // 2 + 1, rest.shape[1]), dtype=complex)
    spectrum[lines.band] = rest
    signal = irfft(spectrum, n=len(lines.window), axis=0)
    return np.array([np.sum(signal[block] ** 2) for block in block_slices(lines)]) * len(lines.window) / 2


def block_slices(lines: WindowedSpectrum) -> list[slice]:
    """Blocks of time of the part of a recording that is compared."""
    count = max(2, round(len(lines.window) / lines.recording.rate / BLOCK))
    edges = np.linspace(0, len(lines.window), count + 1).astype(int)
    return [slice(int(a), int(b)) for a, b in pairwise(edges)]


def _interval(before: Real, after: Real) -> tuple[float, float]:
    """95 % bootstrap interval of the ratio of errors over blocks."""
    draw = np.random.default_rng(0).integers(0, len(before), (DRAWS, len(before)))
    ratio = np.sqrt(after[draw].sum(axis=1) / before[draw].sum(axis=1))
    low, high = np.quantile(ratio, [0.025, 0.975])
    return float(low), float(high)
