"""What is wrong with a robot's model, from recordings in one or more postures."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from robot_model import SpatialRobot, possible_changes

from ...inference import (
    AcceptedCause,
    Diagnosis,
    Findings,
    LabError,
    Progress,
    Remainder,
    Search,
    Settings,
    search,
    verdict_of,
)
from .comparison import RobotComparison
from .fit import RobotFit
from .held_out import HeldOutTest, folds_of, held_out_errors, improvement, lowers, raised
from .number_errors import number_errors
from .posed_recording import PosedRecording
from .posed_robot import posed_robot
from .results import RobotDetails, RobotDiagnosis, accepted_cause, content_of
from .settings import ROBOT
from .start import fit_from, free_fit, nearest

Real = NDArray[np.float64]


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
