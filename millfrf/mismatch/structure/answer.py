"""Result of a structural diagnosis: verdict, causes, and their value on held-out data."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from estimation import WindowedSpectrum

from ..behaviour.level_refit import BetterRefit, better_refits
from ..faults.clipping_repair import with_final_tones
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
from ..inference.search import Search, without_cause
from ..inference.settings import EvidenceSettings, Settings, VerdictSettings
from ..models.fitting import Fit, converged, fit, modes_are_implausible
from ..models.hypothesis import Hypothesis
from ..models.model_terms import with_linear_part
from ..physics.library import is_fault
from ..physics.linear_causes import MODAL_PARAMETERS, MissingMode
from ..physics.protocol import ChainPhysics
from ..records.bands import Recordings
from ..records.noise_model import SIGNAL_ERROR
from .acceptance import (
    has_law_beyond_limits,
    impossible,
    impossible_rival,
    lost_mode,
    names_beyond_limits,
    undetermined_causes,
    unproved_law,
)
from .added_modes import copies_of_modes, harmonics_of_modes, undamped_modes
from .changes_in_time import ChangeBetween, ChangeInTime, changes_between, changes_in_time, sentences_of
from .changing_mass import ChangingMass, changing_masses
from .comparison import StructureComparison
from .held_out import NOT_CONFIRMED, HeldOut, fit_without, held_out_improvement, scored
from .implausible_modes import halves_refitted_error, modes_stay_with_causes, moved_by_level
from .moved_modes import another_structure, modal_deviation
from .noise_bounds import contradictions, leaves_beyond_noise, with_bounded_noise
from .noise_humps import NoiseHump, find_hump
from .reported_causes import reported_causes_of, rounded_channels, with_form_spread
from .rounds import likeliest_on_motion
from .structured_residual import Bursts, bursts_left, remainder_of


def verdict_of_structure(
    hypothesis: Hypothesis,
    causes: Sequence[AcceptedCause],
    left: tuple[Remainder, Remainder],
    gain: Improvement,
    settings: VerdictSettings,
    *,
    everywhere: Improvement | None = None,
    measured: bool = False,
    incomplete_result: bool = False,
) -> str:
    """Return the verdict: ``none``, ``explained``, ``partly explained`` or ``unexplained``.

    Measured noise contains no response to the forces: a residual several times as large makes the result incomplete.

    ``gain``: errors on the held-out recording. ``everywhere``: these errors over all held-out data; None if only one
    recording was held out. The least error of sensors, proportional to the signal, is added to the noise of both.
    """
    before, after = left
    # what the causes remove from held-out data was structured, too, whether or not it follows the signal
    before = replace(before, size=max(before.size, after.size + max(gain.refitted**2 - gain.after**2, 0.0)))
    gain, everywhere = (
        replace(each, noise_floor=float(np.hypot(each.noise_floor, SIGNAL_ERROR)))
        for each in (gain, everywhere or gain)
    )
    largest_error = settings.most_of_response
    incomplete = leaves_too_much(gain, settings) if causes else min(gain.before, gain.after) > largest_error
    incomplete |= bool(causes) and measured and gain.after > settings.most_over_measured * gain.noise_floor
    incomplete |= incomplete_result
    excluded = has_law_beyond_limits(hypothesis) and not after.noise_like(settings.noise_like)
    # A linear refit may fit one of two levels well and the second one badly. A law with a large residual may imitate a
    # law that is not in the library.
    halved = error_halved(gain, settings) or (gain.after < gain.refitted and error_halved(everywhere, settings))
    halved &= not (hypothesis.laws and max(gain.after, everywhere.after) > largest_error)
    findings = Findings(before, after, bool(causes), excluded=excluded, incomplete=incomplete, halved=halved)
    return verdict_of(findings, settings)


def confirmed_faults(
    faults: Sequence[AcceptedCause], gain: Improvement, highest: float, significance: float
) -> list[AcceptedCause]:
    """Return the faults that the held-out recording confirms.

    Faults within the compared band must lower the error of this recording.

    ``highest``: upper end of the compared band, Hz; tones above it do not affect the error and are always returned.
    """
    if gain.p_value < significance:
        return list(faults)
    return [fault for fault in faults if fault.parameters.get("frequency_hz", 0.0) > highest]


def small_causes(search: Search[Fit], share: float) -> list[int]:
    """Return the indices of accepted causes with less than ``share`` of all evidence.

    Such causes may only correct errors of the large causes.
    """
    total = search.base.score - search.current.score
    return [k for k, proposal in enumerate(search.accepted) if proposal.evidence < share * total]


def has_reliable_name(search: Search[Fit], laws: Collection[str]) -> bool:
    """Return whether an incomplete result still names its causes reliably.

    Added modes imitate many effects: a result with added modes alone has no reliable name. A joint law must have the
    largest screened gain of all laws, or be reported as equivalent to the law with the largest screened gain.
    """
    causes = search.current.hypothesis.causes
    if all(isinstance(cause.physics, MissingMode) for cause in causes):
        return not causes
    for proposal in search.accepted:
        if proposal.name not in laws:
            continue
        round_ = next(each for each in search.rounds if each.chosen is proposal)
        likeliest = likeliest_on_motion(round_.candidates, laws)
        if likeliest and likeliest != proposal.name and likeliest not in round_.equivalents:
            return False
    return True


def equivalents_of_answer(
    search: Search[Fit], causes: Sequence[AcceptedCause], settings: EvidenceSettings
) -> tuple[str, ...]:
    """Return the names that the data cannot distinguish from a reported cause.

    A law whose numbers end at a limit is equivalent to the law beyond this limit. If implausible modal parameters are
    the only cause, they are equivalent to an equally likely linear cause with which the modes are plausible, even if
    this cause lacks sufficient evidence. An example is the coupling of a rotor at one speed, which modes with different
    left and right vectors imitate.
    """
    if not causes:
        return ()
    if search.accepted:
        reported = [cause.name for cause in causes]
        beyond = [name for name in names_beyond_limits(search.current.hypothesis) if name not in reported]
        return tuple(dict.fromkeys([*search.equivalents, *beyond]))
    if MODAL_PARAMETERS.name not in [cause.name for cause in causes]:
        return ()
    fitted = [proposal for round_ in search.rounds for proposal in round_.proposals if proposal.evidence > 0]
    names = [
        candidate.name
        for candidate in fitted
        if isinstance(candidate.fitted.hypothesis.causes[-1].physics, ChainPhysics)
        and not impossible(candidate, settings)
        and not modes_are_implausible(candidate.fitted)
    ]
    return tuple(dict.fromkeys(names))


@dataclass(frozen=True)
class Answer:
    """Result of a diagnosis of a structure."""

    verdict: str  # one of ``VERDICTS`` for a structure
    causes: tuple[AcceptedCause, ...]  # reported causes, faults of the recordings first
    final: Fit  # fit with these causes
    search: Search[Fit]
    left: Remainder  # structured residual of the fit
    held_out: HeldOut
    rejected: tuple[Candidate, ...] = ()
    no_noise: tuple[BetterRefit, ...] = ()
    # sentence on modes that change with the level although no accepted cause depends on the level; else empty
    moving: str = ""
    uneven: tuple[Bursts | NoiseHump, ...] = ()
    changes: tuple[ChangeInTime | ChangeBetween, ...] = ()
    lost_mode: str = ""  # which nominal mode is no longer a resonance; empty if none
    # sentence on refitted modes that are too far from the nominal ones to explain anything; empty if they are not
    another_structure: str = ""
    rival: str = ""  # sentence on a candidate that was not accepted, but contradicts the result; empty if none
    masses: tuple[ChangingMass, ...] = ()  # masses in place of the stiffnesses that change during recordings
    noise: tuple[str, ...] = ()  # sentences on recordings that leave more than the others allow as noise
    # whether modes that change in a linear refit are constant when the accepted linear causes are included
    stayed: bool = False

    @property
    def doubts(self) -> tuple[str, ...]:
        """Sentences on observations that contradict the result or show that it is incomplete."""
        moving = [self.moving] if self.moving else []
        lost_modes = (
            [f"{self.lost_mode[0].upper()}{self.lost_mode[1:]}: it stands for something that is missing"]
            if self.lost_mode
            else []
        )
        return (
            *(refit.sentence for refit in self.no_noise),
            *self.noise,
            *moving,
            *(part.sentence for part in self.uneven),
            *sentences_of(self.changes),
            *lost_modes,
            *filter(None, (self.another_structure, self.rival, *(mass.sentence for mass in self.masses))),
        )


def answer_of(
    comparison: StructureComparison,
    recordings: Recordings,
    search: Search[Fit],
    held_out: HeldOut,
    faults: list[AcceptedCause],
    decay: float,
) -> Answer:
    """Return the result for the causes that a search found, after tests on held-out data.

    Under ``unexplained`` no cause is reported, and under ``partly explained`` only the large causes. A result that is
    ``partly explained`` with other causes does not report ``modal_parameters``, as the modes may compensate the
    unexplained part.

    ``decay``: decay rate of the slowest mode, 1/s.
    """
    settings = comparison.settings
    current, spread = _with_errors(search.current, recordings.repaired)
    if less := _without_undetermined(comparison, recordings, search, spread, faults):
        return answer_of(comparison, recordings, *less, faults, decay)
    named = [*faults, *reported_causes_of(spread, search.accepted)]
    causes = with_final_tones(current, recordings.measured, named, decay, settings.faults)
    faults = [cause for cause in causes if is_fault(cause.name)]
    held_out = scored(recordings, (held_out.linear, held_out.improved), current.noises, faults, settings.proof)
    if recordings.tested and not search.accepted:
        confirmed = confirmed_faults(
            faults, held_out.improvement, recordings.repaired[-1].frequencies[-1], settings.proof.significance
        )
        causes = [cause for cause in causes if cause not in faults or cause in confirmed]
        held_out = scored(recordings, (held_out.linear, held_out.improved), current.noises, confirmed, settings.proof)
    deviation = _deviation(recordings.repaired, spread)
    if deviation is not None and faults and deviation.evidence < settings.evidence.least:
        # errors of a repaired fault may cause an equally large deviation of the modes
        deviation = None
    causes += [] if deviation is None else [deviation]
    causes += rounded_channels(current, recordings.repaired)
    left = remainder_of(current.hypothesis, recordings.repaired)
    verdict_for = partial(
        verdict_of_structure,
        current.hypothesis,
        causes,
        (comparison.before, left),
        held_out.improvement,
        settings.verdict,
        everywhere=held_out.everywhere,
        measured=held_out.measured,
    )
    verdict, no_noise = _checked_against_refits(verdict_for, search, recordings, settings)
    # without held-out data nothing confirms that the explanation is complete
    verdict = verdict_for(incomplete_result=True) if verdict == "explained" and not recordings.tested else verdict
    moving = moved_by_level(current.hypothesis, causes, comparison.behaviour)
    stayed = bool(moving and search.accepted) and modes_stay_with_causes(
        current.hypothesis, comparison.behaviour, recordings.repaired
    )
    moving = "" if stayed else moving
    if moving and verdict != "unexplained":
        stands = not search.accepted or halves_refitted_error(held_out.improvement, settings.verdict)
        verdict = verdict_for(incomplete_result=True) if stands else "unexplained"
    lost = lost_mode(current.hypothesis) if verdict == "explained" else ""
    verdict = verdict_for(incomplete_result=True) if lost else verdict
    far = "" if deviation is None else another_structure(current.hypothesis, settings.verdict.another_structure)
    if far and verdict != "unexplained":
        verdict = verdict_for(incomplete_result=True) if search.accepted else "unexplained"
    verdict, rival, masses = _checked_against_rivals(comparison, recordings, search, current, verdict)
    verdict, uneven, changes = _checked_as_noise(verdict, verdict_for, causes, search, recordings, settings.verdict)
    if verdict == "partly explained" and search.accepted:
        small = small_causes(search, settings.evidence.small_in_part)
        if less := _without_one_of(comparison, recordings, search, small, "small compared with the residual", faults):
            return answer_of(comparison, recordings, *less, faults, decay)
        causes = [cause for cause in causes if cause is not deviation]
        verdict = verdict if has_reliable_name(search, comparison.laws) else "unexplained"
    answer = (
        _unexplained(comparison, recordings, search, held_out, causes)
        if verdict == "unexplained"
        else Answer(verdict, tuple(causes), current, search, left, held_out, stayed=stayed)
    )
    return replace(
        answer,
        no_noise=no_noise,
        # a delay of single recordings also moves their modes
        moving="" if any(isinstance(change, ChangeBetween) and not change.response for change in changes) else moving,
        uneven=uneven,
        changes=changes,
        lost_mode=lost,
        another_structure=far,
        rival=rival,
        masses=masses,
        noise=contradictions(current.hypothesis, recordings.repaired),
    )


def _with_errors(fitted: Fit, lines: list[WindowedSpectrum]) -> tuple[Fit, Fit]:
    """Return a converged fit under bounded noise, and the same fit with the errors due to the form of its laws."""
    current = converged(with_bounded_noise(fitted, lines), lines)
    return current, with_form_spread(current, lines)


def _checked_against_rivals(
    comparison: StructureComparison, recordings: Recordings, search: Search[Fit], current: Fit, verdict: str
) -> tuple[str, str, tuple[ChangingMass, ...]]:
    """Return the verdict, a sentence on a candidate that contradicts it, and masses instead of stiffnesses."""
    if verdict == "none":
        rival = unproved_law(search, comparison.laws, comparison.settings.evidence.large)
    else:
        rival = impossible_rival(search, comparison.laws)
    masses = changing_masses(current, recordings.repaired, comparison.settings.evidence.least)
    contradicted = rival or any(mass.explains_more for mass in masses)
    return "unexplained" if contradicted else verdict, rival, masses


def _checked_as_noise(
    verdict: str,
    verdict_for: Callable[..., str],
    causes: Sequence[AcceptedCause],
    search: Search[Fit],
    recordings: Recordings,
    settings: VerdictSettings,
) -> tuple[str, tuple[Bursts | NoiseHump, ...], tuple[ChangeInTime | ChangeBetween, ...]]:
    """Return the verdict, and what noise does not have: bursts, narrow humps, changes of a gain or lag.

    A residual that is not explained is described by changes that are most of it. With bursts ``none``, and with a hump
    or changes each verdict without causes of the structure, is replaced: by that for an incomplete result if faults of
    the recordings are named, otherwise by ``unexplained``. A joint law may leave all three in the residual where its
    form differs slightly from the true form.
    """
    hypothesis = search.current.hypothesis
    bursts = () if hypothesis.laws else bursts_left(hypothesis, recordings.repaired)
    if verdict == "unexplained" and not search.accepted:
        most_of_it = changes_in_time(hypothesis, recordings.repaired, settings.partly)
        return verdict, bursts, (*most_of_it, *changes_between(hypothesis, recordings.repaired))
    if search.accepted or verdict not in ("none", "explained"):
        return verdict, bursts, ()
    hump = find_hump(search.current, recordings.repaired)
    changes = changes_in_time(hypothesis, recordings.repaired, settings.noise_like)
    if (hump or changes) and any(is_fault(cause.name) for cause in causes):
        verdict = verdict_for(incomplete_result=True)
    elif hump or changes or (verdict == "none" and bursts):
        verdict = "unexplained"
    return verdict, (*bursts, *filter(None, [hump])), changes


def _checked_against_refits(
    verdict_for: Callable[..., str], search: Search[Fit], recordings: Recordings, settings: Settings
) -> tuple[str, tuple[BetterRefit, ...]]:
    """Return the verdict, and the recordings that modes refitted to one recording alone fit much better.

    With such a recording, with a residual that the other recordings do not allow as noise, or without causes although
    one had large evidence that the held-out data only failed to confirm, ``none`` and ``explained`` are replaced by the
    verdict for an incomplete result.
    ``verdict_for`` returns the verdict for a complete or an incomplete result.
    """
    verdict = verdict_for()
    if verdict not in ("none", "explained"):
        return verdict, ()
    hypotheses, lines = (search.current.hypothesis, search.base.hypothesis), recordings.repaired
    no_noise = better_refits(*hypotheses, lines, settings.verdict)
    incomplete = bool(no_noise) or leaves_beyond_noise(*hypotheses, lines, settings.verdict)
    incomplete |= not search.accepted and any(
        candidate.stage == NOT_CONFIRMED and candidate.evidence > settings.evidence.large
        for candidate in search.rejected
    )
    return verdict_for(incomplete_result=incomplete), no_noise


def _unexplained(
    comparison: StructureComparison,
    recordings: Recordings,
    search: Search[Fit],
    held_out: HeldOut,
    causes: Sequence[AcceptedCause],
) -> Answer:
    """Return the result without causes: the modes refitted to the recordings as measured."""
    rejected = tuple(Candidate(cause.name, cause.evidence, "rejected", cause.location) for cause in causes)
    measured = replace(recordings, repaired=recordings.measured)
    base = with_bounded_noise(search.base, recordings.measured)
    held_out = scored(measured, (held_out.linear, held_out.linear), base.noises, (), comparison.settings.proof)
    return Answer("unexplained", (), base, search, comparison.before, held_out, rejected)


def without_names(answer: Answer, comparison: StructureComparison, recordings: Recordings) -> Answer:
    """Return a result as ``unexplained``: its causes do not describe what the data require."""
    unnamed = _unexplained(comparison, recordings, answer.search, answer.held_out, answer.causes)
    kept = ("no_noise", "moving", "uneven", "changes", "noise", "another_structure")
    return replace(unnamed, **{name: getattr(answer, name) for name in kept})


def _without_undetermined(
    comparison: StructureComparison,
    recordings: Recordings,
    search: Search[Fit],
    spread: Fit,
    faults: list[AcceptedCause],
) -> tuple[Search[Fit], HeldOut] | None:
    """Remove a cause that other causes may imitate, if there is any; ``spread`` is the fit with complete errors."""
    numbers = undetermined_causes(spread, [each.evidence for each in search.accepted], comparison.settings.evidence)
    doubtful = (
        (undamped_modes(spread), "its damping may be none"),
        (harmonics_of_modes(spread.hypothesis), "it lies at a harmonic of another mode under the force of the joint"),
        (copies_of_modes(spread.hypothesis), "it lies within the bandwidth of another mode, whose shape it has"),
        (numbers, "its numbers may be those of no cause"),
    )
    for places, why in doubtful:
        if less := _without_one_of(comparison, recordings, search, places, why, faults):
            return less
    return None


def _without_one_of(
    comparison: StructureComparison,
    recordings: Recordings,
    search: Search[Fit],
    places: list[int],
    why: str,
    faults: list[AcceptedCause],
) -> tuple[Search[Fit], HeldOut] | None:
    """Remove the last of the causes ``places`` and return the search and held-out errors without it.

    If the simulation without this cause diverges, the cause before it in ``places`` is tried, and so on. None is
    returned if no cause can be removed.
    """
    for place in reversed(places):
        less = fit_without(comparison, search, place)
        if np.isfinite(less.score):
            search = without_cause(search, place, less, why, search.accepted[place].evidence)
            last, proof = search.current, comparison.settings.proof
            return search, held_out_improvement(recordings, last.hypothesis, last.noises, faults, proof)
    return None


def _deviation(lines: list[WindowedSpectrum], current: Fit) -> AcceptedCause | None:
    """Return the implausible modal parameters as a cause, unless the linear part of a joint law explains them."""
    deviation = modal_deviation(current)
    causes = current.hypothesis.causes
    if deviation is None or not current.hypothesis.laws:
        return deviation
    freed = tuple(with_linear_part(cause) if cause.axis is not None else cause for cause in causes)
    again = fit(lines, replace(current.hypothesis, causes=freed), current.noises, iterations=20)
    return deviation if modal_deviation(again) is not None else None
