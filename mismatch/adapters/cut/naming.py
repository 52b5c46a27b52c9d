"""What a diagnosis names: accepted causes and odd coefficients, with their numbers and errors."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...inference import AcceptedCause, Candidate, Proposal, Search
from .comparison import UNCONFIRMED, covariance_with_usual_error
from .fits import CutFit, MeasuredCut, fit_cut
from .form_errors import form_errors
from .held_out import Halves
from .settings import CutSettings

COEFFICIENTS = "force_coefficients"
"""Name under which coefficients stand that are off by several times what a laboratory's are."""


def accepted_causes(cut: MeasuredCut, found: Search[CutFit], halves: Halves) -> list[AcceptedCause]:
    """The causes of the last step, in the order found.

    Parameters
    ----------
    cut
        Recordings with their noise.
    found
        The search for causes, as it ended.
    halves
        The last step fitted to either half of the blocks.
    """
    final, process = found.current, cut.belief.process
    further: Sequence[Proposal[CutFit]] = found.rounds[-1].proposals if found.rounds else ()
    form = form_errors(cut, final, halves, further)
    moving = any(final.hypothesis.cause(name).moves for name in final.freed)
    # noise of the motion shifts numbers, and no residual shows it: added once more, it shifts them as much again
    again = fit_cut(cut.noisier(), final.hypothesis, final.freed) if moving else final
    named = []
    for accepted in found.accepted:
        name, cause = accepted.name, final.hypothesis.cause(accepted.name)
        values = final.hypothesis.values(name)
        shift = np.diag((again.hypothesis.values(name) - values) ** 2)
        parts = {
            "fit": covariance_with_usual_error(cut, final, name) + shift,
            "spread": np.diag(form[name].spread),
            "form": np.diag(form[name].form),
        }
        numbers, errors = cause.told(values, np.sum(list(parts.values()), axis=0), process)
        by_part = {part: cause.told(values, covariance, process)[1] for part, covariance in parts.items()}
        told = {number: {part: by_part[part][number] for part in parts} for number in numbers}
        named.append(AcceptedCause(name, {}, numbers, errors, accepted.evidence, told))
    return named


def odd_coefficients(cut: MeasuredCut, fitted: CutFit, settings: CutSettings) -> list[AcceptedCause]:
    """Coefficients that are off by several times a laboratory's error, as one cause; none where there are none.

    Parameters
    ----------
    cut
        Recordings with their noise.
    fitted
        Fit with free coefficients.
    settings
        Thresholds of a cut's diagnosis.
    """
    off = fitted.hypothesis.deviations
    errors = np.sqrt(np.diag(fitted.covariance)[:6])
    odd = (np.abs(off) > settings.odd) & (np.abs(off) > settings.evidence.clear * errors)
    if not odd.any():
        return []
    values, spread = cut.belief.told(off, errors)
    fixed = fit_cut(cut, replace(fitted.hypothesis, deviations=np.zeros(6)), fitted.freed, refit=False)
    location = {"coefficients": [name for name, one in zip(values, odd, strict=True) if one]}
    return [AcceptedCause(COEFFICIENTS, location, values, spread, fixed.score - fitted.score)]


def weighed_candidates(found: Search[CutFit], told: CutFit) -> list[Candidate]:
    """Every cause as it was last weighed, beside those accepted before it; most evidence first.

    Parameters
    ----------
    found
        The search for causes, as it ended.
    told
        Fit that the diagnosis tells: a cause that was accepted and is not in it is not confirmed.
    """
    last = {one.name: one for step in found.rounds for one in step.candidates}
    last |= {one.name: one for one in found.rejected}
    for name in set(found.current.freed) - set(told.freed):
        last[name] = replace(last[name], stage=UNCONFIRMED)
    return sorted(last.values(), key=lambda one: -one.evidence)
