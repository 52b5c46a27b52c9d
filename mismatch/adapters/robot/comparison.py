"""`RobotComparison`: what the inference core asks of a robot, and which change is chosen in a round."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from robot_model import Change

from ...inference import Candidate, Proposal, Round, Search, Settings, best_first, equivalents_of
from .fit import RobotFit
from .held_out import Fold, HeldOutTest, held_out_test, lowers
from .posed_robot import Changes, PosedRobot
from .results import candidate_of, location_of
from .start import FreeFit, best_start, fit_from, numbered

NO_GAIN = "does not lower the error held out"
"""Stage of a change with evidence that was fitted but not confirmed."""


@dataclass(frozen=True)
class RobotComparison:
    """A robot in the postures of its recordings, and the changes that may be wrong with it.

    Parameters
    ----------
    settings
        Thresholds of a diagnosis.
    robot
        The robot in the postures of its recordings.
    changes
        All changes that are weighed.
    free
        Modes and noise as the recordings show them.
    folds
        Recordings left out in turn.
    """

    settings: Settings
    robot: PosedRobot
    changes: tuple[Change, ...]
    free: FreeFit
    folds: tuple[Fold, ...]
    _tests: dict[Changes, HeldOutTest] = field(default_factory=dict, repr=False, compare=False)

    def excess(self, fitted: RobotFit) -> float:
        """What a fit costs beyond free modes, for each deviation that the recordings tell.

        It is at most 1 where the robot is right.

        Parameters
        ----------
        fitted
            Hypothesis that was fitted to the recordings.
        """
        return (fitted.cost - self.free.fitted.misfit) / max(fitted.told, 1.0)

    def held_out(self, changes: Changes) -> HeldOutTest:
        """What changes are worth on recordings left out; each hypothesis is tested once.

        Parameters
        ----------
        changes
            Changes with their numbers.
        """
        if changes not in self._tests:
            self._tests[changes] = held_out_test(self.folds, changes)
        return self._tests[changes]

    def finished(self, search: Search[RobotFit]) -> bool:
        """Whether a round was made and what is left passes for noise.

        Parameters
        ----------
        search
            Where the search stands.
        """
        return bool(search.rounds) and self.excess(search.current) < self.settings.verdict.noise_like

    def needed(self, current: RobotFit, base: RobotFit) -> float:
        """Evidence that a change needs, whatever was accepted before.

        Parameters
        ----------
        current, base
            Fits with the accepted changes and without any.
        """
        return self.settings.evidence.least

    def without(self, search: Search[RobotFit], place: int) -> RobotFit:
        """The last hypothesis fitted without one of its changes and the companions of that.

        Parameters
        ----------
        search
            Where the search stands.
        place
            Which of the accepted changes is taken away.
        """
        changes = search.current.changes
        gone = next(one for one, _ in changes if one.name == search.accepted[place].name)
        own = (gone, *gone.companions) if isinstance(gone, Change) else (gone,)
        return fit_from(self.robot, tuple(pair for pair in changes if pair[0] not in own), self.free)

    def round(self, search: Search[RobotFit]) -> Round[RobotFit]:
        """Rank every further change, and choose the first that lowers the error on recordings held out.

        Another with evidence takes its place where it leaves a quarter or less of its error there: evidence alone
        allows every mode to be off a little in each posture, and so does not see that one number mends all postures.
        Halves of one recording, or recordings in one posture, do not show that: there nothing is beaten.

        Parameters
        ----------
        search
            Where the search stands.
        """
        ranked = self._ranked(search.current)
        before, limits = self.held_out(search.current.changes), self.settings
        stages: dict[str, str] = {}
        chosen: Proposal[RobotFit] | None = None
        for one in [one for one in ranked if one.evidence >= limits.evidence.least][: limits.search.most_tested]:
            if not lowers(before, self.held_out(one.fitted.changes), limits.proof):
                stages[one.name] = NO_GAIN
            elif chosen is None:
                chosen = one
            elif self.robot.several_postures and self._beats(one, chosen):
                stages[chosen.name] = f"beaten by {one.name} on what was held out"
                chosen = one
            elif self.robot.several_postures and self._beats(chosen, one):
                stages[one.name] = f"beaten by {chosen.name} on what was held out"
        return Round(ranked, chosen, _candidates(ranked, stages), self._equivalents(ranked, chosen, stages))

    def _ranked(self, current: RobotFit) -> tuple[Proposal[RobotFit], ...]:
        """Every further change fitted, best first."""
        there = {one.name for one, _ in current.changes}
        return best_first([self._proposal(current, change) for change in self.changes if change.name not in there])

    def _proposal(self, current: RobotFit, change: Change) -> Proposal[RobotFit]:
        """A further change fitted from where nothing is changed, and from the number that leaves least."""
        starts = [(*current.changes, *numbered(change, change.neutral))]
        start, left = best_start(self.robot, current.changes, change)
        starts += [start] if np.isfinite(left) else []
        fitted = min((fit_from(self.robot, start, self.free) for start in starts), key=lambda one: one.cost)
        # a fit that ends above the one without the change has not gained, but pays no more than its price
        evidence = max(current.cost - fitted.cost, 0.0) - (fitted.price - current.price)
        return Proposal(change.name, location_of(change), fitted, evidence)

    def _beats(self, one: Proposal[RobotFit], other: Proposal[RobotFit]) -> bool:
        """Whether a change leaves little of another's error on recordings held out."""
        mine, theirs = (self.held_out(each.fitted.changes).beyond for each in (one, other))
        return mine <= self.settings.proof.beaten * theirs

    def _equivalents(
        self, ranked: tuple[Proposal[RobotFit], ...], chosen: Proposal[RobotFit] | None, stages: Mapping[str, str]
    ) -> tuple[str, ...]:
        """Changes as good as the chosen one that the recordings held out do not rule out."""
        if chosen is None:
            return ()
        return equivalents_of([one for one in ranked if one.name not in stages], chosen, self.settings.evidence.as_good)


def _candidates(ranked: tuple[Proposal[RobotFit], ...], stages: Mapping[str, str]) -> tuple[Candidate, ...]:
    return tuple(candidate_of(one, stages.get(one.name, "fitted")) for one in ranked)
