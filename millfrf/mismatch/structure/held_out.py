"""What a hypothesis about a structure is worth on a recording that it was not fitted to."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
import scipy

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real

from ..faults.clipping_repair import residual_lines
from ..inference.diagnosis import AcceptedCause, Improvement
from ..inference.paired_tests import ratio_interval
from ..inference.process_pool import in_processes
from ..inference.settings import ProofSettings
from ..models.fitting import Fit, fit
from ..models.hypothesis import Hypothesis
from ..models.misfit import fitted_noise, known_noise, least_misfit, shares_left, through_structure
from ..models.refinement import plain_fit
from ..noise.noise_model import NoiseModel, whitening
from ..records.held_out_parts import Recordings

RUNS_AWAY = 10.0
"""Error, over the response, that a prediction is told to have that runs away when it is simulated."""

BLOCK, FEWEST = 2.0, 8
"""Length of a block for the test of significance, s, and least number: of fewer, ranks hardly say less than 1 %."""

ITERATIONS = 30
"""Steps at most: without the causes the modes may have far to go."""


@dataclass(frozen=True)
class HeldOut:
    """What a hypothesis is worth elsewhere.

    Parameters
    ----------
    improvement
        Errors on the recording held out.
    linear, improved
        Modal parameters alone, and the whole hypothesis, fitted to what was not held out.
    everywhere
        The same errors as root mean squares over all recordings, where a part of each is held out.
    measured
        Whether the noise in the recording held out was measured, and not inferred from what a model leaves.
    """

    improvement: Improvement
    linear: Hypothesis
    improved: Hypothesis
    everywhere: Improvement
    measured: bool

    def leaves_less_than(self, other: "HeldOut") -> bool:
        """Whether less is left of what was held out, both where errors are told and in all recordings together."""
        pairs = (self.improvement, other.improvement), (self.everywhere, other.everywhere)
        return all(mine.after < theirs.after for mine, theirs in pairs)


def recordings_of(mended: list[WindowedSpectrum], measured: list[WindowedSpectrum], base: Hypothesis) -> Recordings:
    """The recordings, and which of them modal parameters alone follow worst.

    Parameters
    ----------
    mended
        Recordings without tones and with clipped samples put back, weakest first.
    measured
        The same recordings as they were measured.
    base
        Modal parameters alone, fitted to all of them.
    """
    left = [float(np.mean(shares_left(base, one))) for one in mended]
    return Recordings(mended, measured, int(np.argmax(left)))


def held_out_improvement(
    recordings: Recordings,
    final: Hypothesis,
    noises: tuple[NoiseModel, ...],
    faults: Sequence[AcceptedCause],
    settings: ProofSettings,
    linear: Hypothesis | None = None,
) -> HeldOut:
    """Fit on all recordings but one, and compare errors on that one as it was measured.

    Two recordings, or one, are fitted in their first and last quarters. They are compared in the middle half of that
    which modal parameters alone follow worst.
    Of a single short one nothing can be held out: errors are then those of the fit, the p-value is 1.

    Modal parameters alone are fitted twice, under inferred noise and by plain least squares: inferred noise makes loud
    recordings count little that a model predicts badly. The better of both on what was held out is the rival.

    Parameters
    ----------
    recordings
        The recordings, mended and as measured.
    final
        Hypothesis that was found on all recordings; its numbers are fitted anew on the others.
    noises
        Noise of every recording from the fit on all.
    faults
        Faults of the recordings, which are put into what ``final`` predicts.
    settings
        Thresholds of the proof on held-out blocks.
    linear
        Modal parameters alone as they were fitted to the other recordings before; None: they are fitted here.
    """
    mended, measured = recordings.others(recordings.mended), recordings.others(recordings.measured)
    caused = bool(final.causes) or any(a is not b for a, b in zip(mended, measured, strict=True))
    rivals: list[Callable[..., Fit]] = [] if linear is not None else [fit, plain_fit] if caused else [fit]
    tasks = [partial(one, measured, final.nominal, iterations=ITERATIONS) for one in rivals]
    if caused:
        tasks.append(partial(fit, mended, final, iterations=ITERATIONS))
    fitted: list[Hypothesis] = [one.hypothesis for one in in_processes(tasks)]
    if linear is None:
        linear = _better(fitted[: len(rivals)], recordings)
    return scored(recordings, (linear, fitted[-1] if caused else linear), noises, faults, settings)


def _better(refits: list[Hypothesis], recordings: Recordings) -> Hypothesis:
    """The refit that predicts what was held out with the smaller error: causes must beat the better one."""
    here = recordings.held_out(recordings.measured)
    return min(refits, key=lambda one: float(np.sum(np.abs(residual_lines(one, here)) ** 2)))


def scored(
    recordings: Recordings,
    elsewhere: tuple[Hypothesis, Hypothesis],
    noises: tuple[NoiseModel, ...],
    faults: Sequence[AcceptedCause],
    settings: ProofSettings,
) -> HeldOut:
    """Errors, and what is tested on them, of modal parameters alone and of the whole, both fitted to the others.

    Parameters
    ----------
    recordings
        The recordings, mended and as measured.
    elsewhere
        Modal parameters alone, and the whole hypothesis.
    noises
        Noise of every recording from the fit on all.
    faults
        Faults of the recordings.
    settings
        Thresholds of the proof on held-out blocks.
    """
    linear, improved = elsewhere
    place = recordings.held_out_place
    here = recordings.held_out(recordings.measured)
    rests = [
        residual_lines(improved.nominal, here),
        residual_lines(linear, here),
        residual_lines(improved, here, faults),
    ]
    through = through_structure(improved, here)
    covariance = fitted_noise(here, through, noises[place])
    floor = known_noise(here, through, noises[place])
    power = float(np.sum(np.abs(here.measured) ** 2))
    runs_away = not np.isfinite(rests[2]).all()
    rests = [np.where(np.isfinite(rest), rest, RUNS_AWAY * np.abs(here.measured)) for rest in rests]
    before, refitted, after = (float(np.sqrt(np.sum(np.abs(rest) ** 2) / power)) for rest in rests)
    whole, tested = improved is not linear, recordings.tested
    evidence = 0.0
    if tested and whole and not runs_away:
        evidence = _evidence(recordings, linear, improved)
    against = "refitted" if whole and (faults or evidence > settings.gain) else "nominal"
    rival = rests[1] if against == "refitted" else rests[0]
    improvement = Improvement(
        here.recording.name,
        before,
        refitted,
        after,
        float(np.sqrt(np.sum(np.trace(floor, axis1=1, axis2=2).real) / power)),
        chance_of_no_gain(here, covariance, rival, rests[2], settings) if tested else 1.0,
        ratio_interval(block_powers(here, rests[0]), block_powers(here, rests[2])),
        evidence,
        against,
        _part_in_words(here) if recordings.in_part else "",
    )
    everywhere = _everywhere(recordings, elsewhere, noises, faults, improvement)
    return HeldOut(improvement, linear, improved, everywhere, here.noise is not None)


def _evidence(recordings: Recordings, linear: Hypothesis, improved: Hypothesis) -> float:
    """Gain in misfit on everything held out: a refit that follows one level and gives the other up is no rival."""
    parts = [recordings.held_out(recordings.mended), *recordings.held_out_elsewhere(recordings.mended).values()]
    misfits = [sum(least_misfit(one, part) for part in parts) for one in (linear, improved)]
    return float(misfits[0] - misfits[1]) if np.isfinite(misfits[1]) else -np.inf


def _everywhere(
    recordings: Recordings,
    elsewhere: tuple[Hypothesis, Hypothesis],
    noises: tuple[NoiseModel, ...],
    faults: Sequence[AcceptedCause],
    first: Improvement,
) -> Improvement:
    """Errors as root mean squares over everything that was held out; those of ``first`` are known."""
    linear, improved = elsewhere
    rows = [(first.before, first.refitted, first.after, first.noise_floor)]
    for place, here in recordings.held_out_elsewhere(recordings.measured).items():
        rests = [residual_lines(improved.nominal, here), residual_lines(linear, here)]
        rests.append(residual_lines(improved, here, faults))
        floor = known_noise(here, through_structure(improved, here), noises[place])
        powers = [float(np.sum(np.abs(rest) ** 2)) for rest in rests] + [np.trace(floor, axis1=1, axis2=2).real.sum()]
        shares = np.sqrt(np.array(powers) / np.sum(np.abs(here.measured) ** 2))
        rows.append(tuple(np.where(np.isfinite(shares), shares, RUNS_AWAY)))
    before, refitted, after, noise = (float(one) for one in np.sqrt(np.mean(np.square(rows), axis=0)))
    return replace(first, before=before, refitted=refitted, after=after, noise_floor=noise)


def _part_in_words(lines: WindowedSpectrum) -> str:
    """Where a part of a recording lies, as the report says it."""
    edges = np.array([lines.start, lines.start + len(lines.window)]) / lines.recording.rate
    return f"from {edges[0]:.3g} to {edges[1]:.3g} s"


def chance_of_no_gain(
    lines: WindowedSpectrum, covariance: Complex, rival: Complex, final: Complex, settings: ProofSettings
) -> float:
    """p-value over blocks of time that the final residual is no smaller than a rival's.

    Both are whitened by the same noise, so that a quiet channel counts as much as a loud one.

    Parameters
    ----------
    lines
        Windowed lines of the recording.
    covariance : (n_lines, n_responses, n_responses)
        Covariance of its noise.
    rival, final : (n_lines, n_responses)
        Residual lines of both hypotheses.
    settings
        Thresholds of the proof, with the paired test.
    """
    white = whitening(covariance)
    rival_power, power = (block_powers(lines, np.einsum("kij,kj->ki", white, rest)) for rest in (rival, final))
    return settings.test(rival_power, power)


def block_powers(lines: WindowedSpectrum, rest: Complex) -> Real:
    """Power of residual lines in blocks of time, (n_blocks,): their sum is that of the lines (Parseval).

    Parameters
    ----------
    lines
        Windowed lines of the recording.
    rest : (n_lines, n_responses)
        Residual lines, in the units of the responses.
    """
    spectrum = np.zeros((len(lines.window) // 2 + 1, rest.shape[1]), dtype=complex)
    spectrum[lines.band] = rest
    signal = scipy.fft.irfft(spectrum, n=len(lines.window), axis=0)
    return np.array([np.sum(signal[block] ** 2) for block in block_slices(lines)]) * len(lines.window) / 2


def block_slices(lines: WindowedSpectrum) -> list[slice]:
    """Blocks of time of the part of a recording that is compared.

    Parameters
    ----------
    lines
        Windowed lines of the recording.
    """
    count = max(FEWEST, round(len(lines.window) / lines.recording.rate / BLOCK))
    edges = np.linspace(0, len(lines.window), count + 1).astype(int)
    return [slice(int(a), int(b)) for a, b in pairwise(edges)]
