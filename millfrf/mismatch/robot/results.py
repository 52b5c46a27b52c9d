"""Held-out tests of a fitted robot, standard errors of its numbers, and the entries of results and files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from estimation import WindowedSpectrum
from millfrf.core import Real
from millfrf.robot_model import Change, SpatialRobot, changed_robot, unnamed_changes

from ..inference.diagnosis import AcceptedCause, Candidate, Diagnosis, HeldOutError, Improvement
from ..inference.numerics import jackknife_variance, ratio_interval, shift_weight
from ..inference.search import Proposal
from ..inference.settings import ProofSettings
from .fit import FreeFit, RobotFit, fit_from, free_fit, numbered
from .posed import LIMITS, ROBOT, Changes, PosedRobot
from .receptance import RobotModes, halves, predicted_spectrum


@dataclass(frozen=True)
class Fold:
    """One recording that is held out, and the recordings to which the fits are made."""

    name: str
    others: PosedRobot
    alone: PosedRobot
    seen: FreeFit  # free fit to the other recordings
    floor: float  # relative error of modes fitted freely to the held-out recording


@dataclass(frozen=True)
class HeldOutTest:
    """Errors of changes on recordings to which they were not fitted."""

    numbers: Real  # numbers of the changes and companions, fitted without the recording left out, (n_folds, n_numbers)
    # errors relative to the root mean square response, (n_folds,): of the robot without deviations of modes, and of
    # modes that are fitted freely
    errors: Real
    floors: Real
    # squared error of each block of time over the recording's mean square response, one array a fold
    blocks: tuple[Real, ...]

    @property
    def beyond(self) -> float:
        """Mean over the held-out recordings of the squared error minus that of freely fitted modes, at least 0."""
        return float(np.mean(np.maximum(self.errors**2 - self.floors**2, 0.0)))


def folds_of(robot: PosedRobot, free: FreeFit, start: Changes) -> tuple[Fold, ...]:
    """Hold out each recording in turn; a single one is cut into two halves."""
    if len(robot.recordings) == 1:
        robot = replace(robot, recordings=halves(robot.recordings[0]), counts=robot.counts * 2)
        free = free_fit(robot, start)
    folds = []
    for held_out, recording in enumerate(robot.recordings):
        others = [i for i in range(len(robot.recordings)) if i != held_out]
        floor = _error(free.fitted.modes[held_out], recording.spectrum)
        folds.append(Fold(recording.name, robot.only(others), robot.only([held_out]), free.only(others), floor))
    return tuple(folds)


def held_out_test(folds: Sequence[Fold], changes: Changes) -> HeldOutTest:
    """Fit the numbers of the changes to the other recordings of each fold, and predict the held-out one."""
    numbers, errors, blocks = [], [], []
    for fold in folds:
        fitted = fit_from(fold.others, changes, fold.seen).changes if changes else ()
        modes, spectrum = fold.alone.modes(fitted)[0], fold.alone.recordings[0].spectrum
        errors.append(_error(modes, spectrum))
        numbers.append([number for _, number in fitted])
        blocks.append(block_errors(modes, spectrum))
    return HeldOutTest(np.array(numbers), np.array(errors), np.array([fold.floor for fold in folds]), tuple(blocks))


def _error(modes: RobotModes, spectrum: WindowedSpectrum) -> float:
    """Return the error of a prediction relative to the measured response."""
    residual_norm = np.linalg.norm(spectrum.measured - predicted_spectrum(modes, spectrum))
    return float(residual_norm / np.linalg.norm(spectrum.measured))


def block_errors(modes: RobotModes, spectrum: WindowedSpectrum) -> Real:
    """Return the squared error of a prediction in each block of time over the mean square response, (n_blocks,)."""
    frequencies, recording = spectrum.padded_frequencies, spectrum.recording
    in_band = (frequencies >= spectrum.frequencies[0]) & (frequencies <= spectrum.frequencies[-1])
    residual_spectrum = scipy.fft.rfft(recording.response, n=spectrum.padded, axis=0) * in_band[:, None]
    response = scipy.fft.irfft(residual_spectrum, n=spectrum.padded, axis=0)
    displacement = np.einsum("kpq,kq->kp", modes.receptance(frequencies[in_band]), spectrum.force_lines[in_band])
    residual_spectrum[in_band] -= displacement * spectrum.padded_kinematic[in_band]
    residual = scipy.fft.irfft(residual_spectrum, n=spectrum.padded, axis=0)
    samples = slice(spectrum.start, spectrum.start + len(spectrum.window))
    length = int(LIMITS.block * recording.rate)
    count = len(spectrum.window) // length
    power = np.sum(residual[samples][: count * length] ** 2, axis=1).reshape(count, length).mean(axis=1)
    return np.asarray(power / np.mean(np.sum(response[samples] ** 2, axis=1)))


def chance(before: Sequence[Real], after: Sequence[Real], proof: ProofSettings = ROBOT.proof) -> float:
    """Return the p-value that ``after`` is not below ``before``; 1 if there are too few blocks."""
    first, second = np.concatenate(list(before)), np.concatenate(list(after))
    return proof.test(first, second) if len(first) >= LIMITS.least_blocks else 1.0


def lowers(before: HeldOutTest, after: HeldOutTest, proof: ProofSettings = ROBOT.proof) -> bool:
    """Return whether the held-out error is significantly smaller in ``after`` than in ``before``."""
    falls = float(np.mean(after.errors**2)) < float(np.mean(before.errors**2))
    return falls and chance(before.blocks, after.blocks, proof) < proof.significance


def raised(before: HeldOutTest, after: HeldOutTest, proof: ProofSettings = ROBOT.proof) -> tuple[int, ...]:
    """Return the indices of the folds whose error is significantly larger in ``after`` than in ``before``."""
    return tuple(
        k
        for k, (block, other) in enumerate(zip(before.blocks, after.blocks, strict=True))
        if after.errors[k] > before.errors[k] and chance([other], [block], proof) < proof.significance
    )


def improvement(names: Sequence[str], before: HeldOutTest, after: HeldOutTest, proof: ProofSettings) -> Improvement:
    """Return root mean square errors over all held-out recordings."""
    first, last, floor = (float(np.sqrt(np.mean(values**2))) for values in (before.errors, after.errors, before.floors))
    blocks = np.concatenate(before.blocks), np.concatenate(after.blocks)
    interval = ratio_interval(*blocks) if len(blocks[0]) else (np.nan, np.nan)
    p_value = chance(before.blocks, after.blocks, proof)
    return Improvement(", ".join(names), first, first, last, floor, p_value, interval, against="nominal")


def held_out_errors(names: Sequence[str], before: HeldOutTest, after: HeldOutTest) -> tuple[HeldOutError, ...]:
    """Return the errors of each held-out recording."""
    rows = zip(names, before.errors, after.errors, before.floors, strict=True)
    return tuple(HeldOutError(name, float(error), float(other), float(floor)) for name, error, other, floor in rows)


@dataclass(frozen=True)
class NumberErrors:
    """Standard errors of the numbers of a fit, (n_numbers,) each."""

    fitted: Real  # errors due to noise and deviations of the modes, if the form of the causes is correct
    spread: Real  # jackknife errors from fits that each leave one recording out
    # largest shift of each number if one further change is free, weighted by the gain of this change in cost; masses of
    # bodies are also freed, although they are never reported as changes
    form: Real

    @property
    def together(self) -> Real:
        """Root of the sum of squares."""
        return np.asarray(np.sqrt(self.fitted**2 + self.spread**2 + self.form**2))


def number_errors(
    robot: PosedRobot, final: RobotFit, elsewhere: HeldOutTest, changes: Sequence[Change], free: FreeFit
) -> NumberErrors:
    """Return the errors of all numbers of a fit."""
    numbers = np.array([number for _, number in final.changes])
    form = np.zeros(len(numbers))
    changed = {change.name for change, _ in final.changes}
    for change in (*changes, *unnamed_changes(robot.robot)):
        if change.name in changed:
            continue
        fitted = fit_from(robot, (*final.changes, *numbered(change, change.neutral)), free)
        shift = np.abs(np.array([number for _, number in fitted.changes[: len(numbers)]]) - numbers)
        form = np.maximum(form, shift_weight(final.cost - fitted.cost) * shift)
    spread = np.sqrt(jackknife_variance(elsewhere.numbers))
    return NumberErrors(np.asarray(final.standard_errors), np.asarray(spread), form)


ReportedChange = AcceptedCause | Candidate


@dataclass(frozen=True)
class CompanionNumber:
    """A number that is fitted together with a change, such as the place of a mass or the axial stiffness of the tool.

    Parameters
    ----------
    name, unit
        Name and unit of the number.
    number, standard_error
        The number, and its standard error, which includes the prior.
    spread
        Standard deviation of the prior: if the standard error is as large, the recordings do not determine the number.
    """

    name: str
    unit: str
    number: float
    standard_error: float
    spread: float

    @property
    def determined(self) -> bool:
        """Whether the recordings determine the number, not the prior alone."""
        return self.standard_error < 0.5 * self.spread


def number_of(cause: ReportedChange) -> float:
    """Return the number of a change: factor, kg, m/N, m/s² or rad.

    Parameters
    ----------
    cause
        Accepted or compared cause of a robot's diagnosis.
    """
    return cause.parameters[cause.name]


def standard_error_of(cause: ReportedChange) -> float:
    """Return the standard error of the number of a change, in its unit.

    Parameters
    ----------
    cause
        Accepted or compared cause of a robot's diagnosis. The error of an accepted cause includes the uncertainty of
        its form; the error of a candidate is only the error of its fit.
    """
    return cause.standard_errors[cause.name]


def companions_of(cause: ReportedChange) -> tuple[CompanionNumber, ...]:
    """Return the companion numbers that were fitted together with a change.

    Parameters
    ----------
    cause
        Accepted or compared cause of a robot's diagnosis.
    """
    return tuple(
        CompanionNumber(
            name, companion["unit"], cause.parameters[name], cause.standard_errors[name], companion["spread"]
        )
        for name, companion in cause.location.get("companions", {}).items()
    )


@dataclass(frozen=True)
class RobotDetails:
    """Fits of the diagnosis of a robot."""

    robot: PosedRobot
    # fits of the robot as modelled, and with the accepted changes
    nominal: RobotFit
    final: RobotFit
    free: FreeFit

    def improved_robot(self) -> tuple[SpatialRobot, Real]:
        """Return the robot with the accepted changes, and the angular offset of each joint, rad."""
        return changed_robot(self.robot.robot, self.final.changes, rigid_links=self.robot.rigid_links)


# diagnosis of a robot; its residual is the excess of :meth:`RobotComparison.excess`
RobotDiagnosis = Diagnosis[RobotDetails]


def location_of(change: Change) -> dict[str, Any]:
    """Return kind and unit of a change, and the prior of its companions."""
    place: dict[str, Any] = {"kind": change.kind, "unit": change.unit}
    if change.companions:
        place["companions"] = {
            companion.name: {"unit": companion.unit, "spread": companion.spread} for companion in change.companions
        }
    return place


def candidate_of(proposal: Proposal[RobotFit], stage: str) -> Candidate:
    """Return a compared change with its numbers and the errors of its fit alone."""
    fitted = proposal.fitted
    numbers, errors = _by_name(fitted, fitted.standard_errors, proposal.name)
    return Candidate(proposal.name, proposal.evidence, stage, proposal.location, numbers, errors)


def accepted_cause(proposal: Proposal[RobotFit], final: RobotFit, errors: NumberErrors) -> AcceptedCause:
    """Return an accepted change with the numbers of the last fit."""
    numbers, total_errors = _by_name(final, errors.together, proposal.name)
    parts = {"fit": errors.fitted, "spread": errors.spread, "form": errors.form}
    of_each = {part: _by_name(final, values, proposal.name)[1] for part, values in parts.items()}
    by_number = {name: {part: of_each[part][name] for part in parts} for name in numbers}
    return AcceptedCause(proposal.name, proposal.location, numbers, total_errors, proposal.evidence, by_number)


def _by_name(fitted: RobotFit, errors: Real, name: str) -> tuple[dict[str, float], dict[str, float]]:
    """Return numbers and errors of a change and of its companions, which follow it."""
    first = [change.name for change, _ in fitted.changes].index(name)
    change = fitted.changes[first][0]
    last = first + 1 + (len(change.companions) if isinstance(change, Change) else 0)
    names = [change.name for change, _ in fitted.changes[first:last]]
    numbers = [number for _, number in fitted.changes[first:last]]
    return dict(zip(names, numbers, strict=True)), dict(zip(names, map(float, errors[first:last]), strict=True))


def content_of(robot: PosedRobot) -> Mapping[str, Any]:
    """Return the entry of a file on the recordings and errors of a robot; angles in rad."""
    error = robot.error
    return {
        "rigid_links": robot.rigid_links,
        "model_error": {"frequency": error.frequency, "damping": error.damping, "shape": error.shape},
        "recordings": [
            {
                "name": recording.name,
                "joints_rad": recording.q.tolist(),
                "band_hz": [float(recording.spectrum.frequencies[0]), float(recording.spectrum.frequencies[-1])],
                "responses": list(recording.responses),
                "excitations": list(recording.excitations),
            }
            for recording in robot.recordings
        ],
    }
