"""Confidence bands of anything computed from a robot with uncertain parameters."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import Frf, FrfCovariance
from millfrf.core import InputError, Real
from modal_fit import ModalModel, pack_parameters

from ..full_update.changed_structure import (
    FOUNDATION,
    LEAST_COMPLIANCE,
    UpdateParameter,
    changed_by,
    payload_centre,
    point_mass,
)
from ..spatial.spatial_robot import SpatialRobot


@dataclass(frozen=True)
class RobotUncertainty:
    """Numbers that an update changed in a robot's file, with the covariance of what is still unknown.

    Parameters
    ----------
    parameters
        Numbers that were freed.
    values : (n_parameters,)
        Differences that are in the file already, from the file before.
    covariance : (n_parameters, n_parameters)
        Covariance of these differences, in the parameters' units.

    Raises
    ------
    InputError
        Sizes that do not agree, or a covariance that is not one.
    """

    parameters: tuple[UpdateParameter, ...]
    values: NDArray[np.float64]
    covariance: NDArray[np.float64]

    def __post_init__(self) -> None:
        n = len(self.parameters)
        if self.values.shape != (n,) or self.covariance.shape != (n, n):
            raise InputError(
                f"[update] has {n} numbers and a covariance of shape {self.covariance.shape}; update the robot anew"
            )
        size = np.sqrt(np.abs(np.diag(self.covariance))) + 1e-300
        scaled = (self.covariance + self.covariance.T) / 2 / np.outer(size, size)
        if not np.isfinite(scaled).all() or np.linalg.eigvalsh(scaled)[0] < -1e-6:
            raise InputError("[update] covariance has a negative variance or no number; update the robot anew")


def shifted_robot(robot: SpatialRobot, uncertainty: RobotUncertainty, shift: Real) -> SpatialRobot:
    """The updated robot with its numbers shifted further.

    A payload that the file has already is exchanged for the shifted one. A compliance that falls below zero is none.

    Parameters
    ----------
    robot
        The robot as the updated file has it.
    uncertainty
        Its ``[update]`` table.
    shift : (n_parameters,)
        Shifts, in the parameters' units.
    """
    parameters, own = uncertainty.parameters, np.asarray(shift, dtype=float).copy()
    of_payload = {one.axis: i for i, one in enumerate(parameters) if one.kind == "payload"}
    bodies = []
    if of_payload:
        was = {axis: uncertainty.values[i] for axis, i in of_payload.items()}
        now = {axis: uncertainty.values[i] + own[i] for axis, i in of_payload.items()}
        for sign, numbers in ((-1.0, was), (1.0, now)):
            place = payload_centre(robot) + np.array([numbers.get(axis, 0.0) for axis in range(3)])
            bodies.append(point_mass(robot, sign * numbers.get(3, 0.0), place))
        own[list(of_payload.values())] = 0.0
    base = [i for i, one in enumerate(parameters) if one.kind == "base"]
    grounded = _with_base(robot, {parameters[i].axis: float(own[i]) for i in base})
    if grounded is not robot:
        own[base] = 0.0
    changed = changed_by(grounded, parameters, own)
    return replace(changed, bodies=(*changed.bodies, *(body for body in bodies if body.mass)))


def _with_base(robot: SpatialRobot, added: dict[int, float]) -> SpatialRobot:
    """Shift the compliances of a base's springs where the file has them."""
    joints = []
    for joint in robot.joints:
        if joint.frame != FOUNDATION:
            joints.append(joint)
            continue
        compliance = 1 / joint.stiffness
        for axis, places in ((0, [3, 4]), (1, [0, 1])):
            shifted = compliance[places] + added.get(axis, 0.0)
            compliance[places] = np.where(shifted > LEAST_COMPLIANCE, shifted, 0.0)
        with np.errstate(divide="ignore"):
            joints.append(replace(joint, stiffness=1 / compliance))
    found = tuple(joints)
    return robot if all(a is b for a, b in zip(found, robot.joints, strict=True)) else replace(robot, joints=found)


def principal_shifts(uncertainty: RobotUncertainty) -> Real:
    """Shifts S (n_directions, n_parameters) with ``S^T S`` the covariance: one standard deviation each."""
    size = np.sqrt(np.diag(uncertainty.covariance))
    scale = np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(uncertainty.covariance / np.outer(scale, scale))
    kept = values > 1e-12
    return np.asarray((vectors[:, kept] * np.sqrt(values[kept])).T * scale)


def drawn_robots(
    robot: SpatialRobot, uncertainty: RobotUncertainty, count: int, seed: int = 0
) -> Iterator[SpatialRobot]:
    """Draw robots from what the update left open, normally distributed."""
    shifts = principal_shifts(uncertainty)
    generator = np.random.default_rng(seed)
    for weights in generator.normal(size=(count, len(shifts))):
        yield shifted_robot(robot, uncertainty, weights @ shifts)


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
    rows, columns = scipy.optimize.linear_sum_assignment(apart)
    order = rows[np.argsort(columns)]
    right, left = model.right[order], model.left[order]
    norm = np.sum(np.abs(right) ** 2, axis=1)
    factor = np.divide(
        np.sum(right.conj() * wanted.right, axis=1), norm, out=np.ones(len(norm), dtype=complex), where=norm > 0
    )
    factor = np.where(np.abs(factor) > 1e-6, factor, 1.0)[:, None]
    return replace(model, poles=model.poles[order], right=right * factor, left=left / factor)
