"""Which single change of a robot's model explains the frequencies found at several postures?"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from .identification import identify
from .spatial_modes import modes_at
from .spatial_robot import SpatialRobot
from .variations import with_joint_factor, with_link_factor, with_payload

Real = NDArray[np.float64]

AS_GOOD = 6.0
"""Rise of chi^2 up to which another cause with as many parameters counts as equivalent (likelihood ratio of 20)."""


@dataclass(frozen=True)
class PostureFrequencies:
    """Lowest natural frequencies found in a posture: q (n_moving,), frequencies (n_modes,), Hz, rising."""

    q: Real
    frequencies: Real


@dataclass(frozen=True)
class Cause:
    """One explanation, fitted.

    Parameters
    ----------
    name
        ``joint 3 stiffness``, ``payload``, ``links``, or ``as modelled`` (nothing changed).
    parameter, standard_error
        Factor of the stiffness, or mass in kg; 1 and 0 where nothing changed.
    chi_square
        Sum of squared deviations in units of their expected error.
    n_data
        Frequencies compared; an explanation that is right leaves a chi^2 near it.
    """

    name: str
    parameter: float
    standard_error: float
    chi_square: float
    n_data: int


def explain_frequencies(
    robot: SpatialRobot, found: Sequence[PostureFrequencies], relative_error: float = 0.005
) -> tuple[Cause, ...]:
    """Every single cause fitted to the frequencies, best first; ``as modelled`` among them.

    Each cause has one parameter, so the causes are compared by chi^2 alone; those within ``AS_GOOD`` of the best cannot
    be told apart from these postures (:func:`equivalent_causes`). One posture rarely tells joints apart; several do,
    because each loads the joints in another way.

    Parameters
    ----------
    robot
        As modelled.
    found
        Lowest frequencies at one or more postures.
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

    def deviations(trial: SpatialRobot) -> Real:
        parts = [modes_at(trial, case.q).frequencies[: len(case.frequencies)] / case.frequencies - 1 for case in found]
        return np.concatenate(parts) / relative_error

    nominal = deviations(robot)
    causes = [Cause("as modelled", 1.0, 0.0, float(nominal @ nominal), n_data)]
    for name, change, start, bounds in _candidates(robot):
        fitted = _fit(partial(_of_change, deviations, change), name, start, bounds)
        causes.append(Cause(name, *fitted, n_data))
    return tuple(sorted(causes, key=lambda cause: cause.chi_square))


def equivalent_causes(causes: Sequence[Cause]) -> tuple[Cause, ...]:
    """The best cause, and those that the data cannot tell from it."""
    return tuple(cause for cause in causes if cause.chi_square <= causes[0].chi_square + AS_GOOD)


_Change = Callable[[float], SpatialRobot]


def _candidates(robot: SpatialRobot) -> list[tuple[str, _Change, float, tuple[float, float]]]:
    factor = (0.05, 20.0)
    joints = [joint.frame for joint in robot.joints if np.isfinite(joint.stiffness).any()]
    candidates: list[tuple[str, _Change, float, tuple[float, float]]] = [
        (f"joint {name} stiffness", partial(with_joint_factor, robot, name), 1.0, factor) for name in joints
    ]
    if any(link.section is not None for link in robot.links):
        candidates.append(("links", partial(with_link_factor, robot), 1.0, (0.01, 1000.0)))
    candidates.append(("payload", partial(with_payload, robot), 1.0, (1e-3, 500.0)))
    return candidates


def _of_change(deviations: Callable[[SpatialRobot], Real], change: _Change, x: Real) -> Real:
    return deviations(change(float(x[0])))


def _fit(
    residuals: Callable[[Real], Real], name: str, start: float, bounds: tuple[float, float]
) -> tuple[float, float, float]:
    """Parameter, its standard error and chi^2, from the better of two starts."""
    best: tuple[float, float, float] | None = None
    for begin in (0.5 * start, 2 * start):
        found = identify(residuals, (name,), np.array([bounds[0]]), np.array([bounds[1]]), start=np.array([begin]))
        left = residuals(found.values)
        chi_square = float(left @ left)
        if best is None or chi_square < best[2]:
            best = float(found.values[0]), float(found.values[0] * found.relative_errors[0]), chi_square
    assert best is not None
    return best
