"""Bands of whatever a robot gives: its uncertain numbers, carried on by first order."""

from collections.abc import Callable
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


def _slopes(robot: SpatialRobot, uncertainty: RobotUncertainty, derived: Callable[[SpatialRobot], Real]) -> Real:
    """Change by one standard deviation along each principal direction, (n_directions, ...)."""
    return np.array(
        [
            (derived(shifted_robot(robot, uncertainty, STEP * shift)) - derived(_back(robot, uncertainty, shift)))
            / (2 * STEP)
            for shift in principal_shifts(uncertainty)
        ]
    )


def _back(robot: SpatialRobot, uncertainty: RobotUncertainty, shift: Real) -> SpatialRobot:
    return shifted_robot(robot, uncertainty, -STEP * shift)


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
