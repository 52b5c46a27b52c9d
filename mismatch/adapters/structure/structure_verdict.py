"""The verdict on a structure: what is left, what the recording held out says, and laws beyond what their names mean."""

from collections.abc import Collection, Sequence

from ...inference import (
    AcceptedCause,
    EvidenceSettings,
    Findings,
    Improvement,
    Remainder,
    Search,
    VerdictSettings,
    error_halved,
    leaves_too_much,
    verdict_of,
)
from ...models import Fit, Hypothesis, modes_are_odd
from ...physics import MODAL_PARAMETERS, ChainPhysics, ModePhysics
from .acceptance import impossible, names_beyond, strained
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
