"""Standard errors and covariances of results that are computed from a robot with uncertain parameters."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import Frf, FrfCovariance
from millfrf.core import InputError, Real
from modal_fit import ModalModel, pack_parameters

from ..settings import UPDATE
from ..spatial.spatial_robot import SpatialRobot
from .changed_structure import (
    FOUNDATION,
    UpdateParameter,
    changed_by,
    payload_place,
    point_mass,
)

STEP = 0.05  # step of the differences, in standard deviations


@dataclass(frozen=True)
class RobotUncertainty:
    """Uncertainty of an updated robot, from the ``[update]`` table of its file."""

    parameters: tuple[UpdateParameter, ...]  # parameters that were freed
    values: NDArray[np.float64]  # (n_parameters,): changes that the update made; the numbers of the file include them
    covariance: NDArray[np.float64]  # (n_parameters, n_parameters): covariance of `values`, in the parameters' units

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
    """Shift the parameters of an updated robot by a further ``shift`` (n_parameters,), in the parameters' units.

    A payload in the file is replaced by the shifted payload. A compliance that would become negative is set to zero.
    """
    parameters, own = uncertainty.parameters, np.asarray(shift, dtype=float).copy()
    payload = {parameter.axis: i for i, parameter in enumerate(parameters) if parameter.kind == "payload"}
    bodies = []
    if payload:
        before = {axis: uncertainty.values[i] for axis, i in payload.items()}
        after = {axis: uncertainty.values[i] + own[i] for axis, i in payload.items()}
        # the payload of the file is cancelled by an equal mass with negative sign
        for sign, numbers in ((-1.0, before), (1.0, after)):
            bodies.append(point_mass(robot, sign * numbers.get(3, 0.0), payload_place(numbers)))
        own[list(payload.values())] = 0.0
    if any(joint.frame == FOUNDATION for joint in robot.joints):
        base = {parameter.axis: i for i, parameter in enumerate(parameters) if parameter.kind == "base"}
        robot = _with_base(robot, {axis: float(own[i]) for axis, i in base.items()})
        own[list(base.values())] = 0.0
    changed = changed_by(robot, parameters, own)
    return replace(changed, bodies=(*changed.bodies, *(body for body in bodies if body.mass)))


def _with_base(robot: SpatialRobot, added: dict[int, float]) -> SpatialRobot:
    """Add to the compliances of base springs that the file already has; ``added`` by axis (0: tilting, 1: radial)."""
    joints = []
    for joint in robot.joints:
        if joint.frame == FOUNDATION:
            compliance = 1 / joint.stiffness
            for axis, places in ((0, [3, 4]), (1, [0, 1])):
                shifted = compliance[places] + added.get(axis, 0.0)
                compliance[places] = np.where(shifted > UPDATE.least_compliance, shifted, 0.0)
            with np.errstate(divide="ignore"):
                joint = replace(joint, stiffness=1 / compliance)
        joints.append(joint)
    return replace(robot, joints=tuple(joints))


def principal_shifts(uncertainty: RobotUncertainty) -> Real:
    """Compute shifts S (n_directions, n_parameters) of one standard deviation each: ``S^T S`` is the covariance."""
    size = np.sqrt(np.diag(uncertainty.covariance))
    scale = np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(uncertainty.covariance / np.outer(scale, scale))
    positive = values > 1e-12
    return np.asarray((vectors[:, positive] * np.sqrt(values[positive])).T * scale)


def drawn_robots(
    robot: SpatialRobot, uncertainty: RobotUncertainty, count: int, seed: int = 0
) -> Iterator[SpatialRobot]:
    """Draw robots from the normal distribution of the parameters after the update."""
    shifts = principal_shifts(uncertainty)
    generator = np.random.default_rng(seed)
    for weights in generator.normal(size=(count, len(shifts))):
        yield shifted_robot(robot, uncertainty, weights @ shifts)


def derived_errors(robot: SpatialRobot, uncertainty: RobotUncertainty, derived: Callable[[SpatialRobot], Real]) -> Real:
    """Compute the standard errors of any array that is derived from a robot, as an array of equal shape.

    ``sigma^2 = sum_d ((f(+h s_d) - f(-h s_d)) / 2 h)^2`` over the covariance's principal directions s_d.

    Parameters
    ----------
    robot
        The updated robot.
    uncertainty
        Its ``[update]`` table.
    derived
        Function that computes an array from a robot.
    """
    return np.asarray(np.sqrt(np.sum(np.abs(_slopes(robot, uncertainty, derived)) ** 2, axis=0)))


def frf_with_errors(frf: Frf, errors: Real) -> Frf:
    """Add standard errors to an FRF in the form that FRF files have, ``response[p] excitation[q]``.

    The two factors are chosen so that the mean variances of rows and of columns are kept.

    Parameters
    ----------
    frf
        The FRF of the updated robot.
    errors : (n_lines, n_responses, n_excitations)
        Standard errors of its entries, in its unit.
    """
    variance = errors**2
    rows, columns = variance.mean(axis=2), variance.mean(axis=1)
    mean = np.maximum(variance.mean(axis=(1, 2)), 1e-300)[:, None]
    response = rows[:, :, None] * np.eye(rows.shape[1], dtype=complex)
    excitation = (columns / mean)[:, :, None] * np.eye(columns.shape[1], dtype=complex)
    return replace(frf, covariance=FrfCovariance(response, excitation))


def with_model_covariance(
    robot: SpatialRobot, uncertainty: RobotUncertainty, derived: Callable[[SpatialRobot], ModalModel]
) -> ModalModel:
    """Return the modal model that ``derived`` computes from a robot, with a covariance from the robot's uncertainty.

    A robot is refused if a small shift of its parameters changes the number of damped modes.
    """
    model = derived(robot)

    def packed(changed: SpatialRobot) -> Real:
        return pack_parameters(_aligned(derived(changed), model))

    slopes = _slopes(robot, uncertainty, packed)
    return replace(model, covariance=slopes.T @ slopes)


def _widest_gap(frequencies: Real) -> float:
    """Return the frequency (Hz) in the middle of the widest gap between neighbouring modes, among modes 6 to 16.

    A small change of the robot moves no mode across this frequency, so that the number of modes below is constant.
    With fewer than seven modes the frequency is infinite.

    Examples
    --------
    >>> _widest_gap(np.array([10.0, 20.0, 30.0]))
    inf
    >>> round(_widest_gap(np.r_[np.arange(10.0, 18.0), 72.0, 73.0]))
    35
    """
    upper = frequencies[5:16]
    if len(upper) < 2:
        return float(np.inf)
    at = int(np.argmax(upper[1:] / upper[:-1]))
    return float(np.sqrt(upper[at] * upper[at + 1]))


def below_new_modes(
    robot: SpatialRobot, uncertainty: RobotUncertainty, frequencies: Callable[[SpatialRobot], Real]
) -> float:
    """Find a frequency (Hz) below which small changes of the parameters neither add nor remove a mode.

    A tool or a base that is rigid in the file, and compliant after a small change, adds modes. The frequency is then
    lowered into the highest gap between modes that stays free of modes after every change.
    ``frequencies`` computes a robot's natural frequencies in a posture, Hz, rising.
    """
    own = frequencies(robot)
    top = _widest_gap(own)
    shifts = [sign * STEP * shift for shift in principal_shifts(uncertainty) for sign in (1, -1)]
    spectra = [own, *(frequencies(shifted_robot(robot, uncertainty, shift)) for shift in shifts)]
    counts = {int(np.sum(values < top)) for values in spectra}
    if len(counts) == 1:
        return top
    for count in range(min(counts), 0, -1):
        lower = max(float(values[count - 1]) for values in spectra)
        upper = min(float(values[count]) if len(values) > count else np.inf for values in spectra)
        if lower < 0.99 * upper:
            return float(np.sqrt(lower * upper))
    raise InputError(
        "a small change of the numbers in [update] adds modes below this robot's first: measure the base's and the "
        "tool's compliance, or remove [update] from the file; there are no bands then"
    )


def _slopes(robot: SpatialRobot, uncertainty: RobotUncertainty, derived: Callable[[SpatialRobot], Real]) -> Real:
    """Compute the change of ``derived`` by one standard deviation in each principal direction, (n_directions, ...)."""

    def difference(shift: Real, step: float) -> Real:
        ahead, behind = (derived(shifted_robot(robot, uncertainty, sign * step * shift)) for sign in (1, -1))
        return np.asarray((ahead - behind) / (2 * step))

    def slope(shift: Real) -> Real:
        # a step may give an invalid robot, such as one with negative damping; then a smaller step is tried
        for step in (STEP, STEP / 10):
            with suppress(InputError):
                return difference(shift, step)
        return difference(shift, STEP / 100)

    return np.array([slope(shift) for shift in principal_shifts(uncertainty)])


def _aligned(model: ModalModel, reference: ModalModel) -> ModalModel:
    """Sort modes as in a reference model, and scale each right vector to be nearest to that of the reference."""
    if len(model.poles) != len(reference.poles):
        raise InputError(
            f"{len(reference.poles)} damped modes, {len(model.poles)} after a small change of the robot's numbers; "
            "choose a band without overdamped modes"
        )
    distance = np.abs(model.poles[:, None] - reference.poles) / np.abs(reference.poles)
    product = np.abs(model.right @ reference.right.conj().T)
    sizes = np.linalg.norm(model.right, axis=1)[:, None] * np.linalg.norm(reference.right, axis=1)
    # modes with nearly equal poles are distinguished by their shapes
    distance = distance + 0.1 * (1 - product / np.maximum(sizes, 1e-300))
    rows, columns = scipy.optimize.linear_sum_assignment(distance)
    order = rows[np.argsort(columns)]
    right, left = model.right[order], model.left[order]
    norm = np.sum(np.abs(right) ** 2, axis=1)
    factor = np.divide(
        np.sum(right.conj() * reference.right, axis=1), norm, out=np.ones(len(norm), dtype=complex), where=norm > 0
    )
    factor = np.where(np.abs(factor) > 1e-6, factor, 1.0)[:, None]
    return replace(model, poles=model.poles[order], right=right * factor, left=left / factor)
