"""Fit of a few robot parameters and of deviations of the modes to recordings in several postures, and its start."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from millfrf.core import Complex, InputError, Real
from millfrf.robot_model import Change, Companion

from ..inference.numerics import Limits, descend, plain_step
from ..models.misfit import levels
from ..records.noise_model import fit_noise, whitening
from .posed import LIMITS, Changes, PosedRobot
from .receptance import RobotModes, predicted_spectrum, quick_spectrum

STEP = 1e-3  # step of a change's coordinate for its derivative: ln of a factor, or rad


def companion_penalty(changes: Changes) -> float:
    """Return ``sum ((number - centre) / spread)^2`` over all companions whose numbers have a prior."""
    return float(
        sum(
            ((number - change.centre) / change.spread) ** 2
            for change, number in changes
            if isinstance(change, Companion)
        )
    )


@dataclass(frozen=True)
class FitProblem:
    """Least-squares problem of one fit (:class:`millfrf.mismatch.inference.numerics.Problem`), with its constants."""

    # robot with its recordings, whitening W of each recording, and precision of the prior that deviations are zero
    robot: PosedRobot
    whiteners: tuple[Complex, ...]
    precision: float = 1.0

    def state(self, changes: Changes, deviations: Sequence[Real] | None = None) -> "FitState":
        """Return the state at given numbers.

        ``deviations``: deviations u of each recording, (n_deviations,); None: zero.
        """
        modes = tuple(self.robot.modes(changes))
        u = tuple(deviations) if deviations is not None else tuple(np.zeros(mode.size) for mode in modes)
        return FitState(self, changes, modes, u)

    def cost(self, state: "FitState") -> float:
        return state.cost

    def normal_equations(self, state: "FitState") -> tuple[Real, Real]:
        """Return normal matrix and gradient at a state."""
        return state.normal

    def step(self, state: "FitState", matrix: Real, gradient: Real) -> Real:
        return plain_step(matrix, gradient)

    def moved(self, state: "FitState", step: Real) -> "FitState":
        return state.moved(step)

    def settled(self, state: "FitState") -> "FitState":
        return state


@dataclass(frozen=True)
class FitState:
    """State of a fit, and everything computed from it."""

    problem: FitProblem  # recordings, whitening and prior, which are constant in the fit
    changes: Changes
    modes: tuple[RobotModes, ...]
    deviations: tuple[Real, ...]

    @cached_property
    def deviated_modes(self) -> tuple[RobotModes, ...]:
        """Modes of each recording, deviations included."""
        error = self.problem.robot.error
        return tuple(mode.moved(u, error) for mode, u in zip(self.modes, self.deviations, strict=True))

    @cached_property
    def residuals(self) -> list[Complex]:
        """Whitened residual of each recording, (n_lines, n_responses)."""
        recordings = self.problem.robot.recordings
        return [
            np.einsum("kij,kj->ki", white, recording.spectrum.measured - predicted_spectrum(modes, recording.spectrum))
            for modes, recording, white in zip(self.deviated_modes, recordings, self.problem.whiteners, strict=True)
        ]

    @cached_property
    def cost(self) -> float:
        """Misfit and prior; infinite if the prediction is not finite."""
        misfit = 2 * sum(float(np.sum(np.abs(residual) ** 2)) for residual in self.residuals)
        cost = (
            misfit
            + self.problem.precision * float(sum(u @ u for u in self.deviations))
            + companion_penalty(self.changes)
        )
        return cost if np.isfinite(cost) else np.inf

    @cached_property
    def neighbours(self) -> list[list[RobotModes]]:
        """Modes after a small step of each number: one list for each change, with one entry for each recording."""
        result = []
        for which, (change, number) in enumerate(self.changes):
            changes = list(self.changes)
            changes[which] = (change, change.from_fit(change.to_fit(number) + STEP))
            pairs = zip(self.problem.robot.modes(tuple(changes)), self.modes, strict=True)
            result.append([modes.aligned(other) for modes, other in pairs])
        return result

    def moved(self, step: Real) -> "FitState":
        """Return the state after a step of the coordinates of the numbers and then of all deviations.

        The recordings determine the modes far better than the numbers of the robot. The deviated modes therefore change
        linearly with the step, and the new deviations follow from the new robot. With a step that is linear in the
        deviations, the error of the modes would be too large.

        ``step``: change of the numbers' coordinates, then of the deviations, (n_coordinates,).
        """
        count, error = len(self.changes), self.problem.robot.error
        changes = tuple(
            (change, change.from_fit(change.to_fit(number) + float(np.clip(part, -0.5, 0.5))))
            for (change, number), part in zip(self.changes, step[:count], strict=True)
        )
        taken = [
            change.to_fit(after) - change.to_fit(before)
            for (change, before), (_, after) in zip(self.changes, changes, strict=True)
        ]
        fresh = self.problem.robot.modes(changes)
        modes = tuple(new.aligned(old) for new, old in zip(fresh, self.modes, strict=True))
        deviations, at = [], count
        for which, (old, new, u) in enumerate(zip(self.modes, modes, self.deviations, strict=True)):
            shown = u + np.clip(step[at : at + len(u)], -15.0, 15.0)
            for part, neighbour in zip(taken, self.neighbours, strict=True):
                shown = shown + part / STEP * old.deviations(neighbour[which], error)
            deviations.append(new.deviations(old.moved(shown, error), error))
            at += len(u)
        return FitState(self.problem, changes, modes, tuple(deviations))

    @cached_property
    def normal(self) -> tuple[Real, Real]:
        """Normal matrix and gradient for the coordinates of the numbers, followed by all deviations."""
        precision, count = self.problem.precision, len(self.changes)
        size = count + sum(len(u) for u in self.deviations)
        matrix, gradient = np.diag(np.full(size, precision)), np.zeros(size)
        matrix[:count, :count] = 1e-6 * np.eye(count)
        for place, (change, value) in enumerate(self.changes):
            if isinstance(change, Companion):
                slope = change.slope(value) / change.spread
                matrix[place, place] += slope**2
                gradient[place] -= slope * (value - change.centre) / change.spread
        at = count
        for which, u in enumerate(self.deviations):
            slopes, residual = self._slopes(which), self.residuals[which].ravel()
            places = np.concatenate([np.arange(count), np.arange(at, at + len(u))])
            matrix[np.ix_(places, places)] += 2 * (slopes.real.T @ slopes.real + slopes.imag.T @ slopes.imag)
            gradient[places] += 2 * (slopes.real.T @ residual.real + slopes.imag.T @ residual.imag)
            gradient[at : at + len(u)] -= precision * u
            at += len(u)
        return matrix, gradient

    def _slopes(self, which: int) -> Complex:
        """Return whitened derivatives of one recording by coordinates and deviations, (n_values, n_coordinates)."""
        error, spectrum = self.problem.robot.error, self.problem.robot.recordings[which].spectrum
        base, modes = self.modes[which], self.deviated_modes[which]
        slopes = modes.slopes(base, spectrum.frequencies, spectrum.force_here, error) * spectrum.kinematic[:, :, None]
        base_spectrum = quick_spectrum(modes, spectrum)
        columns = []
        for neighbour in (lists_of_change[which] for lists_of_change in self.neighbours):
            # exact derivatives for the modes with deviations, difference quotients for all other modes
            exact = slopes @ base.deviations(neighbour, error)
            undeviated = neighbour.moved(neighbour.deviations(modes, error), error)
            columns.append(((exact + quick_spectrum(undeviated, spectrum) - base_spectrum) / STEP)[:, :, None])
        whitened = self.problem.whiteners[which] @ np.concatenate([*columns, slopes], axis=2)
        return np.asarray(whitened.reshape(self.residuals[which].size, -1))


# stopping criteria: a robot has few numbers, whose errors must be small compared with their standard errors
DESCENT = Limits(max_steps=12, tolerance=0.05, max_idle=1, max_lengths=2, max_damping=10.0, lengthen=False)


@dataclass(frozen=True)
class RobotFit:
    """A fit of a robot with changes to recordings."""

    changes: Changes
    deviations: tuple[Real, ...]
    misfit: float  # ``2 sum r^H V^-1 r`` over lines and recordings, with the noise covariance V known
    deviation: float  # squared deviations of all modes, ``sum |u|^2``
    companion_prior: float  # ``sum ((number - centre) / spread)^2`` over companions whose numbers have a prior
    # sum of ``ln N`` for each change (Bayes' information criterion) and ``2 ln(spread / standard error)`` for each
    # companion (Laplace's approximation for the prior with the standard deviation ``spread``)
    price: float
    standard_errors: Real  # standard errors of the numbers, in their units, (n_changes,)
    modes: tuple[RobotModes, ...]
    # number of deviations that the recordings determine, ``sum 1 - precision var(u)``: the expected value of |u|^2
    determined: float

    @property
    def cost(self) -> float:
        """Misfit, deviation and prior of companions, which the fit minimises."""
        return self.misfit + self.deviation + self.companion_prior

    @property
    def score(self) -> float:
        """Sum of cost and price, by which hypotheses are compared."""
        return self.cost + self.price


def fit_robot(
    robot: PosedRobot,
    changes: Changes,
    whiteners: Sequence[Complex],
    *,
    start: Sequence[Real] | None = None,
    precision: float = 1.0,
) -> RobotFit:
    """Minimise ``2 sum |W r|^2 + precision |u|^2`` over the numbers of changes and the deviations of modes.

    ``start``: deviations of each recording to start from, (n_deviations,); None: zero. ``precision``: precision of the
    prior that u is zero: 1, or a small value to fit the modes freely.
    """
    problem = FitProblem(robot, tuple(whiteners), precision)
    state = descend(problem, problem.state(changes, start), DESCENT).state
    matrix, _ = state.normal
    deviation, companion_misfit = float(sum(u @ u for u in state.deviations)), companion_penalty(state.changes)
    variance = np.maximum(np.diag(np.linalg.inv(matrix)), 0.0)
    units = np.array([change.slope(number) for change, number in state.changes])
    errors = np.sqrt(variance[: len(changes)]) * units
    return RobotFit(
        state.changes,
        state.deviations,
        state.cost - precision * deviation - companion_misfit,
        deviation,
        companion_misfit,
        _price(state.changes, errors, robot.values),
        errors,
        tuple(mode.moved(u, robot.error) for mode, u in zip(state.modes, state.deviations, strict=True)),
        float(np.sum(1 - precision * variance[len(changes) :])),
    )


def _price(changes: Changes, errors: Real, values: int) -> float:
    """Return the price of the numbers, as defined in :class:`RobotFit`."""
    price = 0.0
    for (change, _), error in zip(changes, errors, strict=True):
        if isinstance(change, Change):
            price += float(np.log(values))
        else:
            price += max(2 * float(np.log(change.spread / max(float(error), 1e-300))), 0.0)
    return price


def numbered(change: Change, number: float) -> Changes:
    """Return a change with a given number, followed by its companions at the centres of their priors."""
    return ((change, number), *((companion, companion.neutral) for companion in change.companions))


def best_start(robot: PosedRobot, before: Changes, change: Change) -> tuple[Changes, float]:
    """Return the changes with a further change at its best number, and the measure :func:`residual_of_fit`."""
    starts = [(*before, *numbered(change, number)) for number in change.values]
    residuals = [residual_of_fit(robot, start) for start in starts]
    best = int(np.argmin(residuals))
    return starts[best], residuals[best]


def nearest(robot: PosedRobot, changes: Sequence[Change], least: float) -> Changes:
    """Return the change with the smallest residual, or no change if it lowers the residual by less than ``least``."""
    best, residual = min((best_start(robot, (), change) for change in changes), key=lambda start: start[1])
    return best if residual < residual_of_fit(robot, ()) - least else ()


def residual_of_fit(robot: PosedRobot, changes: Changes) -> float:
    """Return ``sum n ln(sum |r|^2 / sum |y|^2)`` over channels and recordings; infinite for an impossible robot.

    Up to a constant, this is minus twice the log likelihood for noise of unknown size on each channel (Seber & Wild,
    Nonlinear Regression, section 2.2). The modes have no deviations.
    """
    try:
        modes = robot.modes(changes)
    except InputError:
        return np.inf
    total = 0.0
    for recording, modes_of_recording in zip(robot.recordings, modes, strict=True):
        spectrum = recording.spectrum
        residual_power = np.sum(np.abs(spectrum.measured - quick_spectrum(modes_of_recording, spectrum)) ** 2, axis=0)
        power = np.sum(np.abs(spectrum.measured) ** 2, axis=0)
        total += len(spectrum.frequencies) * float(np.sum(np.log(residual_power / power)))
    return total


@dataclass(frozen=True)
class FreeFit:
    """Modes fitted to the recordings with a very weak prior, and the noise of the residual."""

    fitted: RobotFit
    # whitening W of each recording, (n_lines, n_responses, n_responses): the same for every hypothesis
    whiteners: tuple[Complex, ...]

    def only(self, chosen: Sequence[int]) -> "FreeFit":
        """Return the free fit to the recordings with the indices ``chosen``; each recording is fitted independently."""
        modes = tuple(self.fitted.modes[i] for i in chosen)
        u = tuple(self.fitted.deviations[i] for i in chosen)
        return FreeFit(replace(self.fitted, modes=modes, deviations=u), tuple(self.whiteners[i] for i in chosen))


def free_fit(robot: PosedRobot, start: Changes) -> FreeFit:
    """Fit the modes freely, starting from a nearly correct robot; noise is inferred from the residual, twice."""
    white: list[Complex] = []
    for recording, modes in zip(robot.recordings, robot.modes(start), strict=True):
        spectrum = recording.spectrum
        level = np.sqrt(np.mean(np.abs(spectrum.measured - quick_spectrum(modes, spectrum)) ** 2, axis=0))
        whitener = np.diag(1 / np.maximum(level, 1e-300)).astype(complex)
        white.append(np.broadcast_to(whitener, (len(spectrum.frequencies), *whitener.shape)))
    fitted = fit_robot(robot, start, white, precision=LIMITS.loose)
    for _ in range(2):
        white = whiteners_of(robot, fitted)
        fitted = fit_robot(robot, fitted.changes, white, start=fitted.deviations, precision=LIMITS.loose)
    return FreeFit(fitted, tuple(white))


def whiteners_of(robot: PosedRobot, fitted: RobotFit) -> list[Complex]:
    """Return the whitening W of each recording from the residual of a fit, (n_lines, n_responses, n_responses)."""
    white = []
    for recording, modes in zip(robot.recordings, fitted.modes, strict=True):
        spectrum = recording.spectrum
        if not (spectrum.measured.any(axis=0).all() and spectrum.force_here.any(axis=0).all()):
            raise InputError(f"{recording.name}: a channel is zero in the band; leave it out")
        through = np.asarray(modes.receptance(spectrum.frequencies) * spectrum.kinematic[:, :, None])
        residual = spectrum.measured - predicted_spectrum(modes, spectrum)
        noise = fit_noise(spectrum.frequencies, residual, through, levels(spectrum))
        white.append(whitening(noise.covariance(spectrum.frequencies, through)))
    return white


def fit_from(robot: PosedRobot, start: Changes, free: FreeFit) -> RobotFit:
    """Fit a hypothesis with the full prior, from the freely fitted modes or from the modes of the robot.

    The start with the smaller cost is used. A mode of the robot that the recordings do not contain keeps its nominal
    numbers.
    """
    free_deviations = []
    for modes, other in zip(robot.modes(start), free.fitted.modes, strict=True):
        table = modes.deviations(other, robot.error).reshape(modes.count, -1)
        table[np.abs(table).max(axis=1) > LIMITS.strange] = 0.0
        free_deviations.append(table.ravel())
    zero_deviations = [np.zeros_like(u) for u in free_deviations]
    problem = FitProblem(robot, free.whiteners)
    start_deviations = min((free_deviations, zero_deviations), key=lambda u: problem.state(start, u).cost)
    return fit_robot(robot, start, free.whiteners, start=start_deviations)
