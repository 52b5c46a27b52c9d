"""Bands of whatever a robot gives: its uncertain numbers, carried on by first order."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from estimation import Frf, FrfCovariance
from foundation import InputError
from modal_fit import ModalModel, pack_parameters

from ..spatial import SpatialRobot
from .draws import principal_shifts, shifted_robot
from .uncertainty import RobotUncertainty

Real = NDArray[np.float64]

STEP = 0.05
"""Step of the differences, in standard deviations."""

_STEPS = (STEP, STEP / 10, STEP / 100)
"""Steps that are tried in turn: a damping that nobody measured may fall below zero within the first."""

_APART = 0.99
"""Ratio of a mode's frequency to that of the next above it, at which a limit between both is told apart."""


def derived_errors(robot: SpatialRobot, uncertainty: RobotUncertainty, derived: Callable[[SpatialRobot], Real]) -> Real:
    """Standard errors of what is derived from a robot, in its shape.

    ``sigma^2 = sum_d ((f(+h s_d) - f(-h s_d)) / 2 h)^2`` over the covariance's principal directions s_d.

    Parameters
    ----------
    robot, uncertainty
        The updated robot and its ``[update]`` table.
    derived
        Function of a robot that gives an array.
    """
    return np.asarray(np.sqrt(np.sum(np.abs(_slopes(robot, uncertainty, derived)) ** 2, axis=0)))


def frf_with_errors(frf: Frf, errors: Real) -> Frf:
    """An FRF with the standard errors of its entries, as the product form that its file holds.

    ``response[p] excitation[q]`` has the means of the variances over rows and over columns.

    Parameters
    ----------
    frf
        The FRF of the updated robot.
    errors : (n_lines, n_responses, n_excitations)
        Standard errors of its entries, in its unit.
    """
    variance = errors**2
    rows, columns = variance.mean(axis=2), variance.mean(axis=1)
    whole = np.maximum(variance.mean(axis=(1, 2)), 1e-300)[:, None]
    response = rows[:, :, None] * np.eye(rows.shape[1], dtype=complex)
    excitation = (columns / whole)[:, :, None] * np.eye(columns.shape[1], dtype=complex)
    return replace(frf, covariance=FrfCovariance(response, excitation))


def with_model_covariance(
    robot: SpatialRobot,
    uncertainty: RobotUncertainty,
    derived: Callable[[SpatialRobot], ModalModel],
) -> ModalModel:
    """The modal model that is derived from a robot, with the covariance that the robot's uncertain numbers give it.

    Parameters
    ----------
    derived
        Function of a robot that gives its modal model in a posture.

    Raises
    ------
    InputError
        A small shift of the numbers changes the number of damped modes.
    """
    model = derived(robot)

    def packed(changed: SpatialRobot) -> Real:
        return pack_parameters(_aligned(derived(changed), model))

    slopes = _slopes(robot, uncertainty, packed)
    return replace(model, covariance=slopes.T @ slopes)


def apart_from_higher(frequencies: Real) -> float:
    """Frequency in the widest gap between the 6th and the 16th mode, Hz: a small change of numbers crosses it by none.

    Higher modes are overdamped or not by what nobody measured; below it a model's modes keep their number.

    Parameters
    ----------
    frequencies : (n_modes,), Hz
        Natural frequencies, rising.

    Examples
    --------
    >>> apart_from_higher(np.array([10.0, 20.0, 30.0]))
    inf
    >>> round(apart_from_higher(np.r_[np.arange(10.0, 18.0), 72.0, 73.0]))
    35
    """
    part = frequencies[5:16]
    if len(part) < 2:
        return float(np.inf)
    at = int(np.argmax(part[1:] / part[:-1]))
    return float(np.sqrt(part[at] * part[at + 1]))


def below_new_modes(
    robot: SpatialRobot, uncertainty: RobotUncertainty, frequencies: Callable[[SpatialRobot], Real]
) -> float:
    """Frequency below which a small change of the uncertain numbers adds no mode and takes none away, Hz.

    A tool or a base that is rigid in the file, and gives way by a small change, has modes that the file has not. Where
    they lie among the robot's own, the largest number of modes is kept that all changes leave apart from the rest.

    Parameters
    ----------
    frequencies
        Function of a robot that gives its natural frequencies in a posture, Hz, rising.

    Raises
    ------
    InputError
        No mode is apart from those that a change adds.
    """
    own = frequencies(robot)
    top = apart_from_higher(own)
    shifts = [sign * STEP * shift for shift in principal_shifts(uncertainty) for sign in (1, -1)]
    found = [own, *(frequencies(shifted_robot(robot, uncertainty, shift)) for shift in shifts)]
    counts = {int(np.sum(part < top)) for part in found}
    if len(counts) == 1:
        return top
    for kept in range(min(counts), 0, -1):
        lower = max(float(part[kept - 1]) for part in found)
        upper = min(float(part[kept]) if len(part) > kept else np.inf for part in found)
        if lower < _APART * upper:
            return float(np.sqrt(lower * upper))
    raise InputError(
        "a small change of the numbers in [update] adds modes below this robot's first: measure the base's and the "
        "tool's compliance, or take [update] out of the file and do without bands"
    )


def _slopes(robot: SpatialRobot, uncertainty: RobotUncertainty, derived: Callable[[SpatialRobot], Real]) -> Real:
    """Change by one standard deviation along each principal direction, (n_directions, ...)."""
    return np.array([_slope(robot, uncertainty, derived, shift) for shift in principal_shifts(uncertainty)])


def _slope(
    robot: SpatialRobot, uncertainty: RobotUncertainty, derived: Callable[[SpatialRobot], Real], shift: Real
) -> Real:
    """Central difference; with smaller steps where the first leaves no robot: a damping below zero, another structure.

    Raises
    ------
    InputError
        The smallest step leaves no robot either.
    """
    for step in _STEPS[:-1]:
        with suppress(InputError):
            return _difference(robot, uncertainty, derived, shift, step)
    return _difference(robot, uncertainty, derived, shift, _STEPS[-1])


def _difference(
    robot: SpatialRobot,
    uncertainty: RobotUncertainty,
    derived: Callable[[SpatialRobot], Real],
    shift: Real,
    step: float,
) -> Real:
    ahead, behind = (derived(shifted_robot(robot, uncertainty, sign * step * shift)) for sign in (1, -1))
    return np.asarray((ahead - behind) / (2 * step))


def _aligned(model: ModalModel, wanted: ModalModel) -> ModalModel:
    """Modes in another model's order, each scaled so that its right vector is nearest to that of the other."""
    if len(model.poles) != len(wanted.poles):
        raise InputError(
            f"{len(wanted.poles)} damped modes, {len(model.poles)} after a small change of the robot's numbers; "
            "ask for a band without overdamped modes"
        )
    apart = np.abs(model.poles[:, None] - wanted.poles) / np.abs(wanted.poles)
    product = np.abs(model.right @ wanted.right.conj().T)
    sizes = np.linalg.norm(model.right, axis=1)[:, None] * np.linalg.norm(wanted.right, axis=1)
    apart = apart + 0.1 * (1 - product / np.maximum(sizes, 1e-300))
    rows, columns = linear_sum_assignment(apart)
    order = rows[np.argsort(columns)]
    right, left = model.right[order], model.left[order]
    norm = np.sum(np.abs(right) ** 2, axis=1)
    factor = np.divide(
        np.sum(right.conj() * wanted.right, axis=1), norm, out=np.ones(len(norm), dtype=complex), where=norm > 0
    )
    factor = np.where(np.abs(factor) > 1e-6, factor, 1.0)[:, None]
    return replace(model, poles=model.poles[order], right=right * factor, left=left / factor)
