"""Causes that a recording confirms to which they were not fitted; the others are let go of."""

from functools import partial

from ...inference.diagnosis import AcceptedCause, Candidate, Improvement
from ...inference.process_pool import in_processes
from ...inference.verdict import CONFIRMED
from ...models.fitting import Fit, fit
from ...models.misfit import least_misfit, through_structure
from .acceptance import HELD_OUT, LEAST_EVIDENCE, evidence_needed
from .held_out import ITERATIONS, HeldOut, Recordings, chance_of_no_gain, held_out_improvement, residual_lines
from .pruning import without_cause

Found = tuple[list[Fit], list[AcceptedCause]]

BELIEF_ALONE = 0.05
"""Share of a cause's evidence below which its misfit says nothing: the lab's belief alone tells it from a refit."""


def confirmed(
    recordings: Recordings, steps: list[Fit], accepted: list[AcceptedCause]
) -> tuple[Found, list[Candidate], HeldOut]:
    """Let go of causes until those left lower the error of the recording held out, together and each beside the rest.

    Parameters
    ----------
    recordings
        Mended and as measured.
    steps
        Fits without any cause, with the first, and so on.
    accepted
        Plain faults, then causes.

    Returns
    -------
    steps, accepted
        With fewer causes, or as they were.
    rejected
        Those let go of.
    held_out
        What is left is worth there.
    """
    steps, accepted, rejected = list(steps), list(accepted), list[Candidate]()
    while True:
        held_out = held_out_improvement(recordings, steps[-1].hypothesis, steps[-1].noises, accepted)
        if len(steps) == 1 or len(recordings.mended) == 1:
            return (steps, accepted), rejected, held_out
        gone = _idle(recordings, steps, accepted, held_out)
        if gone is None:
            return (steps, accepted), rejected, held_out
        place, less = gone
        last = accepted.pop(place)
        rejected.append(Candidate(last.name, last.evidence, "not confirmed", last.location))
        at = place - (len(accepted) + 1 - (len(steps) - 1))
        steps = [*steps[: at + 1], *steps[at + 2 : -1], less] if at < len(steps) - 2 else steps[:-1]


def helps(gain: Improvement, current: Fit, base: Fit) -> bool:
    """Whether the causes together lower the error of the held-out recording.

    Causes that gained little where they were fitted but stand nearer to the lab's belief than a general refit need not
    predict better than that; they must predict better than the nominal model, and no worse than the refit where they
    gained more than chance. (A sensor's gain is a refit of shapes to the last digit: only that the lab was not off by
    so much in every mode speaks for it.)
    """
    if base.misfit - current.misfit < LEAST_EVIDENCE:
        return gain.after < gain.before
    if by_belief(base, current) and gain.after < gain.before and gain.evidence > 0:
        return True
    return gain.evidence > HELD_OUT and gain.after < gain.refitted and gain.p_value < CONFIRMED


def by_belief(without: Fit, whole: Fit) -> bool:
    """Whether hardly any of the evidence for what ``whole`` has and ``without`` has not is a better misfit."""
    return without.misfit - whole.misfit < max(LEAST_EVIDENCE, BELIEF_ALONE * (without.score - whole.score))


def _idle(
    recordings: Recordings, steps: list[Fit], accepted: list[AcceptedCause], held_out: HeldOut
) -> tuple[int, Fit] | None:
    """Place of a cause that the held-out recording does not confirm, and the fit on all recordings without it."""
    base, last = steps[0], steps[-1]
    if not helps(held_out.improvement, last, base):
        return len(accepted) - 1, steps[-2]
    first = len(accepted) - (len(steps) - 1)
    if len(steps) == 2:
        return None
    others = recordings.others(recordings.mended)
    tasks = [
        partial(fit, others, without_cause(held_out.improved, accepted[k]), iterations=ITERATIONS)
        for k in range(first, len(accepted))
    ]
    whole = fit(others, held_out.improved, iterations=0)
    for k, less in zip(range(first, len(accepted)), in_processes(tasks), strict=True):
        if not _missed(recordings, (whole, less), last, held_out):
            if k == len(accepted) - 1:
                return k, steps[-2]
            again = fit(
                recordings.mended, without_cause(last.hypothesis, accepted[k]), last.noises, iterations=ITERATIONS
            )
            return k, again
    return None


def _missed(recordings: Recordings, fits: tuple[Fit, Fit], last: Fit, held_out: HeldOut) -> bool:
    """Whether the held-out recording misses a cause: with it (first fit) the error is less than without (second)."""
    whole, less = fits
    if by_belief(less, whole):
        return less.score - whole.score > evidence_needed(less, less)
    here = recordings.mended[recordings.kept]
    rest, without = residual_lines(held_out.improved, here), residual_lines(less.hypothesis, here)
    covariance = last.noises[recordings.kept].covariance(here.frequencies, through_structure(last.hypothesis, here))
    gain = least_misfit(less.hypothesis, here) - least_misfit(held_out.improved, here)
    return gain > HELD_OUT and chance_of_no_gain(here, covariance, without, rest) < CONFIRMED
