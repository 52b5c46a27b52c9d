"""Causes that a recording confirms to which they were not fitted; the others are let go of."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from estimation import WindowedSpectrum

from ..faults.clipping_repair import residual_lines
from ..inference.diagnosis import AcceptedCause, Improvement
from ..inference.process_pool import in_processes
from ..inference.search import Search, emptied, released
from ..inference.settings import ProofSettings, Settings
from ..models.fitting import Fit, Rival, fit
from ..models.misfit import fitted_noise, least_misfit, through_structure
from ..records.held_out_parts import Recordings
from .acceptance import modes_not_seen
from .comparison import StructureComparison
from .held_out import ITERATIONS, HeldOut, chance_of_no_gain, held_out_improvement

SECOND_CHANCE = 0.1
"""Share of the significance that a second recording must reach, which is the one that the causes explain best."""

FAR_BEHIND = 10.0
"""Evidence that a cause needs, times which a fit without it must come near to be followed to its end."""


@dataclass(frozen=True)
class Confirmed:
    """What a recording confirms to which it was not fitted.

    Parameters
    ----------
    found
        The search with fewer causes, or as it was.
    held_out
        What its causes are worth on the recording held out.
    recordings
        The recordings, and which of them was held out.
    """

    found: Search[Fit]
    held_out: HeldOut
    recordings: Recordings


def confirmed(
    comparison: StructureComparison, recordings: Recordings, found: Search[Fit], faults: list[AcceptedCause]
) -> Confirmed:
    """Let go of causes until those left lower the error of the recording held out, together and each beside the rest.

    Modes that are refitted to a weaker and a stronger level follow the one between them best, whatever law moves them.
    Where the middle level confirms nothing of overwhelming evidence, and does not speak against it, the recording of
    which the causes explain most is held out instead, and asked with a tenth of the chance.

    Parameters
    ----------
    comparison
        Thresholds and how fits without a cause are made.
    recordings
        The recordings, mended and as measured.
    found
        Where the search ended.
    faults
        Faults of the recordings.
    """
    last, proof = found.current, comparison.settings.proof
    held_out = held_out_improvement(recordings, last.hypothesis, last.noises, faults, proof)
    first = _confirmed(comparison, recordings, found, faults, held_out)
    unsure = held_out.improvement.evidence > 0 and found.base.misfit - last.misfit > proof.overwhelming
    if first.found.accepted or len(recordings.mended) < 3 or not unsure:
        return first
    explained = [_explained(found, one) for one in recordings.mended]
    elsewhere = replace(recordings, chosen=int(np.argmax(explained)))
    if elsewhere.held_out_place == recordings.held_out_place:
        return first
    stricter = replace(proof, significance=SECOND_CHANCE * proof.significance)
    again = replace(comparison, settings=replace(comparison.settings, proof=stricter))
    held_out = held_out_improvement(elsewhere, last.hypothesis, last.noises, faults, proof)
    second = _confirmed(again, elsewhere, found, faults, held_out)
    return second if second.found.accepted else first


def _explained(found: Search[Fit], lines: WindowedSpectrum) -> float:
    """Gain in misfit of one recording by all causes, each hypothesis under its likeliest noise."""
    return least_misfit(found.base.hypothesis, lines) - least_misfit(found.current.hypothesis, lines)


def _confirmed(
    comparison: StructureComparison,
    recordings: Recordings,
    found: Search[Fit],
    faults: list[AcceptedCause],
    held_out: HeldOut,
) -> Confirmed:
    """The causes that one recording confirms; ``held_out`` says what all of them are worth on it."""
    proof = comparison.settings.proof
    while found.accepted and recordings.tested:
        gone = _idle(comparison, recordings, found, held_out)
        if gone is None:
            break
        place, less = gone
        if not np.isfinite(less.score):
            # without it the rest runs away: nothing of what was found stands
            found = emptied(found, "not confirmed")
        else:
            found = released(found, place, less, "not confirmed", found.accepted[place].evidence)
        last = found.current
        held_out = held_out_improvement(recordings, last.hypothesis, last.noises, faults, proof, held_out.linear)
    return Confirmed(found, held_out, recordings)


def helps(gain: Improvement, current: Fit, base: Fit, settings: Settings) -> bool:
    """Whether the causes together lower the error of the held-out recording.

    Causes that gained little where they were fitted but stand nearer to the lab's belief than a general refit need not
    predict better than that; they must predict better than the nominal model, and no worse than the refit where they
    gained more than chance. (A refit of shapes imitates a sensor's gain exactly. Nothing but the lab's belief, that not
    every mode is off by so much, speaks for the gain.)

    Parameters
    ----------
    gain
        Errors on the recording held out.
    current, base
        Fits with and without the causes.
    settings
        Thresholds of the diagnosis.
    """
    if base.misfit - current.misfit < settings.evidence.least:
        return gain.after < gain.before
    if by_belief(base, current, settings) and gain.after < gain.before and gain.evidence > 0:
        return True
    proof = settings.proof
    return gain.evidence > proof.gain and gain.after < gain.refitted and gain.p_value < proof.significance


def by_belief(without: Fit, whole: Fit, settings: Settings) -> bool:
    """Whether hardly any of the evidence for what ``whole`` has and ``without`` has not is a better misfit.

    Parameters
    ----------
    without, whole
        Fits without and with a cause.
    settings
        Thresholds of the diagnosis.
    """
    least = max(settings.evidence.least, settings.proof.belief_alone * (without.score - whole.score))
    return without.misfit - whole.misfit < least


def _idle(
    comparison: StructureComparison, recordings: Recordings, found: Search[Fit], held_out: HeldOut
) -> tuple[int, Fit] | None:
    """Place of a cause that the held-out recording does not confirm, and the fit on all recordings without it."""
    last, count = found.current, len(found.accepted)
    if lost := modes_not_seen(last.hypothesis, comparison.lines):
        return lost[-1], comparison.refitted_without(found, lost[-1]) if count > 1 else found.base
    if not helps(held_out.improvement, last, found.base, comparison.settings):
        return count - 1, _before_last(comparison, found)
    if count == 1:
        return None
    others = recordings.others(recordings.mended)
    whole = fit(others, held_out.improved, iterations=0)
    rival = Rival(whole, FAR_BEHIND * comparison.needed(whole, found.base))
    without = [held_out.improved.without(k) for k in range(count)]
    tasks = [partial(fit, others, one, iterations=ITERATIONS, rival=rival) for one in without]
    for k, less in enumerate(in_processes(tasks)):
        if _missed(comparison, recordings, (whole, less), last, held_out):
            continue
        if k == count - 1:
            return k, _before_last(comparison, found)
        again = fit(recordings.mended, last.hypothesis.without(k), last.noises, iterations=ITERATIONS)
        return k, again
    return None


def fit_without(comparison: StructureComparison, found: Search[Fit], place: int) -> Fit:
    """The fit without one of the causes; for the last one the step before, where that is as good.

    What the others have become beside the last cause may run away without it, and the step before never does.

    Parameters
    ----------
    comparison
        How fits without a cause are made.
    found
        The search with the cause.
    place
        Which of the accepted causes is left out.
    """
    less = comparison.refitted_without(found, place)
    step = _step_before(found) if place == len(found.accepted) - 1 else None
    return less if step is None else min(less, step, key=lambda one: one.score)


def _before_last(comparison: StructureComparison, found: Search[Fit]) -> Fit:
    """The fit without the last cause: the step before, if there is one."""
    step = _step_before(found)
    return comparison.refitted_without(found, len(found.accepted) - 1) if step is None else step


def _step_before(found: Search[Fit]) -> Fit | None:
    """The step before the last cause; None where that still has a cause that was let go since."""
    step, kept = found.steps[-2], found.current.hypothesis.causes[:-1]
    return step if [one.physics for one in step.hypothesis.causes] == [one.physics for one in kept] else None


def _missed(
    comparison: StructureComparison, recordings: Recordings, fits: tuple[Fit, Fit], last: Fit, held_out: HeldOut
) -> bool:
    """Whether the held-out recording misses a cause: with it (first fit) the error is less than without (second).

    A sweep passes a resonance once: a cause may then halve the error in two or three blocks of time and do nothing in
    the others, which no test over blocks calls significant. An error that is halved with that likelihood is enough.
    """
    (whole, less), settings = fits, comparison.settings
    if not np.isfinite(less.score):
        # without it the rest runs away
        return True
    if by_belief(less, whole, settings):
        return less.score - whole.score > comparison.needed(less, less)
    place = recordings.held_out_place
    here = recordings.held_out(recordings.mended)
    rest, without = residual_lines(held_out.improved, here), residual_lines(less.hypothesis, here)
    covariance = fitted_noise(here, through_structure(last.hypothesis, here), last.noises[place])
    gain = least_misfit(less.hypothesis, here) - least_misfit(held_out.improved, here)
    if gain <= settings.proof.gain:
        return False
    size = np.mean(np.abs(here.measured) ** 2, axis=0)
    powers = tuple(float(np.sum(np.abs(one) ** 2 / size)) for one in (rest, without))
    if clearly_halves(gain, powers, settings.proof):
        return True
    return chance_of_no_gain(here, covariance, without, rest, settings.proof) < settings.proof.significance


def clearly_halves(gain: float, powers: tuple[float, ...], settings: ProofSettings) -> bool:
    """Whether a cause is kept whatever the test over blocks says: the error is halved, the likelihood overwhelming.

    Parameters
    ----------
    gain
        Gain in misfit on the recording held out.
    powers
        Powers of the residual there with the cause and without it.
    settings
        Thresholds of the proof.

    Examples
    --------
    >>> clearly_halves(5177.0, (18.2, 238.1), ProofSettings())
    True
    >>> clearly_halves(500.0, (18.2, 238.1), ProofSettings()) or clearly_halves(5177.0, (18.2, 40.0), ProofSettings())
    False
    """
    return gain > settings.overwhelming and powers[0] <= settings.halved**2 * powers[1]
