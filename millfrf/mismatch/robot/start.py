"""Where a fit starts: the number that leaves least, and the modes and the noise that the recordings show freely."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import Complex, InputError
from millfrf.robot_model import Change

from ..models.misfit import levels
from ..noise.noise_model import fit_noise, whitening
from .fit import FitProblem, RobotFit, fit_robot
from .posed import LIMITS, Changes, PosedRobot
from .receptance import predicted_spectrum, quick_spectrum


def numbered(change: Change, number: float) -> Changes:
    """A change at a number, its companions where nothing is known of them.

    Parameters
    ----------
    change
        Change that gets the number.
    number
        Number of the change, in its unit.
    """
    return ((change, number), *((one, one.neutral) for one in change.companions))


def best_start(robot: PosedRobot, before: Changes, change: Change) -> tuple[Changes, float]:
    """Changes with one more at the number that leaves least, and what it leaves (:func:`what_is_left`).

    Parameters
    ----------
    robot
        The robot and its recordings.
    before
        Changes that are made already.
    change
        The further change; its ``values`` are tried.
    """
    starts = [(*before, *numbered(change, number)) for number in change.values]
    left = [what_is_left(robot, start) for start in starts]
    least = int(np.argmin(left))
    return starts[least], left[least]


def nearest(robot: PosedRobot, changes: Sequence[Change], least: float) -> Changes:
    """The one change that leaves least of the recordings, if it is clearly better than none; no change otherwise.

    Parameters
    ----------
    robot
        The robot and its recordings.
    changes
        All changes that are weighed.
    least
        Logarithm of the likelihood by which a change must be better.
    """
    best, left = min((best_start(robot, (), change) for change in changes), key=lambda start: start[1])
    return best if left < what_is_left(robot, ()) - least else ()


def what_is_left(robot: PosedRobot, changes: Changes) -> float:
    """``sum n ln(sum |r|^2 / sum |y|^2)`` over channels and recordings; infinite where the robot cannot be changed so.

    With noise of unknown size on each channel this is its likelihood (Seber & Wild, Nonlinear Regression, section
    2.2). The modes do not deviate here.

    Parameters
    ----------
    robot
        The robot and its recordings.
    changes
        Changes with their numbers.
    """
    try:
        modes = robot.modes(changes)
    except InputError:
        return np.inf
    total = 0.0
    for recording, here in zip(robot.recordings, modes, strict=True):
        spectrum = recording.spectrum
        rest = np.sum(np.abs(spectrum.measured - quick_spectrum(here, spectrum)) ** 2, axis=0)
        power = np.sum(np.abs(spectrum.measured) ** 2, axis=0)
        total += len(spectrum.frequencies) * float(np.sum(np.log(rest / power)))
    return total


@dataclass(frozen=True)
class FreeFit:
    """Modes fitted to the recordings with next to no belief in the robot, and the noise that they leave.

    Parameters
    ----------
    fitted
        Modes as the recordings show them.
    whiteners
        Whitening W of each recording, (n_lines, n_responses, n_responses): the same for every hypothesis.
    """

    fitted: RobotFit
    whiteners: tuple[Complex, ...]

    def only(self, chosen: Sequence[int]) -> "FreeFit":
        """The free fit of some of the recordings: freely fitted modes of one know nothing of the others.

        Parameters
        ----------
        chosen
            Numbers of the recordings, from 0.
        """
        modes = tuple(self.fitted.modes[i] for i in chosen)
        u = tuple(self.fitted.deviations[i] for i in chosen)
        return FreeFit(replace(self.fitted, modes=modes, deviations=u), tuple(self.whiteners[i] for i in chosen))


def free_fit(robot: PosedRobot, start: Changes) -> FreeFit:
    """Fit the modes freely from a robot that is not far off; noise is inferred from what is left, twice.

    Parameters
    ----------
    robot
        The robot and its recordings.
    start
        Changes to start from.

    Raises
    ------
    InputError
        A channel that is zero in the band.
    """
    white: list[Complex] = []
    for recording, here in zip(robot.recordings, robot.modes(start), strict=True):
        spectrum = recording.spectrum
        level = np.sqrt(np.mean(np.abs(spectrum.measured - quick_spectrum(here, spectrum)) ** 2, axis=0))
        one = np.diag(1 / np.maximum(level, 1e-300)).astype(complex)
        white.append(np.broadcast_to(one, (len(spectrum.frequencies), *one.shape)))
    fitted = fit_robot(robot, start, white, belief=LIMITS.loose)
    for _ in range(2):
        white = whiteners_of(robot, fitted)
        fitted = fit_robot(robot, fitted.changes, white, start=fitted.deviations, belief=LIMITS.loose)
    return FreeFit(fitted, tuple(white))


def whiteners_of(robot: PosedRobot, fitted: RobotFit) -> list[Complex]:
    """Whitening W of each recording from what a fit leaves of it, (n_lines, n_responses, n_responses).

    Parameters
    ----------
    robot
        The robot and its recordings.
    fitted
        The fit whose residuals are noise.

    Raises
    ------
    InputError
        A channel that is zero in the band.
    """
    white = []
    for recording, modes in zip(robot.recordings, fitted.modes, strict=True):
        spectrum = recording.spectrum
        size = levels(spectrum)
        if not (size[0].all() and size[1].all()):
            raise InputError(f"{recording.name}: a channel is zero in the band; leave it out")
        through = np.asarray(modes.receptance(spectrum.frequencies) * spectrum.kinematic[:, :, None])
        rest = spectrum.measured - predicted_spectrum(modes, spectrum)
        noise = fit_noise(spectrum.frequencies, rest, through, size)
        white.append(whitening(noise.covariance(spectrum.frequencies, through)))
    return white


def fit_from(robot: PosedRobot, start: Changes, free: FreeFit) -> RobotFit:
    """Fit a hypothesis with full belief, from the modes as the recordings show them or from the robot's own.

    The nearer of the two begins; a mode that the robot has and the recordings do not show keeps the robot's numbers.

    Parameters
    ----------
    robot
        The robot and its recordings.
    start
        Changes with the numbers to start from.
    free
        Modes and noise as the recordings show them.
    """
    seen = []
    for one, other in zip(robot.modes(start), free.fitted.modes, strict=True):
        table = one.deviations(other, robot.error).reshape(one.count, -1)
        table[np.abs(table).max(axis=1) > LIMITS.strange] = 0.0
        seen.append(table.ravel())
    own = [np.zeros_like(u) for u in seen]
    problem = FitProblem(robot, free.whiteners)
    begin = min((seen, own), key=lambda u: problem.state(start, u).cost)
    return fit_robot(robot, start, free.whiteners, start=begin)
