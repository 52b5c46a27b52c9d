"""Candidates for a computed cutting force, and the decision which of them are accepted."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import Real

from ..inference.diagnosis import AcceptedCause, Candidate
from ..inference.search import Proposal, Round, Search, best_first, equivalents_of
from .errors import Halves, fit_halves, form_errors, held_out_misfits
from .fitting import CutFit, fit_cut, fit_turned
from .hypothesis import MeasuredCut
from .settings import CutSettings

UNCONFIRMED = "fitted, but not confirmed: within its own error, or no gain on blocks held out"
"""Stage of a cause with evidence that was not accepted."""


@dataclass(frozen=True)
class CutComparison:
    """A cut as :func:`millfrf.mismatch.inference.search` wants it.

    Parameters
    ----------
    cut
        Recordings with their noise.
    names
        Names of the causes that can be weighed.
    settings
        Thresholds of a cut's diagnosis.
    """

    cut: MeasuredCut
    names: tuple[str, ...]
    settings: CutSettings

    def finished(self, search: Search[CutFit]) -> bool:
        """Whether no cause is left to add.

        Parameters
        ----------
        search
            Where the search stands.
        """
        return set(self.names) <= set(search.current.freed)

    def round(self, search: Search[CutFit]) -> Round[CutFit]:
        """Fit each further cause beside those accepted before, and choose the best that is worth it.

        Parameters
        ----------
        search
            Where the search stands.
        """
        current, least = search.current, self.settings.evidence.least
        ranked = best_first([self._proposed(current, name) for name in self.names if name not in current.freed])
        failed: list[str] = []
        for one in ranked:
            if one.evidence >= least and self._confirmed(current, one):
                equivalents = equivalents_of(ranked, one, self.settings.evidence.as_good)
                return Round(ranked, one, _weighed(ranked, failed), equivalents)
            failed += [one.name] if one.evidence >= least else []
        return Round(ranked, None, _weighed(ranked, failed))

    def without(self, search: Search[CutFit], place: int) -> CutFit:
        """The last step with one of its causes back at the numbers of the cutting file.

        Parameters
        ----------
        search
            Where the search ended.
        place
            Place of the cause among the accepted ones, from 0.
        """
        current, name = search.current, search.accepted[place].name
        fewer = tuple(one for one in current.freed if one != name)
        stated = current.hypothesis.cause(name).stated(self.cut.belief.process)
        return fit_turned(self.cut, current.hypothesis.with_values(name, stated), fewer)

    def needed(self, current: CutFit, base: CutFit) -> float:
        """Evidence that a further cause needs: the same beside any others.

        Parameters
        ----------
        current, base
            Fits with the causes so far and without any.
        """
        del current, base
        return self.settings.evidence.least

    def _proposed(self, current: CutFit, name: str) -> Proposal[CutFit]:
        fitted = fit_turned(self.cut, current.hypothesis, (*current.freed, name))
        return Proposal(name, {}, fitted, current.score - fitted.score)

    def _confirmed(self, current: CutFit, proposal: Proposal[CutFit]) -> bool:
        """Whether a number of the cause stands out of its error, and blocks that were not fitted gain."""
        fitted = proposal.fitted
        values = fitted.hypothesis.values(proposal.name)
        off = np.abs(values - fitted.hypothesis.cause(proposal.name).stated(self.cut.belief.process))
        errors = np.sqrt(np.diag(covariance_with_usual_error(self.cut, fitted, proposal.name)))
        if not np.any(off > self.settings.evidence.clear * errors):
            return False
        # both begin where the cause is absent, with teeth counted as the fit with it does: a half that says nothing of
        # the cause must not know it from the whole
        start = replace(current.hypothesis, laws=fitted.hypothesis.laws)
        without = fit_halves(self.cut, current.hypothesis, current.freed)
        with_it = fit_halves(self.cut, start, fitted.freed)
        gain = np.sum(held_out_misfits(without) - held_out_misfits(with_it))
        return bool(gain > self.settings.proof.gain)


def covariance_with_usual_error(cut: MeasuredCut, fitted: CutFit, name: str) -> Real:
    """Covariance of one freed cause's numbers by noise and by the force model's usual error, SI.

    Each line of a right force is off by a share, and all lines may be off together: a number that scales with the
    force is then off by the same share.

    Parameters
    ----------
    cut
        Recordings with the force model's usual error.
    fitted
        A fit with the cause.
    name
        Name of the cause.
    """
    own = np.diag((cut.force_error * fitted.hypothesis.values(name)) ** 2)
    return np.asarray(fitted.covariance_of(name) + own)


def _weighed(ranked: Sequence[Proposal[CutFit]], failed: Sequence[str]) -> tuple[Candidate, ...]:
    return tuple(Candidate(one.name, one.evidence, UNCONFIRMED if one.name in failed else "fitted") for one in ranked)


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
