"""Single changes of a robot's model that explain frequencies found at several postures."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from foundation import InputError

from ..spatial import SpatialRobot, modes_at
from .change import Change
from .weighed_changes import possible_changes

Real = NDArray[np.float64]

_BLIND = "posture of joint 1"
"""A turn of the whole robot changes no frequency."""

AS_GOOD = 6.0
"""Rise of chi^2 up to which another cause with as many parameters counts as equivalent (likelihood ratio of 20)."""


@dataclass(frozen=True)
class PostureFrequencies:
    """Lowest natural frequencies found in a posture: q (n_moving,), frequencies (n_modes,), Hz, rising."""

    q: Real
    frequencies: Real


@dataclass(frozen=True)
class Cause:
    """One explanation of measured frequencies, fitted to them.

    Parameters
    ----------
    name
        Name of the change, as in :class:`robot_model.Change`, or ``as modelled`` (nothing changed).
    parameter, standard_error
        The change's number (a factor, kg, rad, m/s^2); 1 and 0 where nothing changed. Infinite: the frequencies do not
        depend on it.
    chi_square
        Sum of squared deviations in units of their expected error.
    n_data
        Number of frequencies compared; an explanation that is right leaves a chi^2 near it.
    """

    name: str
    parameter: float
    standard_error: float
    chi_square: float
    n_data: int


def explain_frequencies(
    robot: SpatialRobot, found: Sequence[PostureFrequencies], relative_error: float = 0.005
) -> tuple[Cause, ...]:
    """Fit every single cause to the frequencies; give them best first, ``as modelled`` among them.

    Each cause has one parameter, so the causes are compared by chi^2 alone; those within ``AS_GOOD`` of the best cannot
    be told apart from these postures (:func:`equivalent_causes`). One posture rarely tells joints apart; several do,
    because each loads the joints in another way. A payload hangs at the tip here; a tool's compliance and damping leave
    the frequencies as they are and are not asked.

    Parameters
    ----------
    robot
        The robot as modelled.
    found
        Lowest frequencies at one posture or more.
    relative_error
        Standard error of a frequency over its value.

    Raises
    ------
    InputError
        No frequencies, or an error that is not positive.
    """
    n_data = sum(len(case.frequencies) for case in found)
    if not n_data or not relative_error > 0:
        raise InputError(f"{n_data} frequencies with relative error {relative_error!r}: both must be positive")

    def deviations(trial: SpatialRobot, offset: Real) -> Real:
        parts = [
            modes_at(trial, case.q + offset).frequencies[: len(case.frequencies)] / case.frequencies - 1
            for case in found
        ]
        return np.concatenate(parts) / relative_error

    nominal = deviations(robot, np.zeros(len(robot.mechanism.moving)))
    causes = [Cause("as modelled", 1.0, 0.0, float(nominal @ nominal), n_data)]
    for change in possible_changes(robot, payload_at=np.zeros(3)):
        if change.kind in ("damping", "tool") or change.name == _BLIND:
            continue
        causes.append(Cause(change.name, *_fit(partial(_of_change, deviations, robot, change), change), n_data))
    return tuple(sorted(causes, key=lambda cause: cause.chi_square))


def equivalent_causes(causes: Sequence[Cause]) -> tuple[Cause, ...]:
    """The best cause, and those that the data cannot tell from it."""
    return tuple(cause for cause in causes if cause.chi_square <= causes[0].chi_square + AS_GOOD)


def _of_change(deviations: Callable[[SpatialRobot, Real], Real], robot: SpatialRobot, change: Change, x: Real) -> Real:
    return deviations(*change.apply(robot, change.from_fit(float(x[0]))))


def _fit(residuals: Callable[[Real], Real], change: Change) -> tuple[float, float, float]:
    """Number, its standard error and chi^2, from the best of the change's starts."""
    bounds = [change.to_fit(bound) for bound in change.bounds]
    start = min((change.to_fit(value) for value in change.values[::2]), key=lambda x: _size(residuals, x))
    scale = 0.1 if change.logarithmic or change.scale else 0.01
    found = least_squares(residuals, [start], bounds=bounds, x_scale=scale, max_nfev=15, xtol=1e-6)
    slope = float(np.sqrt(found.jac[:, 0] @ found.jac[:, 0]))
    number, chi_square = change.from_fit(float(found.x[0])), float(found.fun @ found.fun)
    error = np.inf if slope == 0 else change.slope(number) / slope
    return number, float(error), chi_square


def _size(residuals: Callable[[Real], Real], x: float) -> float:
    left = residuals(np.array([x]))
    return float(left @ left)
