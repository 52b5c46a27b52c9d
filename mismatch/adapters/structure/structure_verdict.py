"""The verdict on a structure: what is left, what the recording held out says, and laws beyond what their names mean."""

from collections.abc import Sequence

from ...inference import (
    AcceptedCause,
    Findings,
    Improvement,
    Remainder,
    VerdictSettings,
    leaves_too_much,
    verdict_of,
)
from ...models import Hypothesis
from .acceptance import strained


def verdict_of_structure(
    hypothesis: Hypothesis,
    causes: Sequence[AcceptedCause],
    left: tuple[Remainder, Remainder],
    gain: Improvement,
    settings: VerdictSettings,
) -> str:
    """Give the verdict: ``none``, ``explained``, ``partly explained`` or ``unexplained``.

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
    """
    before, after = left
    most = settings.most_of_response
    incomplete = leaves_too_much(gain, settings) if causes else min(gain.before, gain.after) > most
    excluded = strained(hypothesis) and not after.noise_like(settings.noise_like)
    # an answer that errs by as much as the response itself predicts nothing
    predicts = gain.after < 1
    findings = Findings(before, after, bool(causes), excluded=excluded, incomplete=incomplete, halved=predicts)
    return verdict_of(findings, settings)
