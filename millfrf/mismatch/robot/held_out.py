"""Held-out recordings predicted by a fitted robot, and errors of its parameters."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from estimation import WindowedSpectrum
from millfrf.core import Real
from millfrf.robot_model import Change, unnamed_changes

from ..inference.diagnosis import HeldOutError, Improvement
from ..inference.paired_tests import jackknife_variance, ratio_interval, shift_weight
from ..inference.settings import ProofSettings
from .fit import RobotFit
from .posed import LIMITS, ROBOT, Changes, PosedRobot
from .receptance import RobotModes, halves, predicted_spectrum
from .start import FreeFit, fit_from, free_fit, numbered


@dataclass(frozen=True)
class Fold:
    """One recording left out.

    Parameters
    ----------
    name
        Name of the recording left out.
    others, alone
        The robot with the other recordings, and with this one alone.
    seen
        Free fit of the others.
    floor
        Error that modes fitted freely to the recording left out leave of it, relative to its response.
    """

    name: str
    others: PosedRobot
    alone: PosedRobot
    seen: FreeFit
    floor: float


@dataclass(frozen=True)
class HeldOutTest:
    """Errors of changes on recordings to which they were not fitted.

    Parameters
    ----------
    numbers : (n_folds, n_numbers)
        Numbers of the changes and companions, fitted without the recording left out.
    errors, floors : (n_folds,)
        Errors relative to the root mean square response: of the robot without deviations, and of modes fitted freely.
    blocks
        Squared error of each block of time over the recording's mean square response, one array a fold.
    """

    numbers: Real
    errors: Real
    floors: Real
    blocks: tuple[Real, ...]

    @property
    def beyond(self) -> float:
        """Squared error beyond that of freely fitted modes, mean over the recordings left out."""
        return float(np.mean(np.maximum(self.errors**2 - self.floors**2, 0.0)))


def folds_of(robot: PosedRobot, free: FreeFit, start: Changes) -> tuple[Fold, ...]:
    """Leave out one recording after the other; a single one is cut in two.

    Parameters
    ----------
    robot
        The robot and its recordings.
    free
        Free fit of all recordings.
    start
        Changes to start from where halves must be fitted anew.
    """
    if len(robot.recordings) == 1:
        robot = replace(robot, recordings=halves(robot.recordings[0]), counts=robot.counts * 2)
        free = free_fit(robot, start)
    folds = []
    for out, recording in enumerate(robot.recordings):
        kept = [i for i in range(len(robot.recordings)) if i != out]
        floor = _error(free.fitted.modes[out], recording.spectrum)
        folds.append(Fold(recording.name, robot.only(kept), robot.only([out]), free.only(kept), floor))
    return tuple(folds)


def held_out_test(folds: Sequence[Fold], changes: Changes) -> HeldOutTest:
    """Fit the changes' numbers to the remaining recordings of each fold, and predict the one left out.

    Parameters
    ----------
    folds
        Recordings left out, each with the robot in the others.
    changes
        Changes with the numbers to start from.
    """
    numbers, errors, blocks = [], [], []
    for fold in folds:
        fitted = fit_from(fold.others, changes, fold.seen).changes if changes else ()
        modes, spectrum = fold.alone.modes(fitted)[0], fold.alone.recordings[0].spectrum
        errors.append(_error(modes, spectrum))
        numbers.append([number for _, number in fitted])
        blocks.append(block_errors(modes, spectrum))
    return HeldOutTest(np.array(numbers), np.array(errors), np.array([fold.floor for fold in folds]), tuple(blocks))


def _error(modes: RobotModes, spectrum: WindowedSpectrum) -> float:
    """Error of a prediction relative to the measured response."""
    rest = np.linalg.norm(spectrum.measured - predicted_spectrum(modes, spectrum))
    return float(rest / np.linalg.norm(spectrum.measured))


def block_errors(modes: RobotModes, spectrum: WindowedSpectrum) -> Real:
    """Squared error of a prediction in blocks of time, over the mean square response, (n_blocks,).

    Parameters
    ----------
    modes
        Modes that predict the response.
    spectrum
        Windowed spectrum of the recording.
    """
    frequencies, recording = spectrum.padded_frequencies, spectrum.recording
    inside = (frequencies >= spectrum.frequencies[0]) & (frequencies <= spectrum.frequencies[-1])
    rest = scipy.fft.rfft(recording.response, n=spectrum.padded, axis=0) * inside[:, None]
    size = scipy.fft.irfft(rest, n=spectrum.padded, axis=0)
    moved = np.einsum("kpq,kq->kp", modes.receptance(frequencies[inside]), spectrum.force_lines[inside])
    rest[inside] -= moved * spectrum.padded_kinematic[inside]
    left = scipy.fft.irfft(rest, n=spectrum.padded, axis=0)
    kept = slice(spectrum.start, spectrum.start + len(spectrum.window))
    length = int(LIMITS.block * recording.rate)
    count = len(spectrum.window) // length
    power = np.sum(left[kept][: count * length] ** 2, axis=1).reshape(count, length).mean(axis=1)
    return np.asarray(power / np.mean(np.sum(size[kept] ** 2, axis=1)))


def chance(before: Sequence[Real], after: Sequence[Real], proof: ProofSettings = ROBOT.proof) -> float:
    """p-value that ``after`` is not below ``before``; 1 where too few blocks can say.

    Parameters
    ----------
    before, after
        Squared errors of the same blocks of time, (n_blocks,) for each recording.
    proof
        The paired test.
    """
    first, second = np.concatenate(list(before)), np.concatenate(list(after))
    return proof.test(first, second) if len(first) >= LIMITS.least_blocks else 1.0


def lowers(before: HeldOutTest, after: HeldOutTest, proof: ProofSettings = ROBOT.proof) -> bool:
    """Whether the error on recordings held out falls, and by more than chance.

    Parameters
    ----------
    before, after
        Errors without and with a change.
    proof
        Significance and paired test.
    """
    falls = float(np.mean(after.errors**2)) < float(np.mean(before.errors**2))
    return falls and chance(before.blocks, after.blocks, proof) < proof.significance


def raised(before: HeldOutTest, after: HeldOutTest, proof: ProofSettings = ROBOT.proof) -> tuple[int, ...]:
    """Numbers of the folds on which the error grows by more than chance.

    Parameters
    ----------
    before, after
        Errors without and with a change.
    proof
        Significance and paired test.
    """
    return tuple(
        k
        for k, (one, other) in enumerate(zip(before.blocks, after.blocks, strict=True))
        if after.errors[k] > before.errors[k] and chance([other], [one], proof) < proof.significance
    )


def improvement(names: Sequence[str], before: HeldOutTest, after: HeldOutTest, proof: ProofSettings) -> Improvement:
    """Errors over all recordings held out, as root mean squares.

    Parameters
    ----------
    names
        Names of the recordings.
    before, after
        Errors of the robot as modelled, and with the changes.
    proof
        The paired test.
    """
    first, last, floor = (float(np.sqrt(np.mean(one**2))) for one in (before.errors, after.errors, before.floors))
    blocks = np.concatenate(before.blocks), np.concatenate(after.blocks)
    interval = ratio_interval(*blocks) if len(blocks[0]) else (np.nan, np.nan)
    p_value = chance(before.blocks, after.blocks, proof)
    return Improvement(", ".join(names), first, first, last, floor, p_value, interval, against="nominal")


def held_out_errors(names: Sequence[str], before: HeldOutTest, after: HeldOutTest) -> tuple[HeldOutError, ...]:
    """Errors of each recording that was held out.

    Parameters
    ----------
    names
        Names of the recordings.
    before, after
        Errors of the robot as modelled, and with the changes.
    """
    rows = zip(names, before.errors, after.errors, before.floors, strict=True)
    return tuple(HeldOutError(name, float(one), float(other), float(floor)) for name, one, other, floor in rows)


@dataclass(frozen=True)
class NumberErrors:
    """Standard errors of the numbers of a fit, (n_numbers,) each.

    Parameters
    ----------
    fitted
        Errors from noise and the modes' deviations, the form of the causes taken to be right.
    spread
        Spread between fits that leave one recording out, the jackknife.
    form
        Largest shift when one further change is free, weighed by what that change gains in cost; the masses of bodies
        are freed too, though none is ever named.
    """

    fitted: Real
    spread: Real
    form: Real

    @property
    def together(self) -> Real:
        """Root of the sum of squares."""
        return np.asarray(np.sqrt(self.fitted**2 + self.spread**2 + self.form**2))


def number_errors(
    robot: PosedRobot, final: RobotFit, elsewhere: HeldOutTest, changes: Sequence[Change], free: FreeFit
) -> NumberErrors:
    """Errors of all numbers of a fit.

    Parameters
    ----------
    robot
        The robot and its recordings.
    final
        The last fit, with all accepted changes.
    elsewhere
        Test on recordings left out, with the fit's numbers for each.
    changes
        All changes that are weighed.
    free
        Modes and noise as the recordings show them.
    """
    numbers = np.array([number for _, number in final.changes])
    form = np.zeros(len(numbers))
    there = {one.name for one, _ in final.changes}
    for change in (*changes, *unnamed_changes(robot.robot)):
        if change.name in there:
            continue
        fitted = fit_from(robot, (*final.changes, *numbered(change, change.neutral)), free)
        shift = np.abs(np.array([number for _, number in fitted.changes[: len(numbers)]]) - numbers)
        form = np.maximum(form, shift_weight(final.cost - fitted.cost) * shift)
    spread = np.sqrt(jackknife_variance(elsewhere.numbers))
    return NumberErrors(np.asarray(final.standard_errors), np.asarray(spread), form)
