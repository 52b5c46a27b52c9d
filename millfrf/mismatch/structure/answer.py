"""The answer of a structural diagnosis: verdict, causes, and their value on held-out data."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from estimation import WindowedSpectrum

from ..behaviour.level_refit import FollowedAlone, followed_alone
from ..faults.clipping_repair import with_tones_settled
from ..inference.diagnosis import (
    AcceptedCause,
    Candidate,
    Findings,
    Improvement,
    Remainder,
    error_halved,
    leaves_too_much,
    verdict_of,
)
from ..inference.search import Search, released
from ..inference.settings import EvidenceSettings, VerdictSettings
from ..models.fitting import Fit, fit, modes_are_odd
from ..models.hypothesis import Hypothesis
from ..models.model_terms import with_linear_part
from ..physics.library import is_fault
from ..physics.protocol import ChainPhysics, ModePhysics
from ..physics.structural import MODAL_PARAMETERS
from ..records.held_out_parts import Recordings
from ..residual.bursts import Bursts, bursts_left
from ..residual.structured_residual import leftover
from .acceptance import impossible, lost_mode, names_beyond, strained
from .comparison import StructureComparison
from .confirmation import fit_without
from .form_errors import with_form_spread
from .held_out import HeldOut, held_out_improvement, scored
from .implausible_modes import moved_by_level, stands_beside_moving_modes, stay_beside
from .reported_causes import modal_deviation, told_causes, undamped_modes
from .rounds import likeliest_seen


def verdict_of_structure(
    hypothesis: Hypothesis,
    causes: Sequence[AcceptedCause],
    left: tuple[Remainder, Remainder],
    gain: Improvement,
    settings: VerdictSettings,
    *,
    everywhere: Improvement | None = None,
    measured: bool = False,
    not_whole: bool = False,
) -> str:
    """Give the verdict: ``none``, ``explained``, ``partly explained`` or ``unexplained``.

    Noise that was measured holds nothing unexplained: an answer that leaves several times as much is not whole.

    Parameters
    ----------
    hypothesis
        The hypothesis with all accepted causes.
    causes
        Causes that would be told, faults and modal parameters among them.
    left
        Parts of the residual that move with the signal, without any cause and with all.
    gain
        Errors on the recording held out.
    settings
        Thresholds of the verdict.
    everywhere
        The same errors over all that was held out; None: nothing else was.
    measured
        Whether the noise was measured, and not inferred from what a model leaves.
    not_whole
        Whether the answer is known to leave something: modes that are refitted to one recording alone follow much of
        what it leaves there, or modes move with the level and nothing that would be told moves them.
    """
    before, after = left
    most = settings.most_of_response
    incomplete = leaves_too_much(gain, settings) if causes else min(gain.before, gain.after) > most
    incomplete |= bool(causes) and measured and gain.after > settings.most_over_measured * gain.noise_floor
    incomplete |= not_whole
    excluded = strained(hypothesis) and not after.noise_like(settings.noise_like)
    # a law that leaves much of the response may stand for another that nobody listed
    # a linear refit may follow one of two levels, at the other's expense
    whole = everywhere or gain
    halved = error_halved(gain, settings) or (gain.after < gain.refitted and error_halved(whole, settings))
    halved &= not (hypothesis.laws and max(gain.after, whole.after) > most)
    findings = Findings(before, after, bool(causes), excluded=excluded, incomplete=incomplete, halved=halved)
    return verdict_of(findings, settings)


def shown_faults(
    faults: Sequence[AcceptedCause], gain: Improvement, highest: float, significance: float
) -> list[AcceptedCause]:
    """Faults that the held-out recording shows: none inside the band where they do not lower its error.

    Parameters
    ----------
    faults
        Faults of the recordings, the only causes that were found.
    gain
        Errors on the recording held out, with the faults put into the prediction.
    highest
        Upper end of the compared band, Hz; tones above it show in no error.
    significance
        Chance above which the error has not fallen.
    """
    if gain.p_value < significance:
        return list(faults)
    return [one for one in faults if one.parameters.get("frequency_hz", 0.0) > highest]


def small_beside_the_rest(found: Search[Fit], share: float) -> list[int]:
    """Places of accepted causes that bring less than a share of all evidence: they may mend what the others leave.

    Parameters
    ----------
    found
        Where the search ended.
    share
        Share of the evidence of all causes.
    """
    whole = found.base.score - found.current.score
    return [k for k, one in enumerate(found.accepted) if one.evidence < share * whole]


def has_a_sure_name(found: Search[Fit], laws: Collection[str]) -> bool:
    """Whether what leaves something is still known by its name.

    Further modes imitate much, also what no library holds: alone they are no name. A law of a joint must also be the
    likeliest on the motion that was seen, or be told as one that cannot be told from that; where the free simulation
    alone prefers another, neither is sure.

    Parameters
    ----------
    found
        Where the search ended.
    laws
        Names of the joint laws that were weighed.
    """
    causes = found.current.hypothesis.causes
    if all(isinstance(cause.physics, ModePhysics) for cause in causes):
        return not causes
    for one in found.accepted:
        if one.name not in laws:
            continue
        own = next(each for each in found.rounds if each.chosen is one)
        seen = likeliest_seen(own.candidates, laws)
        if seen and seen != one.name and seen not in own.equivalents:
            return False
    return True


def equivalents_of_answer(
    found: Search[Fit], causes: Sequence[AcceptedCause], settings: EvidenceSettings
) -> tuple[str, ...]:
    """Names that the data cannot tell from a told cause.

    A law whose numbers end at the limits of its name cannot be told from the law beyond them. Odd modal parameters that
    stand alone cannot be told from a linear cause beside which the modes are not odd, and which is as likely: it only
    lacks the evidence that a cause must have. A rotor's coupling at one speed is such a cause, as modes with unlike
    left and right vectors imitate it.

    Parameters
    ----------
    found
        Where the search ended.
    causes
        Causes that are told.
    settings
        Thresholds of the evidence.
    """
    if not causes:
        return ()
    if found.accepted:
        told = [one.name for one in causes]
        beyond = [name for name in names_beyond(found.current.hypothesis) if name not in told]
        return tuple(dict.fromkeys([*found.equivalents, *beyond]))
    if MODAL_PARAMETERS.name not in [one.name for one in causes]:
        return ()
    fitted = [one for each in found.rounds for one in each.proposals if one.evidence > 0]
    names = [
        one.name
        for one in fitted
        if isinstance(one.fitted.hypothesis.causes[-1].physics, ChainPhysics)
        and not impossible(one, settings)
        and not modes_are_odd(one.fitted)
    ]
    return tuple(dict.fromkeys(names))


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
