"""Where a fit of each cause begins: the number that leaves least, and the modes and noise that the data show freely."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from foundation import InputError
from robot_model import Change

from .robot_fit import RobotFit, fit_robot, start_cost
from .robot_noise import noise_of, whiteners_of
from .robot_receptance import quick_lines
from .robot_setting import Changes, Setting

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

LOOSE = 0.01
"""Precision of the belief with which modes are fitted freely: ten standard deviations count as one."""


STRANGE = 60.0
"""Deviation, in standard deviations, beyond which a mode that is seen is not taken for one of the robot's."""


@dataclass(frozen=True)
class Start:
    """A cause at the number that leaves least of the recordings.

    Parameters
    ----------
    changes
        All of them, the one that was searched for at the end.
    left
        ``sum n ln(left / measured)`` over channels and recordings.
    """

    changes: Changes
    left: float


def numbered(change: Change, number: float) -> Changes:
    """A change at a number, its companions where nothing is known of them."""
    return ((change, number), *((one, one.neutral) for one in change.companions))


def best_starts(setting: Setting, before: Changes, change: Change, most: int = 1) -> list[Start]:
    """The numbers of one further change from which a fit is worth while, best first.

    With noise of unknown size on each channel, ``sum n ln(sum |r|^2)`` is its likelihood (Seber & Wild, Nonlinear
    Regression, section 2.2); no deviation of the modes is allowed here.
    """
    starts = []
    for number in change.values:
        changes = (*before, *numbered(change, number))
        starts.append(Start(changes, what_is_left(setting, changes)))
    return sorted(starts, key=lambda start: start.left)[:most]


def what_is_left(setting: Setting, changes: Changes) -> float:
    """Logarithm of what the changed robot leaves of the recordings, weighed by lines; infinite where it fails."""
    try:
        modes = setting.modes(changes)
    except InputError:
        return np.inf
    total = 0.0
    for recording, here in zip(setting.recordings, modes, strict=True):
        lines = recording.lines
        rest = np.sum(np.abs(lines.measured - quick_lines(here, lines)) ** 2, axis=0)
        power = np.sum(np.abs(lines.measured) ** 2, axis=0)
        total += len(lines.frequencies) * float(np.sum(np.log(rest / power)))
    return total


@dataclass(frozen=True)
class FreeFit:
    """Modes fitted to the recordings with next to no belief in the robot, and the noise that they leave.

    Parameters
    ----------
    fitted
        Modes as the recordings show them.
    whiteners
        W of each recording, the same for every cause from here on.
    """

    fitted: RobotFit
    whiteners: tuple[Complex, ...]

    def only(self, chosen: Sequence[int]) -> "FreeFit":
        """Of some of the recordings: freely fitted modes of one know nothing of the others."""
        modes = tuple(self.fitted.modes[i] for i in chosen)
        u = tuple(self.fitted.deviations[i] for i in chosen)
        return FreeFit(replace(self.fitted, modes=modes, deviations=u), tuple(self.whiteners[i] for i in chosen))


def free_fit(setting: Setting, start: Changes) -> FreeFit:
    """Fit the modes freely from a robot that is not far off; noise is inferred from what is left, twice."""
    white = []
    for recording, here in zip(setting.recordings, setting.modes(start), strict=True):
        lines = recording.lines
        level = np.sqrt(np.mean(np.abs(lines.measured - quick_lines(here, lines)) ** 2, axis=0))
        one = np.diag(1 / np.maximum(level, 1e-300)).astype(complex)
        white.append(np.broadcast_to(one, (len(lines.frequencies), *one.shape)))
    fitted = fit_robot(setting, start, white, belief=LOOSE)
    for _ in range(2):
        white = whiteners_of(setting, fitted, noise_of(setting, fitted))
        fitted = fit_robot(setting, fitted.changes, white, start=fitted.deviations, belief=LOOSE)
    return FreeFit(fitted, tuple(white))


def fit_from(setting: Setting, start: Changes, free: FreeFit) -> RobotFit:
    """Fit a cause with full belief, from the modes as the recordings show them or from the robot's own.

    The nearer of the two begins; a mode that the robot has and the recordings do not show keeps the robot's numbers.
    """
    seen = []
    for one, other in zip(setting.modes(start), free.fitted.modes, strict=True):
        table = one.deviations(other, setting.error).reshape(one.count, -1)
        table[np.abs(table).max(axis=1) > STRANGE] = 0.0
        seen.append(table.ravel())
    own = [np.zeros_like(u) for u in seen]
    begin = min((seen, own), key=lambda u: start_cost(setting, start, free.whiteners, u))
    return fit_robot(setting, start, free.whiteners, start=begin)
