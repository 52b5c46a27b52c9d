"""Diagnosis of a robot's model from recordings in one or more postures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from millfrf.core import Real
from millfrf.core.compilation import DIAGNOSIS, compile_kernels
from millfrf.robot_model import Change, SpatialRobot, possible_changes

from ..inference.diagnosis import AcceptedCause, Candidate, Diagnosis, Findings, Remainder, verdict_of
from ..inference.search import Progress, Proposal, Round, Search, best_first, equivalents_of, search
from ..inference.settings import LabError, Settings
from .fit import RobotFit
from .held_out import (
    Fold,
    HeldOutTest,
    folds_of,
    held_out_errors,
    held_out_test,
    improvement,
    lowers,
    number_errors,
    raised,
)
from .posed import ROBOT, Changes, PosedRobot, posed_robot
from .receptance import PosedRecording
from .results import RobotDetails, RobotDiagnosis, accepted_cause, candidate_of, content_of, location_of
from .start import FreeFit, best_start, fit_from, free_fit, nearest, numbered

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


def diagnose_robot(
    robot: SpatialRobot,
    recordings: Sequence[PosedRecording],
    *,
    rigid_links: bool = False,
    payload_at: Real | None = None,
    sensor: Real | None = None,
    error: LabError | None = None,
    most_causes: int | None = None,
    settings: Settings | None = None,
    progress: Progress | None = None,
) -> RobotDiagnosis:
    """Which change of the robot explains the recordings: a joint's stiffness, links, payload, posture, damping.

    Every change is fitted together with the deviations of all modes (frequency, damping, shape) that a right model
    still has, ``error``, independent in each posture; the score is ``2 sum r^H V^-1 r + |u|^2 + n ln N``, so that a
    change must gain more than deviations cost. It must also lower the error on recordings left out of the fit, by more
    than chance. A further change is sought where the first leaves more than noise.

    Parameters
    ----------
    robot
        The robot as its file has it.
    recordings
        One or more recordings, best in several postures: each loads the joints in another way.
    rigid_links
        Whether the model with its links made rigid is questioned; the file's sections are then a candidate.
    payload_at : (3,), m
        Place at which a payload would hang, from the tip in the tool frame; None: its place is fitted with its mass.
    sensor : (3,), m
        Place of the housing sensor from the tip, in the recordings' axes; needed where motion of the housing
        was recorded.
    error
        One standard deviation of what the modes of a right model are still off; None: that of ``settings``.
    most_causes
        Number of changes accepted at most; None: that of ``settings``.
    settings
        Thresholds, and by their names the changes that are weighed; None: those of :data:`ROBOT`.
    progress
        Called with a short text when a new stage begins.

    Raises
    ------
    InputError
        No recording, a housing sensor without its place, or a band without modes.
    """
    compile_kernels(*DIAGNOSIS)
    settings = settings or ROBOT
    most = replace(settings.search, most_causes=most_causes or settings.search.most_causes)
    settings = replace(settings, lab=error or settings.lab, search=most)
    tell = progress or (lambda _: None)
    compared = posed_robot(robot, recordings, settings.lab, rigid_links=rigid_links, sensor=sensor)
    changes = [
        change
        for change in possible_changes(robot, payload_at=payload_at, rigid_links=rigid_links)
        if settings.causes is None or change.name in settings.causes
    ]
    tell("modes and noise")
    near = nearest(compared, changes, settings.evidence.least)
    free = free_fit(compared, near)
    comparison = RobotComparison(settings, compared, tuple(changes), free, folds_of(compared, free, near))
    return _told(comparison, search(comparison, fit_from(compared, (), free), tell))


def _told(comparison: RobotComparison, found: Search[RobotFit]) -> RobotDiagnosis:
    """Verdict and numbers of a search; nothing is told of changes that do not hold on recordings held out."""
    proof, compared, names = comparison.settings.proof, comparison.robot, [one.name for one in comparison.folds]
    before = comparison.held_out(())
    equivalents = _equivalents(found)
    verdict = _verdict(comparison, found, equivalents)
    final = found.base if verdict in ("none", "unexplained") else found.current
    after = comparison.held_out(final.changes)
    physics: tuple[AcceptedCause, ...] = ()
    if final.changes:
        errors = number_errors(compared, final, after, comparison.changes, comparison.free)
        physics = tuple(accepted_cause(one, final, errors) for one in found.accepted)
    return Diagnosis(
        "robot",
        verdict,
        physics,
        found.rounds[0].candidates if found.rounds else (),
        equivalents if physics else (),
        improvement(names, before, after, proof),
        _remainder(comparison, found.base),
        _remainder(comparison, final),
        {},
        RobotDetails(compared, found.base, final, comparison.free),
        held_out_errors(names, before, after),
        content={"robot": content_of(compared)},
    )


def _remainder(comparison: RobotComparison, fitted: RobotFit) -> Remainder:
    excess = comparison.excess(fitted)
    return Remainder(excess, excess)


def _equivalents(found: Search[RobotFit]) -> tuple[str, ...]:
    """Names of changes that the recordings cannot tell from the change that was accepted last."""
    named = {one.name for one in found.accepted}
    rounds = [one for one in found.rounds if one.chosen is not None and one.chosen.name in named]
    return rounds[-1].equivalents if rounds else ()


def _verdict(comparison: RobotComparison, found: Search[RobotFit], equivalents: Sequence[str]) -> str:
    """The verdict, from what is left and from whether the changes hold on recordings held out."""
    limits, proof = comparison.settings.verdict, comparison.settings.proof
    before, after = (comparison.held_out(one.changes) for one in (found.base, found.current))
    named = bool(found.accepted) and lowers(before, after, proof)
    verdict = verdict_of(
        Findings(
            _remainder(comparison, found.base),
            _remainder(comparison, found.current),
            named=named,
            # a change that is not proven is dropped, and says nothing against the robot as modelled
            incomplete=named and bool(raised(before, after, proof)),
            halved=_halved(before, after, limits.partly),
        ),
        limits,
    )
    return "class" if verdict == "explained" and equivalents else verdict


def _halved(before: HeldOutTest, after: HeldOutTest, share: float) -> bool:
    """Whether a share of the squared error beyond noise is gone on recordings held out."""
    return after.beyond <= (1 - share) * before.beyond
