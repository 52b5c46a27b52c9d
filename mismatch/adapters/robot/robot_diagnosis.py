"""What is wrong with a robot's model, from recordings in one or more postures."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from foundation import InputError
from robot_model import Change, SpatialRobot, modes_at, possible_changes

from ...models.model_shape import LabError
from .posed_recording import PosedRecording
from .robot_choice import LEAST_EVIDENCE, Choice, chosen, pruned
from .robot_errors import number_errors
from .robot_fit import RobotFit
from .robot_held_out import Tested, chance, folds_of, lowers, raised, tested
from .robot_results import RobotCause, RobotDiagnosis
from .robot_search import FreeFit, best_starts, fit_from, free_fit, what_is_left
from .robot_setting import Changes, Setting
from .robot_telling import fit_errors, held_out_table, told_causes

Real = NDArray[np.float64]

NOISE_LIKE = 2.0
"""Excess (see :class:`RobotDiagnosis`) up to which a model passes as right: 1 is expected where its belief is met."""

REACH = 3.0
"""Modes up to so many times the band's upper end may deviate: those above it lend it their flexibility."""

EXPLAINED = 0.9
"""Share of what the nominal robot left that the changes must take away, unless what is left is noise-like."""

PARTLY = 0.5
"""Share that changes must take away, there and of the squared error on recordings held out, to be told at all."""

ROBOT_ERROR = LabError(frequency=0.01, damping=0.15, shape=0.05)
"""What the modes of a right robot model are still off: one per cent, 15 per cent, a twentieth of a shape's size."""


def diagnose_robot(
    robot: SpatialRobot,
    recordings: Sequence[PosedRecording],
    *,
    rigid_links: bool = False,
    payload_at: Real | None = None,
    sensor: Real | None = None,
    error: LabError = ROBOT_ERROR,
    most_causes: int = 2,
) -> RobotDiagnosis:
    """Which change of the robot explains the recordings: a joint's stiffness, links, payload, posture, damping.

    Every change is fitted together with the deviations of all modes (frequency, damping, shape) that a right model
    still has, ``error``, independent in each posture; the score is ``2 sum r^H V^-1 r + |u|^2 + n ln N``, so that a
    change must gain more than deviations cost. It must also lower the error on recordings left out of the fit, by more
    than chance. A further change is sought where the first leaves more than noise.

    Parameters
    ----------
    robot
        As its file has it.
    recordings
        Best in several postures: each loads the joints in another way.
    rigid_links
        Question the model with its links made rigid; the file's sections are then a candidate.
    payload_at : (3,), m
        Where a payload would hang, from the tip in the tool frame; None: fitted with its mass.
    sensor : (3,), m
        Housing sensor from the tip, in the recordings' axes; needed where motion of the housing was recorded.
    error
        As above.
    most_causes
        Changes accepted at most.

    Raises
    ------
    InputError
        No recording, a housing sensor without its place, or a band without modes.
    """
    setting = _setting(robot, recordings, rigid_links, sensor, error)
    changes = possible_changes(robot, payload_at=payload_at, rigid_links=rigid_links)
    near = _nearest(setting, changes)
    free = free_fit(setting, near)
    nominal = fit_from(setting, (), free)
    folds = folds_of(setting, free, near)
    before = current = tested(folds, ())
    fitted = nominal
    rounds: list[Choice] = []
    while len(rounds) < most_causes and not (rounds and _excess(fitted, free) < NOISE_LIKE):
        choice = chosen(setting, fitted, changes, free, folds, current)
        rounds.append(choice)
        if choice.best is None:
            break
        fitted, current = choice.best[0].fitted, choice.best[1]
    if len(names_of(fitted)) > 1:
        fitted = pruned(setting, fitted, free)
        current = tested(folds, fitted.changes)
    found = _Found(setting, nominal, fitted, free, before, current, tuple(rounds), tuple(one.name for one in folds))
    verdict = _verdict(found)
    if verdict in ("none", "unexplained"):
        found = replace(found, fitted=nominal, after=before)
    return _result(found, verdict, changes)


@dataclass(frozen=True)
class _Found:
    """Where a search ends: fits, errors on recordings held out, rounds."""

    setting: Setting
    nominal: RobotFit
    fitted: RobotFit
    free: FreeFit
    before: Tested
    after: Tested
    rounds: tuple[Choice, ...]
    names: tuple[str, ...]

    @property
    def equivalents(self) -> tuple[str, ...]:
        """Of the change that was accepted last."""
        named = [
            one for one in self.rounds if one.best is not None and one.best[0].change.name in names_of(self.fitted)
        ]
        return named[-1].equivalents if named else ()


def names_of(fitted: RobotFit) -> list[str]:
    """Names of the changes of a fit, without their companions."""
    return [change.name for change, _ in fitted.changes if isinstance(change, Change)]


def _result(found: _Found, verdict: str, changes: Sequence[Change]) -> RobotDiagnosis:
    setting, fitted = found.setting, found.fitted
    causes: tuple[RobotCause, ...] = ()
    if fitted.changes:
        errors = number_errors(setting, fitted, found.after, changes, found.free)
        evidence = {one.change.name: one.evidence for choice in found.rounds for one in choice.ranked}
        causes = told_causes(fitted, errors, evidence)
    first = found.rounds[0]
    plain = {one.change.name: fit_errors(one.fitted) for one in first.ranked}
    candidates = tuple(
        replace(told_causes(one.fitted, plain[one.change.name], {one.change.name: one.evidence})[-1],
                stage=first.stages.get(one.change.name, ""))
        for one in first.ranked
    )  # fmt: skip
    return RobotDiagnosis(
        verdict,
        causes,
        found.equivalents if causes else (),
        candidates,
        _excess(found.nominal, found.free),
        _excess(fitted, found.free),
        held_out_table(found.names, found.before, found.after),
        chance(found.before.blocks, found.after.blocks),
        setting,
        found.nominal,
        fitted,
        found.free,
    )


def _setting(
    robot: SpatialRobot,
    recordings: Sequence[PosedRecording],
    rigid_links: bool,
    sensor: Real | None,
    error: LabError,
) -> Setting:
    if not recordings:
        raise InputError("no recording given; name one or more, each with its posture")
    if sensor is None and any(label.startswith("HOUSING") for one in recordings for label in one.responses):
        raise InputError("motion of the housing was recorded; say where the sensor is, from the tip: --sensor X Y Z")
    counts = []
    for one in recordings:
        natural = modes_at(robot, one.q).frequencies
        counts.append(int(np.sum(natural < REACH * one.lines.frequencies[-1])))
        if not counts[-1]:
            raise InputError(
                f"{one.name}: the robot's lowest mode, {natural[0]:.4g} Hz, is above the band; raise --band"
            )
    place = np.zeros(3) if sensor is None else np.asarray(sensor, dtype=float)
    setting = Setting(robot, rigid_links, tuple(recordings), place, error, tuple(counts))
    if not rigid_links:
        return setting
    few = [min(count, len(modes.natural)) for count, modes in zip(counts, setting.modes(()), strict=True)]
    return replace(setting, counts=tuple(few))


def _nearest(setting: Setting, changes: Sequence[Change]) -> Changes:
    """The robot, changed in one thing if that is clearly better, that leaves least of the recordings as it stands."""
    starts = [best_starts(setting, (), change, 1)[0] for change in changes]
    best = min(starts, key=lambda start: start.left)
    return best.changes if best.left < what_is_left(setting, ()) - LEAST_EVIDENCE else ()


def _excess(fitted: RobotFit, free: FreeFit) -> float:
    """What a fit costs beyond free modes, for each deviation that the recordings tell."""
    return (fitted.cost - free.fitted.misfit) / max(fitted.told, 1.0)


def _verdict(found: _Found) -> str:
    """See :class:`RobotDiagnosis`: what is left decides, and whether changes hold on recordings held out."""
    before, after = (_excess(one, found.free) for one in (found.nominal, found.fitted))
    little = after <= max(NOISE_LIKE, (1 - EXPLAINED) * before)
    if not found.fitted.changes:
        return "none" if little else "unexplained"
    if not lowers(found.before, found.after):
        return "none" if before <= NOISE_LIKE else "unexplained"
    if little and not raised(found.before, found.after):
        return "class" if found.equivalents else "explained"
    less = after <= max(NOISE_LIKE, (1 - PARTLY) * before)
    return "partly explained" if less and found.after.beyond <= (1 - PARTLY) * found.before.beyond else "unexplained"
