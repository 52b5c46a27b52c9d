"""Diagnosis of the model of a robot from recordings in one or more postures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from millfrf.core import Real
from millfrf.core.compilation import DIAGNOSIS, compile_kernels
from millfrf.robot_model import Change, SpatialRobot, possible_changes

from ..inference.diagnosis import AcceptedCause, Candidate, Diagnosis, Findings, Remainder, verdict_of
from ..inference.search import Progress, Proposal, Round, Search, best_first, equivalents_of, search
from ..inference.settings import LabError, Settings
from .fit import FreeFit, RobotFit, best_start, fit_from, free_fit, nearest, numbered
from .posed import ROBOT, Changes, PosedRobot, posed_robot
from .receptance import PosedRecording
from .results import (
    Fold,
    HeldOutTest,
    RobotDetails,
    RobotDiagnosis,
    accepted_cause,
    candidate_of,
    content_of,
    folds_of,
    held_out_errors,
    held_out_test,
    improvement,
    location_of,
    lowers,
    number_errors,
    raised,
)

NO_GAIN = "does not lower the error held out"  # stage of a change that has evidence but was not confirmed


@dataclass(frozen=True)
class RobotComparison:
    """A robot in the postures of its recordings, and its possible changes."""

    settings: Settings  # thresholds of a diagnosis
    robot: PosedRobot
    changes: tuple[Change, ...]
    free: FreeFit
    folds: tuple[Fold, ...]  # recordings left out in turn
    _tests: dict[Changes, HeldOutTest] = field(default_factory=dict, repr=False, compare=False)

    def excess(self, fitted: RobotFit) -> float:
        """Return the excess of a fit's cost over that of free modes, per deviation that the recordings determine.

        It is at most about 1 for a correct robot model.
        """
        return (fitted.cost - self.free.fitted.misfit) / max(fitted.determined, 1.0)

    def held_out(self, changes: Changes) -> HeldOutTest:
        """Return the errors of changes on held-out recordings; each hypothesis is tested once."""
        if changes not in self._tests:
            self._tests[changes] = held_out_test(self.folds, changes)
        return self._tests[changes]

    def finished(self, search: Search[RobotFit]) -> bool:
        """Return whether at least one round was made and the residual passes for noise."""
        return bool(search.rounds) and self.excess(search.current) < self.settings.verdict.noise_like

    def needed(self, current: RobotFit, base: RobotFit) -> float:
        """Return the evidence that a further change needs; it does not depend on the accepted changes."""
        return self.settings.evidence.least

    def without(self, search: Search[RobotFit], place: int) -> RobotFit:
        """Fit the last hypothesis without one change and the companions of this change."""
        changes = search.current.changes
        removed = next(change for change, _ in changes if change.name == search.accepted[place].name)
        own = (removed, *removed.companions) if isinstance(removed, Change) else (removed,)
        return fit_from(self.robot, tuple(pair for pair in changes if pair[0] not in own), self.free)

    def round(self, search: Search[RobotFit]) -> Round[RobotFit]:
        """Rank all further changes, and choose the first that lowers the held-out error.

        A different change with sufficient evidence replaces it if its held-out error is at most a quarter as large.
        Evidence alone allows a small deviation of every mode in each posture, and does not prove that one number
        corrects all postures. Recordings in a single posture cannot prove this either, so that nothing is replaced.
        """
        ranked = self._ranked(search.current)
        before, limits = self.held_out(search.current.changes), self.settings
        stages: dict[str, str] = {}
        chosen: Proposal[RobotFit] | None = None
        for candidate in [proposal for proposal in ranked if proposal.evidence >= limits.evidence.least][
            : limits.search.most_tested
        ]:
            if not lowers(before, self.held_out(candidate.fitted.changes), limits.proof):
                stages[candidate.name] = NO_GAIN
            elif chosen is None:
                chosen = candidate
            elif self.robot.several_postures and self._beats(candidate, chosen):
                stages[chosen.name] = f"beaten by {candidate.name} on what was held out"
                chosen = candidate
            elif self.robot.several_postures and self._beats(chosen, candidate):
                stages[candidate.name] = f"beaten by {chosen.name} on what was held out"
        return Round(ranked, chosen, _candidates(ranked, stages), self._equivalents(ranked, chosen, stages))

    def _ranked(self, current: RobotFit) -> tuple[Proposal[RobotFit], ...]:
        """Fit every further change in addition to the accepted changes; return them with most evidence first."""
        present = {change.name for change, _ in current.changes}
        return best_first([self._proposal(current, change) for change in self.changes if change.name not in present])

    def _proposal(self, current: RobotFit, change: Change) -> Proposal[RobotFit]:
        """Fit a further change from two starts, no change and its best number, and return the better fit."""
        starts = [(*current.changes, *numbered(change, change.neutral))]
        start, left = best_start(self.robot, current.changes, change)
        starts += [start] if np.isfinite(left) else []
        fitted = min((fit_from(self.robot, start, self.free) for start in starts), key=lambda candidate: candidate.cost)
        # if the fit ends with a higher cost than without the change, the gain is zero, and only the price counts
        evidence = max(current.cost - fitted.cost, 0.0) - (fitted.price - current.price)
        return Proposal(change.name, location_of(change), fitted, evidence)

    def _beats(self, proposal: Proposal[RobotFit], other: Proposal[RobotFit]) -> bool:
        """Return whether the held-out error with ``proposal`` is at most a small share of the error with ``other``."""
        own_error, other_error = (self.held_out(proposal.fitted.changes).beyond for proposal in (proposal, other))
        return own_error <= self.settings.proof.beaten * other_error

    def _equivalents(
        self, ranked: tuple[Proposal[RobotFit], ...], chosen: Proposal[RobotFit] | None, stages: Mapping[str, str]
    ) -> tuple[str, ...]:
        """Return the names of changes that are as good as the chosen one and not excluded by held-out recordings."""
        if chosen is None:
            return ()
        return equivalents_of(
            [proposal for proposal in ranked if proposal.name not in stages], chosen, self.settings.evidence.as_good
        )


def _candidates(ranked: tuple[Proposal[RobotFit], ...], stages: Mapping[str, str]) -> tuple[Candidate, ...]:
    return tuple(candidate_of(proposal, stages.get(proposal.name, "fitted")) for proposal in ranked)


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
    """Find the change of a robot that explains recordings: joint stiffness, links, payload, posture or damping.

    Each change is fitted together with deviations u of all modes (frequency, damping, shape), which are independent in
    each posture and have the standard deviation ``error`` for a correct model. The score is ``2 sum r^H V^-1 r + |u|^2
    + n ln N``, so that a change must be more likely than deviations of the modes. It must also lower the error on
    held-out recordings significantly. A further change is searched for if the residual is more than noise.

    Parameters
    ----------
    robot
        Robot of the robot file.
    recordings
        One or more recordings, preferably in several postures, as each posture loads the joints differently.
    rigid_links
        Whether the model with rigid links is tested; the sections of the file are then a candidate.
    payload_at : (3,), m
        Place of a possible payload, from the tip in the tool frame; None: it is fitted with the mass.
    sensor : (3,), m
        Place of the housing sensor from the tip, in the axes of the recordings; needed if motion of the housing was
        recorded.
    error
        Standard deviation of the errors of the modes of a correct model; None: the value of ``settings``.
    most_causes
        Largest number of accepted changes; None: the value of ``settings``.
    settings
        Thresholds, and names of the changes that are compared; None: :data:`ROBOT`.
    progress
        Called with a short text when a new stage begins.

    Raises
    ------
    InputError
        No recording, a housing sensor without its place, or a band without modes.
    """
    compile_kernels(*DIAGNOSIS)
    settings = settings or ROBOT
    search_settings = replace(settings.search, most_causes=most_causes or settings.search.most_causes)
    settings = replace(settings, lab=error or settings.lab, search=search_settings)
    report = progress or (lambda _: None)
    compared = posed_robot(robot, recordings, settings.lab, rigid_links=rigid_links, sensor=sensor)
    changes = [
        change
        for change in possible_changes(robot, payload_at=payload_at, rigid_links=rigid_links)
        if settings.causes is None or change.name in settings.causes
    ]
    report("modes and noise")
    start = nearest(compared, changes, settings.evidence.least)
    free = free_fit(compared, start)
    comparison = RobotComparison(settings, compared, tuple(changes), free, folds_of(compared, free, start))
    return _result(comparison, search(comparison, fit_from(compared, (), free), report))


def _result(comparison: RobotComparison, search_result: Search[RobotFit]) -> RobotDiagnosis:
    """Return the diagnosis of a search; changes that held-out recordings do not confirm are not reported."""
    proof, compared, names = comparison.settings.proof, comparison.robot, [fold.name for fold in comparison.folds]
    before = comparison.held_out(())
    equivalents = _equivalents(search_result)
    verdict = _verdict(comparison, search_result, equivalents)
    final = search_result.base if verdict in ("none", "unexplained") else search_result.current
    after = comparison.held_out(final.changes)
    physics: tuple[AcceptedCause, ...] = ()
    if final.changes:
        errors = number_errors(compared, final, after, comparison.changes, comparison.free)
        physics = tuple(accepted_cause(proposal, final, errors) for proposal in search_result.accepted)
    return Diagnosis(
        "robot",
        verdict,
        physics,
        search_result.rounds[0].candidates if search_result.rounds else (),
        equivalents if physics else (),
        improvement(names, before, after, proof),
        _remainder(comparison, search_result.base),
        _remainder(comparison, final),
        {},
        RobotDetails(compared, search_result.base, final, comparison.free),
        held_out_errors(names, before, after),
        content={"robot": content_of(compared)},
    )


def _remainder(comparison: RobotComparison, fitted: RobotFit) -> Remainder:
    excess = comparison.excess(fitted)
    return Remainder(excess, excess)


def _equivalents(search_result: Search[RobotFit]) -> tuple[str, ...]:
    """Return the names of changes that the recordings cannot distinguish from the last accepted one."""
    names = {proposal.name for proposal in search_result.accepted}
    rounds = [round_ for round_ in search_result.rounds if round_.chosen is not None and round_.chosen.name in names]
    return rounds[-1].equivalents if rounds else ()


def _verdict(comparison: RobotComparison, search_result: Search[RobotFit], equivalents: Sequence[str]) -> str:
    """Return the verdict from the residual and the held-out test."""
    limits, proof = comparison.settings.verdict, comparison.settings.proof
    before, after = (comparison.held_out(fitted.changes) for fitted in (search_result.base, search_result.current))
    named = bool(search_result.accepted) and lowers(before, after, proof)
    verdict = verdict_of(
        Findings(
            _remainder(comparison, search_result.base),
            _remainder(comparison, search_result.current),
            named=named,
            # a change that is not confirmed is dropped and is no evidence against the nominal robot
            incomplete=named and bool(raised(before, after, proof)),
            # a sufficient share of the squared held-out error beyond noise was removed
            halved=after.beyond <= (1 - limits.partly) * before.beyond,
        ),
        limits,
    )
    return "class" if verdict == "explained" and equivalents else verdict
