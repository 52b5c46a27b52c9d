"""`CutComparison`: which causes are proposed for a computed cutting force, and when one is worth it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...inference import Candidate, Proposal, Round, Search, best_first, equivalents_of
from .fits import CutFit, MeasuredCut, fit_turned
from .held_out import fit_halves, held_out_misfits
from .settings import CutSettings

Real = NDArray[np.float64]

UNCONFIRMED = "fitted, but not confirmed: within its own error, or no gain on blocks held out"
"""Stage of a cause with evidence that was not accepted."""


@dataclass(frozen=True)
class CutComparison:
    """A cut as :func:`mismatch.inference.forward_search` wants it.

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
