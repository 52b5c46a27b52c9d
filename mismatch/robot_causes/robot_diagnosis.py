"""What is wrong with a robot's model, from recordings in one or more postures."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from foundation import InputError
from robot_model import Change, SpatialRobot, modes_at, possible_changes

from ..shape_of_model import LabError
from .posed_recording import PosedRecording
from .robot_fit import RobotFit
from .robot_held_out import held_out
from .robot_results import RobotCause, RobotDiagnosis
from .robot_search import FreeFit, best_starts, fit_from, free_fit, what_is_left
from .robot_setting import Changes, Setting

Real = NDArray[np.float64]

LEAST_EVIDENCE = 20.0
"""Gain in score below which no change is accepted, as everywhere in :mod:`mismatch`."""

AS_GOOD = 6.0
"""Score by which another change may be worse and still not be told from the best: a likelihood ratio of 20."""

NOISE_LIKE = 2.0
"""Excess (see :class:`RobotDiagnosis`) up to which a model passes as right: 1 is expected where its belief is met."""

REACH = 3.0
"""Modes up to so many times the band's upper end may deviate: those above it lend it their flexibility."""

EXPLAINED = 0.9
"""Share of what the nominal robot left that the changes must take away, unless what is left is noise-like."""

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

    Every change has one number. Each is fitted together with the deviations of all modes (frequency, damping, shape)
    that a right model still has, ``error``, independent in each posture; the score is
    ``2 sum r^H V^-1 r + |u|^2 + n ln N``, so that a change must gain more than deviations cost. A further change is
    sought where the first leaves more than noise.

    Parameters
    ----------
    robot
        As its file has it.
    recordings
        Best in several postures: each loads the joints in another way.
    rigid_links
        Question the model with its links made rigid; the file's sections are then a candidate.
    payload_at : (3,), m
        Where a payload would hang, from the tip in the tool frame; None: at the tip.
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
    free = free_fit(setting, _nearest(setting, changes))
    nominal = fit_from(setting, (), free)
    accepted: list[RobotCause] = []
    candidates: tuple[RobotCause, ...] = ()
    equivalents: tuple[str, ...] = ()
    current = nominal
    while len(accepted) < most_causes:
        if accepted and _excess(current, free) < NOISE_LIKE:
            break
        ranked = _ranked(setting, current, changes, free)
        if not accepted:
            candidates = tuple(cause for cause, _ in ranked)
        best, fitted = ranked[0]
        if best.evidence < LEAST_EVIDENCE:
            break
        accepted = [*_updated(accepted, fitted), best]
        equivalents = tuple(one.name for one, _ in ranked[1:] if one.evidence > best.evidence - AS_GOOD)
        current = fitted
    before, after = _excess(nominal, free), _excess(current, free)
    verdict = _verdict(bool(accepted), bool(equivalents), before, after)
    held = held_out(setting, current.changes)
    return RobotDiagnosis(
        verdict, tuple(accepted), equivalents, candidates, before, after, held, setting, nominal, current, free
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


def _ranked(
    setting: Setting, current: RobotFit, changes: Sequence[Change], free: FreeFit
) -> list[tuple[RobotCause, RobotFit]]:
    """Every further change fitted, best first."""
    price = float(np.log(2 * sum(one.lines.measured.size for one in setting.recordings)))
    ranked = []
    for change in changes:
        if any(change.name == other.name for other, _ in current.changes):
            continue
        starts = [(*current.changes, (change, change.neutral))]
        starts += [one.changes for one in best_starts(setting, current.changes, change) if np.isfinite(one.left)]
        fitted = min((fit_from(setting, start, free) for start in starts), key=lambda one: one.cost)
        evidence = max(current.cost - fitted.cost, 0.0) - price
        number, spread = fitted.changes[-1][1], float(fitted.standard_errors[-1])
        cause = RobotCause(change.name, change.kind, change.unit, number, spread, evidence)
        ranked.append((cause, fitted))
    return sorted(ranked, key=lambda pair: -pair[0].evidence)


def _updated(causes: list[RobotCause], fitted: RobotFit) -> list[RobotCause]:
    """Causes accepted before with the numbers that they have beside a further one."""
    pairs = zip(causes, fitted.changes, fitted.standard_errors, strict=False)
    return [replace(cause, number=number, standard_error=float(error)) for cause, (_, number), error in pairs]


def _excess(fitted: RobotFit, free: FreeFit) -> float:
    """What a fit costs beyond free modes, for each deviation that the recordings tell."""
    return (fitted.cost - free.fitted.misfit) / max(fitted.told, 1.0)


def _verdict(accepted: bool, equivalents: bool, before: float, after: float) -> str:
    if after > max(NOISE_LIKE, (1 - EXPLAINED) * before):
        return "unexplained"
    if not accepted:
        return "none"
    return "class" if equivalents else "explained"
