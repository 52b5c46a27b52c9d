"""Fit of a hypothesis to recordings in several postures: a few numbers of the robot, and each mode's deviation."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from robot_model import Change, Companion

from ...inference import Limits, descend, plain_step
from .posed_robot import Changes, PosedRobot
from .receptance import RobotModes, predicted_spectrum, quick_spectrum

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

STEP = 1e-3
"""Step of a change's coordinate for its derivative: ln of a factor, or rad."""

DESCENT = Limits(most=12, tolerance=0.05, idle=1, tries=2, most_damping=10.0, lengthens=False)
"""When a fit ends: numbers of a robot are few, and their errors are wanted to a small part of themselves."""


@dataclass(frozen=True)
class RobotFit:
    """A robot with changes, fitted to recordings.

    Parameters
    ----------
    changes
        Changes and companions with their fitted numbers.
    deviations
        Deviations u of the modes of each recording, in units of the laboratory's error.
    misfit
        ``2 sum r^H V^-1 r`` over lines and recordings, V known.
    deviation
        ``sum |u|^2``.
    doubt
        ``sum ((number - centre) / spread)^2`` over companions, of which something is believed.
    price
        ``ln N`` for each change, and ``2 ln(spread / standard error)`` for each companion: what their freedom costs
        (Bayes' information criterion, and Laplace's approximation where a belief has a width).
    standard_errors : (n_changes,)
        Standard errors of the numbers, in their units.
    modes
        Modes in each recording's posture, deviations included.
    told
        Number of deviations that the recordings tell, ``sum 1 - belief var(u)``: the value that |u|^2 is expected
        to have.
    """

    changes: Changes
    deviations: tuple[Real, ...]
    misfit: float
    deviation: float
    doubt: float
    price: float
    standard_errors: Real
    modes: tuple[RobotModes, ...]
    told: float

    @property
    def cost(self) -> float:
        """Misfit, deviation and doubt: what the fit minimises."""
        return self.misfit + self.deviation + self.doubt

    @property
    def score(self) -> float:
        """Cost and price: what hypotheses are compared by."""
        return self.cost + self.price


def fit_robot(
    robot: PosedRobot,
    changes: Changes,
    whiteners: Sequence[Complex],
    *,
    start: Sequence[Real] | None = None,
    belief: float = 1.0,
) -> RobotFit:
    """Fit the changes' numbers and the modes' deviations: minimise ``2 sum |W r|^2 + belief |u|^2``.

    Parameters
    ----------
    robot
        The robot and its recordings.
    changes
        Changes with the numbers to start from.
    whiteners
        Whitening W of each recording, (n_lines, n_responses, n_responses).
    start
        Deviations of each recording to start from, (n_deviations,); None: zero.
    belief
        Precision of the belief that u is zero: 1, or little to fit the modes freely.
    """
    problem = _Problem(robot, tuple(whiteners), belief)
    state = descend(problem, problem.state(changes, start), DESCENT).state
    matrix, _ = state.normal
    deviation, doubt = float(sum(u @ u for u in state.deviations)), _doubt(state.changes)
    variance = np.maximum(np.diag(np.linalg.inv(matrix)), 0.0)
    units = np.array([change.slope(number) for change, number in state.changes])
    errors = np.sqrt(variance[: len(changes)]) * units
    return RobotFit(
        state.changes,
        state.deviations,
        state.cost - belief * deviation - doubt,
        deviation,
        doubt,
        _price(state.changes, errors, robot.values),
        errors,
        tuple(one.moved(u, robot.error) for one, u in zip(state.modes, state.deviations, strict=True)),
        float(np.sum(1 - belief * variance[len(changes) :])),
    )


def start_cost(robot: PosedRobot, changes: Changes, whiteners: Sequence[Complex], deviations: Sequence[Real]) -> float:
    """``2 sum |W r|^2 + |u|^2`` at given numbers and deviations.

    Parameters
    ----------
    robot
        The robot and its recordings.
    changes
        Changes with their numbers.
    whiteners
        Whitening W of each recording, (n_lines, n_responses, n_responses).
    deviations
        Deviations u of each recording, (n_deviations,).
    """
    return _Problem(robot, tuple(whiteners), 1.0).state(changes, deviations).cost


def _doubt(changes: Changes) -> float:
    """``sum ((number - centre) / spread)^2`` over companions."""
    return float(
        sum(((number - one.centre) / one.spread) ** 2 for one, number in changes if isinstance(one, Companion))
    )


def _price(changes: Changes, errors: Real, values: int) -> float:
    """Price of the numbers, as :class:`RobotFit`."""
    price = 0.0
    for (one, _), error in zip(changes, errors, strict=True):
        if isinstance(one, Change):
            price += float(np.log(values))
        else:
            price += max(2 * float(np.log(one.spread / max(float(error), 1e-300))), 0.0)
    return price


@dataclass(frozen=True)
class _Problem:
    """What stays the same in one fit, and the moves of its descent (see :class:`mismatch.inference.Problem`)."""

    robot: PosedRobot
    whiteners: tuple[Complex, ...]
    belief: float

    def state(self, changes: Changes, deviations: Sequence[Real] | None = None) -> "_State":
        """The state at given numbers; deviations are zero where None is given."""
        modes = tuple(self.robot.modes(changes))
        u = tuple(deviations) if deviations is not None else tuple(np.zeros(one.size) for one in modes)
        return _State(self, changes, modes, u)

    def cost(self, state: "_State") -> float:
        return state.cost

    def normal_equations(self, state: "_State") -> tuple[Real, Real]:
        return state.normal

    def step(self, state: "_State", matrix: Real, gradient: Real) -> Real:
        return plain_step(matrix, gradient)

    def moved(self, state: "_State", step: Real) -> "_State":
        return state.moved(step)

    def settled(self, state: "_State") -> "_State":
        return state


@dataclass(frozen=True)
class _State:
    """Where a fit stands: numbers, modes that they give, deviations of these, and all that follows from them."""

    problem: _Problem
    changes: Changes
    modes: tuple[RobotModes, ...]
    deviations: tuple[Real, ...]

    @cached_property
    def seen(self) -> tuple[RobotModes, ...]:
        """Modes of each recording, deviations included."""
        error = self.problem.robot.error
        return tuple(one.moved(u, error) for one, u in zip(self.modes, self.deviations, strict=True))

    @cached_property
    def rest(self) -> list[Complex]:
        """Whitened residual of each recording, (n_lines, n_responses)."""
        recordings = self.problem.robot.recordings
        return [
            np.einsum("kij,kj->ki", white, one.spectrum.measured - predicted_spectrum(modes, one.spectrum))
            for modes, one, white in zip(self.seen, recordings, self.problem.whiteners, strict=True)
        ]

    @cached_property
    def cost(self) -> float:
        """Misfit and belief; infinite where the prediction is not finite."""
        misfit = 2 * sum(float(np.sum(np.abs(one) ** 2)) for one in self.rest)
        cost = misfit + self.problem.belief * float(sum(u @ u for u in self.deviations)) + _doubt(self.changes)
        return cost if np.isfinite(cost) else np.inf

    @cached_property
    def beside(self) -> list[list[RobotModes]]:
        """Modes with one coordinate after the other a little off: one list a change, one entry a recording."""
        result = []
        for which, (change, number) in enumerate(self.changes):
            changes = list(self.changes)
            changes[which] = (change, change.from_fit(change.to_fit(number) + STEP))
            pairs = zip(self.problem.robot.modes(tuple(changes)), self.modes, strict=True)
            result.append([one.aligned(other) for one, other in pairs])
        return result

    def moved(self, step: Real) -> "_State":
        """The state after a step of the numbers' coordinates and then of all deviations.

        The recordings fix the modes far better than the robot's numbers, so the step is taken linearly in the modes as
        seen; deviations are what the new robot needs to show them. Taken linearly in u, it would leave a narrow valley.
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
        modes = tuple(one.aligned(other) for one, other in zip(fresh, self.modes, strict=True))
        deviations, at = [], count
        for which, (old, new, u) in enumerate(zip(self.modes, modes, self.deviations, strict=True)):
            shown = u + np.clip(step[at : at + len(u)], -15.0, 15.0)
            for part, aside in zip(taken, self.beside, strict=True):
                shown = shown + part / STEP * old.deviations(aside[which], error)
            deviations.append(new.deviations(old.moved(shown, error), error))
            at += len(u)
        return _State(self.problem, changes, modes, tuple(deviations))

    @cached_property
    def normal(self) -> tuple[Real, Real]:
        """Normal equations over the numbers' coordinates and all deviations, in this order."""
        belief, count = self.problem.belief, len(self.changes)
        size = count + sum(len(u) for u in self.deviations)
        matrix, gradient = np.diag(np.full(size, belief)), np.zeros(size)
        matrix[:count, :count] = 1e-6 * np.eye(count)
        for place, (one, value) in enumerate(self.changes):
            if isinstance(one, Companion):
                slope = one.slope(value) / one.spread
                matrix[place, place] += slope**2
                gradient[place] -= slope * (value - one.centre) / one.spread
        at = count
        for which, u in enumerate(self.deviations):
            turned, small = self._slopes(which), self.rest[which].ravel()
            places = np.concatenate([np.arange(count), np.arange(at, at + len(u))])
            matrix[np.ix_(places, places)] += 2 * (turned.real.T @ turned.real + turned.imag.T @ turned.imag)
            gradient[places] += 2 * (turned.real.T @ small.real + turned.imag.T @ small.imag)
            gradient[at : at + len(u)] -= belief * u
            at += len(u)
        return matrix, gradient

    def _slopes(self, which: int) -> Complex:
        """Whitened derivatives of one recording by the coordinates and its deviations, (n_values, n_coordinates)."""
        error, spectrum = self.problem.robot.error, self.problem.robot.recordings[which].spectrum
        base, modes = self.modes[which], self.seen[which]
        slopes = modes.slopes(base, spectrum.frequencies, spectrum.force_here, error) * spectrum.kinematic[:, :, None]
        here = quick_spectrum(modes, spectrum)
        columns = []
        for aside in (one[which] for one in self.beside):
            # modes that may deviate are followed exactly, the others by differences: the valley is narrow
            followed = slopes @ base.deviations(aside, error)
            held = aside.moved(aside.deviations(modes, error), error)
            columns.append(((followed + quick_spectrum(held, spectrum) - here) / STEP)[:, :, None])
        turned = self.problem.whiteners[which] @ np.concatenate([*columns, slopes], axis=2)
        return np.asarray(turned.reshape(self.rest[which].size, -1))
