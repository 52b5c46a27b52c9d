"""What a diagnosis tells of a structure: the verdict, the causes under it, and what they are worth on held-out data."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from estimation import WindowedSpectrum

from ...behaviour import FollowedAlone, followed_alone
from ...faults import with_tones_settled
from ...inference import AcceptedCause, Candidate, Remainder, Search, VerdictSettings, released
from ...models import Fit, fit, with_linear_part
from ...physics import is_fault
from ...records import Recordings
from ...remainder import Bursts, bursts_left, leftover
from .acceptance import lost_mode
from .comparison import StructureComparison
from .confirmation import fit_without
from .form_errors import with_form_spread
from .held_out import HeldOut, held_out_improvement, scored
from .level_check import moved_by_level, stands_beside_moving_modes, stay_beside
from .structure_verdict import has_a_sure_name, shown_faults, small_beside_the_rest, verdict_of_structure
from .told_causes import modal_deviation, told_causes, undamped_modes


@dataclass(frozen=True)
class Answer:
    """What is told of a structure.

    Parameters
    ----------
    verdict
        ``none``, ``explained``, ``partly explained`` or ``unexplained``.
    causes
        Causes that are told, faults of the recordings first.
    final
        The fit that holds them.
    found
        The search that found them, without causes that were let go of here.
    left
        What that fit leaves beyond noise.
    held_out
        What it is worth on the recording held out.
    rejected
        Causes that the verdict turns down.
    no_noise
        Recordings of which the causes leave much that is no noise, and that keep the answer from being whole.
    moving
        How modes move with the level, where nothing that was found depends on it; empty where that is not seen.
    bursts
        Recordings of which a linear answer leaves bursts.
    lost
        Which of the laboratory's modes is a resonance no more; empty where none.
    stayed
        Whether modes that move in a linear refit are seen to stay beside the linear causes that are told.
    """

    verdict: str
    causes: tuple[AcceptedCause, ...]
    final: Fit
    found: Search[Fit]
    left: Remainder
    held_out: HeldOut
    rejected: tuple[Candidate, ...] = ()
    no_noise: tuple[FollowedAlone, ...] = ()
    moving: str = ""
    bursts: tuple[Bursts, ...] = ()
    lost: str = ""
    stayed: bool = False

    @property
    def doubts(self) -> tuple[str, ...]:
        """What speaks against the answer, or shows that it is not whole: sentences for the reader."""
        moving = [self.moving] if self.moving else []
        lost = [f"{self.lost[0].upper()}{self.lost[1:]}: it stands for something that is missing"] if self.lost else []
        return (*(one.sentence for one in self.no_noise), *moving, *(one.sentence for one in self.bursts), *lost)


def answer_of(
    comparison: StructureComparison,
    both: Recordings,
    found: Search[Fit],
    held_out: HeldOut,
    faults: list[AcceptedCause],
    decay: float,
) -> Answer:
    """The verdict on the causes that a search found; under ``unexplained`` none is told, in part only the large ones.

    What is left may have moved the modes, too: ``modal_parameters`` is no part of a partial answer beside causes.

    Parameters
    ----------
    comparison
        The comparison that was searched.
    both
        The recordings, mended and as measured.
    found
        Where the search ended.
    held_out
        What its causes are worth on the recording held out.
    faults
        Tones and limits that were found before.
    decay
        Decay rate of the slowest mode, 1/s.
    """
    settings, current = comparison.settings, found.current
    spread = with_form_spread(current, both.mended)
    if less := _without_one_of(comparison, both, found, undamped_modes(spread), "its damping may be none", faults):
        return answer_of(comparison, both, *less, faults, decay)
    named = [*faults, *told_causes(spread, found.accepted)]
    causes = with_tones_settled(current, both.measured, named, decay, settings.faults)
    faults = [cause for cause in causes if is_fault(cause.name)]
    held_out = scored(both, (held_out.linear, held_out.improved), current.noises, faults, settings.proof)
    if both.tested and not found.accepted:
        seen = shown_faults(faults, held_out.improvement, both.mended[-1].frequencies[-1], settings.proof.significance)
        causes = [cause for cause in causes if cause not in faults or cause in seen]
        held_out = scored(both, (held_out.linear, held_out.improved), current.noises, seen, settings.proof)
    deviation = _deviation(both.mended, spread)
    if deviation is not None and faults and deviation.evidence < settings.evidence.least:
        # what the mending of a fault leaves may move the modes as much
        deviation = None
    causes += [] if deviation is None else [deviation]
    left = leftover(current.hypothesis, both.mended)
    judged = partial(
        verdict_of_structure,
        current.hypothesis,
        causes,
        (comparison.before, left),
        held_out.improvement,
        settings.verdict,
        everywhere=held_out.everywhere,
        measured=held_out.measured,
    )
    verdict, no_noise = _judged_alone(judged, found, both, settings.verdict)
    moving = moved_by_level(current.hypothesis, causes, comparison.behaviour)
    stayed = bool(moving and found.accepted) and stay_beside(current.hypothesis, comparison.behaviour, both.mended)
    moving = "" if stayed else moving
    if moving and verdict != "unexplained":
        stands = not found.accepted or stands_beside_moving_modes(held_out.improvement, settings.verdict)
        verdict = judged(not_whole=True) if stands else "unexplained"
    lost = lost_mode(current.hypothesis) if verdict == "explained" else ""
    verdict = judged(not_whole=True) if lost else verdict
    # a law of a joint may leave bursts where its form is not quite the true one
    bursts = () if current.hypothesis.laws else bursts_left(current.hypothesis, both.mended)
    verdict = "unexplained" if verdict == "none" and bursts else verdict
    if verdict == "partly explained" and found.accepted:
        small = small_beside_the_rest(found, settings.evidence.small_in_part)
        if less := _without_one_of(comparison, both, found, small, "small beside what is left", faults):
            return answer_of(comparison, both, *less, faults, decay)
        causes = [cause for cause in causes if cause is not deviation]
        if not has_a_sure_name(found, comparison.laws):
            verdict = "unexplained"
    if verdict == "unexplained":
        none_told = _unexplained(comparison, both, found, held_out, causes)
        return replace(none_told, no_noise=no_noise, moving=moving, bursts=bursts, lost=lost)
    told = Answer(verdict, tuple(causes), current, found, left, held_out, stayed=stayed)
    return replace(told, no_noise=no_noise, moving=moving, bursts=bursts, lost=lost)


def _judged_alone(
    judged: Callable[..., str], found: Search[Fit], both: Recordings, settings: VerdictSettings
) -> tuple[str, tuple[FollowedAlone, ...]]:
    """The verdict, and recordings of which a whole answer leaves what modes of their own follow: it is then not whole.

    Parameters
    ----------
    judged
        Gives the verdict, and with ``not_whole`` that of an answer that is not whole.
    found
        Where the search ended.
    both
        The recordings, mended and as measured.
    settings
        Thresholds of the verdict.
    """
    verdict = judged()
    if verdict not in ("none", "explained"):
        return verdict, ()
    no_noise = followed_alone(found.current.hypothesis, found.base.hypothesis, both.mended, settings)
    return judged(not_whole=bool(no_noise)), no_noise


def _unexplained(
    comparison: StructureComparison,
    both: Recordings,
    found: Search[Fit],
    held_out: HeldOut,
    causes: Sequence[AcceptedCause],
) -> Answer:
    """The answer that tells no cause: the modes refitted to the recordings as they were measured."""
    rejected = tuple(Candidate(one.name, one.evidence, "rejected", one.location) for one in causes)
    base, measured = found.base, replace(both, mended=both.measured)
    held_out = scored(measured, (held_out.linear, held_out.linear), base.noises, (), comparison.settings.proof)
    return Answer("unexplained", (), base, found, comparison.before, held_out, rejected)


def _without_one_of(
    comparison: StructureComparison,
    both: Recordings,
    found: Search[Fit],
    places: list[int],
    why: str,
    faults: list[AcceptedCause],
) -> tuple[Search[Fit], HeldOut] | None:
    """The search without one of its causes, the last of ``places``, and what the others are worth on held-out data.

    A cause without which the others run away stays; None where none goes.
    """
    for place in reversed(places):
        less = fit_without(comparison, found, place)
        if np.isfinite(less.score):
            found = released(found, place, less, why, found.accepted[place].evidence)
            last, proof = found.current, comparison.settings.proof
            return found, held_out_improvement(both, last.hypothesis, last.noises, faults, proof)
    return None


def _deviation(lines: list[WindowedSpectrum], current: Fit) -> AcceptedCause | None:
    """Modal parameters that are off by more than a lab's error, and not by the linear part of a joint's law."""
    found = modal_deviation(current)
    causes = current.hypothesis.causes
    if found is None or not current.hypothesis.laws:
        return found
    freed = tuple(with_linear_part(cause) if cause.axis is not None else cause for cause in causes)
    again = fit(lines, replace(current.hypothesis, causes=freed), current.noises, iterations=20)
    return found if modal_deviation(again) is not None else None
