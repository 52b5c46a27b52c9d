"""Errors of a hypothesis on a recording to which it was not fitted, and the causes that these errors confirm."""

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
from ..inference.numerics import ratio_interval
from ..inference.search import Search, in_processes, without_cause, without_causes
from ..inference.settings import ProofSettings, Settings
from ..models.fitting import Fit, Rival, fit, plain_fit
from ..models.hypothesis import Hypothesis
from ..models.misfit import fitted_noise, known_noise, least_misfit, relative_residual_power, through_structure
from ..records.bands import Recordings
from ..records.noise_model import NoiseModel, whitening
from .acceptance import modes_outside_band
from .comparison import StructureComparison
from .confirmed_preloads import with_confirmed_preloads

DIVERGED_ERROR = 10.0  # error, as a share of the response, that is reported for a prediction that diverges

# length of a block of the significance test, s, and least number of blocks: with fewer, p-values stay above 1 %
BLOCK, MIN_BLOCKS = 2.0, 8

NOT_CONFIRMED = "not confirmed"  # stage of a candidate that held-out data do not confirm

ITERATIONS = 30  # most steps of a fit: without the causes the modes may need large changes


@dataclass(frozen=True)
class HeldOut:
    """Errors of a hypothesis on data to which it was not fitted."""

    improvement: Improvement  # errors on the held-out recording
    # modal parameters alone, and the complete hypothesis, fitted to the other data
    linear: Hypothesis
    improved: Hypothesis
    everywhere: Improvement  # the same errors as root mean squares over all recordings, if a part of each is held out
    measured: bool  # whether the noise of the held-out recording was measured, not inferred from a residual

    def leaves_less_than(self, other: "HeldOut") -> bool:
        """Return whether the reported error and the error over all recordings are both smaller than in ``other``."""
        pairs = (self.improvement, other.improvement), (self.everywhere, other.everywhere)
        return all(own.after < compared.after for own, compared in pairs)


def recordings_of(repaired: list[WindowedSpectrum], measured: list[WindowedSpectrum], base: Hypothesis) -> Recordings:
    """Return the recordings, weakest first, with the one that modal parameters alone fit worst as the chosen one."""
    residual_powers = [float(np.mean(relative_residual_power(base, recording))) for recording in repaired]
    return Recordings(repaired, measured, int(np.argmax(residual_powers)))


def held_out_improvement(
    recordings: Recordings,
    final: Hypothesis,
    noises: tuple[NoiseModel, ...],
    faults: Sequence[AcceptedCause],
    settings: ProofSettings,
    linear: Hypothesis | None = None,
) -> HeldOut:
    """Fit to all recordings except one, and compute the errors on the held-out recording as it was measured.

    One or two recordings are fitted in their first and last quarters, and the errors are computed in the middle half of
    the recording that modal parameters alone fit worst. Nothing can be held out of a single short recording: its errors
    are the errors of the fit, and the p-value is 1.

    Modal parameters alone are fitted twice, with inferred noise and by plain least squares, as inferred noise gives
    little weight to loud recordings that a model predicts badly. The fit with the smaller held-out error is the rival.

    ``linear``: modal parameters alone as they were fitted to the other recordings before; None: they are fitted here.
    """
    repaired, measured = recordings.others(recordings.repaired), recordings.others(recordings.measured)
    has_causes = bool(final.causes) or any(a is not b for a, b in zip(repaired, measured, strict=True))
    rivals: list[Callable[..., Fit]] = [] if linear is not None else [fit, plain_fit] if has_causes else [fit]
    tasks = [partial(rival_fit, measured, final.nominal, iterations=ITERATIONS) for rival_fit in rivals]
    if has_causes:
        tasks.append(partial(fit, repaired, final, iterations=ITERATIONS))
    fitted: list[Hypothesis] = [result.hypothesis for result in in_processes(tasks)]
    if linear is None:
        linear = _better(fitted[: len(rivals)], recordings)
    return scored(recordings, (linear, fitted[-1] if has_causes else linear), noises, faults, settings)


def _better(refits: list[Hypothesis], recordings: Recordings) -> Hypothesis:
    """Return the refit with the smaller held-out error."""
    held_out = recordings.held_out(recordings.measured)
    return min(refits, key=lambda refit: float(np.sum(np.abs(residual_lines(refit, held_out)) ** 2)))


def scored(
    recordings: Recordings,
    elsewhere: tuple[Hypothesis, Hypothesis],
    noises: tuple[NoiseModel, ...],
    faults: Sequence[AcceptedCause],
    settings: ProofSettings,
) -> HeldOut:
    """Return the held-out errors of modal parameters alone and of the complete hypothesis, and compare them by a test.

    ``elsewhere`` holds both hypotheses as they were fitted to the other data.
    """
    linear, improved = elsewhere
    place = recordings.held_out_place
    held_out_lines = recordings.held_out(recordings.measured)
    residuals = [
        residual_lines(improved.nominal, held_out_lines),
        residual_lines(linear, held_out_lines),
        residual_lines(improved, held_out_lines, faults),
    ]
    through = through_structure(improved, held_out_lines)
    covariance = fitted_noise(held_out_lines, through, noises[place])
    floor = known_noise(held_out_lines, through, noises[place])
    power = float(np.sum(np.abs(held_out_lines.measured) ** 2))
    diverges = not np.isfinite(residuals[2]).all()
    residuals = [
        np.where(np.isfinite(residual), residual, DIVERGED_ERROR * np.abs(held_out_lines.measured))
        for residual in residuals
    ]
    before, refitted, after = (float(np.sqrt(np.sum(np.abs(residual) ** 2) / power)) for residual in residuals)
    has_causes, tested = improved is not linear, recordings.tested
    evidence = 0.0
    if tested and has_causes and not diverges:
        evidence = _evidence(recordings, linear, improved)
    against = "refitted" if has_causes and (faults or evidence > settings.gain) else "nominal"
    rival = residuals[1] if against == "refitted" else residuals[0]
    improvement = Improvement(
        held_out_lines.recording.name,
        before,
        refitted,
        after,
        float(np.sqrt(np.sum(np.trace(floor, axis1=1, axis2=2).real) / power)),
        chance_of_no_gain(held_out_lines, covariance, rival, residuals[2], settings) if tested else 1.0,
        ratio_interval(block_powers(held_out_lines, residuals[0]), block_powers(held_out_lines, residuals[2])),
        evidence,
        against,
        _part_description(held_out_lines) if recordings.in_part else "",
    )
    everywhere = _everywhere(recordings, elsewhere, noises, faults, improvement)
    return HeldOut(improvement, linear, improved, everywhere, held_out_lines.noise is not None)


def _evidence(recordings: Recordings, linear: Hypothesis, improved: Hypothesis) -> float:
    """Return the gain in misfit on all held-out data.

    Over all levels, a linear refit that fits only one level well does not win.
    """
    parts = [recordings.held_out(recordings.repaired), *recordings.held_out_elsewhere(recordings.repaired).values()]
    misfits = [sum(least_misfit(hypothesis, part) for part in parts) for hypothesis in (linear, improved)]
    return float(misfits[0] - misfits[1]) if np.isfinite(misfits[1]) else -np.inf


def _everywhere(
    recordings: Recordings,
    elsewhere: tuple[Hypothesis, Hypothesis],
    noises: tuple[NoiseModel, ...],
    faults: Sequence[AcceptedCause],
    first: Improvement,
) -> Improvement:
    """Return root mean square errors over all held-out data; ``first`` holds the known errors of the held-out one."""
    linear, improved = elsewhere
    rows = [(first.before, first.refitted, first.after, first.noise_floor)]
    for place, held_out_lines in recordings.held_out_elsewhere(recordings.measured).items():
        residuals = [residual_lines(improved.nominal, held_out_lines), residual_lines(linear, held_out_lines)]
        residuals.append(residual_lines(improved, held_out_lines, faults))
        floor = known_noise(held_out_lines, through_structure(improved, held_out_lines), noises[place])
        powers = [float(np.sum(np.abs(residual) ** 2)) for residual in residuals] + [
            np.trace(floor, axis1=1, axis2=2).real.sum()
        ]
        shares = np.sqrt(np.array(powers) / np.sum(np.abs(held_out_lines.measured) ** 2))
        rows.append(tuple(np.where(np.isfinite(shares), shares, DIVERGED_ERROR)))
    before, refitted, after, noise = (float(error) for error in np.sqrt(np.mean(np.square(rows), axis=0)))
    return replace(first, before=before, refitted=refitted, after=after, noise_floor=noise)


def _part_description(lines: WindowedSpectrum) -> str:
    """Return the time span of a part of a recording as text."""
    edges = np.array([lines.start, lines.start + len(lines.window)]) / lines.recording.rate
    return f"from {edges[0]:.3g} to {edges[1]:.3g} s"


def chance_of_no_gain(
    lines: WindowedSpectrum, covariance: Complex, rival: Complex, final: Complex, settings: ProofSettings
) -> float:
    """Return the p-value, from a test over blocks of time, that the final residual is no smaller than the rival's.

    Both residuals are whitened by the same noise, so that a quiet channel has the same weight as a loud one.

    ``covariance``: covariance of the noise, (n_lines, n_responses, n_responses). ``rival``, ``final``: residual lines
    of both hypotheses, (n_lines, n_responses).
    """
    white = whitening(covariance)
    rival_power, power = (block_powers(lines, np.einsum("kij,kj->ki", white, residual)) for residual in (rival, final))
    return settings.test(rival_power, power)


def block_powers(lines: WindowedSpectrum, residual: Complex) -> Real:
    """Return the power of the residual in each block of time, (n_blocks,).

    The sum over the blocks equals the power of the residual lines (Parseval).

    ``residual``: residual lines, in the units of the responses, (n_lines, n_responses).
    """
    spectrum = np.zeros((len(lines.window) // 2 + 1, residual.shape[1]), dtype=complex)
    spectrum[lines.band] = residual
    signal = scipy.fft.irfft(spectrum, n=len(lines.window), axis=0)
    return np.array([np.sum(signal[block] ** 2) for block in block_slices(lines)]) * len(lines.window) / 2


def block_slices(lines: WindowedSpectrum) -> list[slice]:
    """Return the blocks of time of the compared part of a recording, as slices of samples."""
    count = max(MIN_BLOCKS, round(len(lines.window) / lines.recording.rate / BLOCK))
    edges = np.linspace(0, len(lines.window), count + 1).astype(int)
    return [slice(int(a), int(b)) for a, b in pairwise(edges)]


# factor on the significance level for the second recording, which is chosen because the causes explain most of it
SECOND_RECORDING = 0.1

# A fit without a cause stops early if its score is clearly above the complete fit's: by this multiple of the evidence
# that a cause needs.
HOPELESS = 10.0


@dataclass(frozen=True)
class Confirmed:
    """Result of the test on a held-out recording."""

    search: Search[Fit]  # search without the causes that were not confirmed
    held_out: HeldOut
    recordings: Recordings


def confirmed(
    comparison: StructureComparison, recordings: Recordings, search: Search[Fit], faults: list[AcceptedCause]
) -> Confirmed:
    """Reject causes until the remaining ones lower the error of the held-out recording, together and each alone.

    Modes that are refitted to a weaker and a stronger level fit the level between them well, even if a law is missing.
    Suppose the causes have overwhelming evidence and gain on the held-out recording, but none is confirmed. Then the
    recording that the causes explain most is held out instead, at a tenth of the significance level.
    """
    proof = comparison.settings.proof
    recordings, search = with_confirmed_preloads(recordings, search, proof)
    last = search.current
    held_out = held_out_improvement(recordings, last.hypothesis, last.noises, faults, proof)
    first = _confirmed(comparison, recordings, search, faults, held_out)
    inconclusive = held_out.improvement.evidence > 0 and search.base.misfit - last.misfit > proof.overwhelming
    if first.search.accepted or len(recordings.repaired) < 3 or recordings.own_numbers or not inconclusive:
        return first
    gains = [_gain_of_causes(search, recording) for recording in recordings.repaired]
    elsewhere = replace(recordings, chosen=int(np.argmax(gains)))
    if elsewhere.held_out_place == recordings.held_out_place:
        return first
    stricter = replace(proof, significance=SECOND_RECORDING * proof.significance)
    stricter_comparison = replace(comparison, settings=replace(comparison.settings, proof=stricter))
    held_out = held_out_improvement(elsewhere, last.hypothesis, last.noises, faults, proof)
    second = _confirmed(stricter_comparison, elsewhere, search, faults, held_out)
    return second if second.search.accepted else first


def _gain_of_causes(search: Search[Fit], lines: WindowedSpectrum) -> float:
    """Return how much all causes lower the misfit of one recording, each hypothesis with its likeliest noise."""
    return least_misfit(search.base.hypothesis, lines) - least_misfit(search.current.hypothesis, lines)


def _confirmed(
    comparison: StructureComparison,
    recordings: Recordings,
    search: Search[Fit],
    faults: list[AcceptedCause],
    held_out: HeldOut,
) -> Confirmed:
    """Return the causes that the held-out recording confirms; ``held_out`` holds the errors with all causes."""
    proof = comparison.settings.proof
    while search.accepted and recordings.tested:
        unconfirmed = _unconfirmed_cause(comparison, recordings, search, held_out)
        if unconfirmed is None:
            break
        place, less = unconfirmed
        if not np.isfinite(less.score):
            # without the rejected cause the simulation diverges: none of the causes is reliable
            search = without_causes(search, NOT_CONFIRMED)
        else:
            search = without_cause(search, place, less, NOT_CONFIRMED, search.accepted[place].evidence)
        last = search.current
        held_out = held_out_improvement(recordings, last.hypothesis, last.noises, faults, proof, held_out.linear)
    return Confirmed(search, held_out, recordings)


def lowers_held_out_error(gain: Improvement, current: Fit, base: Fit, settings: Settings) -> bool:
    """Return whether the causes together lower the error of the held-out recording.

    Causes that gain by the prior alone need not predict better than refitted modes, which may imitate them exactly (for
    instance the gain of a sensor). They must predict better than the nominal model, and no worse than the refit if they
    gained more than chance.
    """
    if base.misfit - current.misfit < settings.evidence.least:
        return gain.after < gain.before
    if gains_by_prior_only(base, current, settings) and gain.after < gain.before and gain.evidence > 0:
        return True
    proof = settings.proof
    largest = min(proof.significance, proof.of_law) if current.hypothesis.laws else proof.significance
    return gain.evidence > proof.gain and gain.after < gain.refitted and gain.p_value < largest


def gains_by_prior_only(without: Fit, complete: Fit, settings: Settings) -> bool:
    """Return whether hardly any of the evidence of ``complete`` over ``without`` comes from a smaller misfit."""
    least = max(settings.evidence.least, settings.proof.belief_alone * (without.score - complete.score))
    return without.misfit - complete.misfit < least


def _unconfirmed_cause(
    comparison: StructureComparison, recordings: Recordings, search: Search[Fit], held_out: HeldOut
) -> tuple[int, Fit] | None:
    """Return the index of a cause that the held-out recording does not confirm, and the fit without it."""
    last, count = search.current, len(search.accepted)
    if outside := modes_outside_band(last.hypothesis, comparison.lines):
        return outside[-1], comparison.refitted_without(search, outside[-1]) if count > 1 else search.base
    if not lowers_held_out_error(held_out.improvement, last, search.base, comparison.settings):
        return count - 1, _before_last(comparison, search)
    if count == 1:
        return None
    others = recordings.others(recordings.repaired)
    complete = fit(others, held_out.improved, iterations=0)
    rival = Rival(complete, HOPELESS * comparison.needed(complete, search.base))
    without = [held_out.improved.without(k) for k in range(count)]
    tasks = [partial(fit, others, hypothesis, iterations=ITERATIONS, rival=rival) for hypothesis in without]
    for k, less in enumerate(in_processes(tasks)):
        if _is_confirmed(comparison, recordings, (complete, less), last, held_out):
            continue
        if k == count - 1:
            return k, _before_last(comparison, search)
        refitted = fit(recordings.repaired, last.hypothesis.without(k), last.noises, iterations=ITERATIONS)
        return k, refitted
    return None


def fit_without(comparison: StructureComparison, search: Search[Fit], place: int) -> Fit:
    """Fit without one cause; for the last cause, return the step before it was added if that fit is better.

    The remaining causes were fitted together with the last cause, and their simulation may diverge without it. The
    simulation of the step before does not diverge.
    """
    less = comparison.refitted_without(search, place)
    step = _step_before(search) if place == len(search.accepted) - 1 else None
    return less if step is None else min(less, step, key=lambda fitted: fitted.score)


def _before_last(comparison: StructureComparison, search: Search[Fit]) -> Fit:
    """Return the fit without the last cause: the step before if it has the same causes, otherwise a new fit."""
    step = _step_before(search)
    return comparison.refitted_without(search, len(search.accepted) - 1) if step is None else step


def _step_before(search: Search[Fit]) -> Fit | None:
    """Return the step before the last cause was added; None if one of its causes was rejected later."""
    step, others = search.steps[-2], search.current.hypothesis.causes[:-1]
    return step if [cause.physics for cause in step.hypothesis.causes] == [other.physics for other in others] else None


def _is_confirmed(
    comparison: StructureComparison, recordings: Recordings, fits: tuple[Fit, Fit], last: Fit, held_out: HeldOut
) -> bool:
    """Return whether the held-out error is smaller with a cause (first fit) than without it (second fit).

    A sweep passes a resonance once: a cause may halve the error in two or three blocks of time and change nothing in
    the others, so that a test over blocks is not significant. A halved error with an overwhelming likelihood is enough.
    """
    (complete, less), settings = fits, comparison.settings
    if not np.isfinite(less.score):
        # without the cause the simulation diverges
        return True
    if gains_by_prior_only(less, complete, settings):
        return less.score - complete.score > comparison.needed(less, less)
    place = recordings.held_out_place
    held_out_lines = recordings.held_out(recordings.repaired)
    residual, without = (
        residual_lines(held_out.improved, held_out_lines),
        residual_lines(less.hypothesis, held_out_lines),
    )
    covariance = fitted_noise(held_out_lines, through_structure(last.hypothesis, held_out_lines), last.noises[place])
    gain = least_misfit(less.hypothesis, held_out_lines) - least_misfit(held_out.improved, held_out_lines)
    if gain <= settings.proof.gain:
        return False
    size = np.mean(np.abs(held_out_lines.measured) ** 2, axis=0)
    powers = tuple(float(np.sum(np.abs(lines_left) ** 2 / size)) for lines_left in (residual, without))
    if clearly_halves(gain, powers, settings.proof):
        return True
    return (
        chance_of_no_gain(held_out_lines, covariance, without, residual, settings.proof) < settings.proof.significance
    )


def clearly_halves(gain: float, powers: tuple[float, ...], settings: ProofSettings) -> bool:
    """Return whether a cause is confirmed whatever the test over blocks yields.

    The gain in likelihood must be overwhelming and the error halved. ``powers`` are the powers of the residual with and
    without the cause.

    Examples
    --------
    >>> clearly_halves(5177.0, (18.2, 238.1), ProofSettings())
    True
    >>> clearly_halves(500.0, (18.2, 238.1), ProofSettings()) or clearly_halves(5177.0, (18.2, 40.0), ProofSettings())
    False
    """
    return gain > settings.overwhelming and powers[0] <= settings.halved**2 * powers[1]
