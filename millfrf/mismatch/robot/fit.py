"""Fit of a few robot parameters, and a deviation of each mode, to recordings in several postures."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from millfrf.core import Complex, Real
from millfrf.robot_model import Change, Companion

from ..inference.descent import Limits, descend, plain_step
from .posed import Changes, PosedRobot
from .receptance import RobotModes, predicted_spectrum, quick_spectrum

STEP = 1e-3
"""Step of a change's coordinate for its derivative: ln of a factor, or rad."""


def doubt_of(changes: Changes) -> float:
    """``sum ((number - centre) / spread)^2`` over companions whose numbers are believed to lie near a centre.

    Parameters
    ----------
    changes
        Changes and companions with their numbers.
    """
    return float(
        sum(((number - one.centre) / one.spread) ** 2 for one, number in changes if isinstance(one, Companion))
    )


@dataclass(frozen=True)
class FitProblem:
    """What stays the same in one fit, as a :class:`millfrf.mismatch.inference.descent.Problem`.

    Parameters
    ----------
    robot, whiteners, belief
        The robot with its recordings, their whitening W, and the precision of the belief that deviations are zero.
    """

    robot: PosedRobot
    whiteners: tuple[Complex, ...]
    belief: float = 1.0

    def state(self, changes: Changes, deviations: Sequence[Real] | None = None) -> "FitState":
        """The state at given numbers.

        Parameters
        ----------
        changes
            Changes with their numbers.
        deviations
            Deviations u of each recording, (n_deviations,); None: zero.
        """
        modes = tuple(self.robot.modes(changes))
        u = tuple(deviations) if deviations is not None else tuple(np.zeros(one.size) for one in modes)
        return FitState(self, changes, modes, u)

    def cost(self, state: "FitState") -> float:
        """Misfit and belief of a state."""
        return state.cost

    def normal_equations(self, state: "FitState") -> tuple[Real, Real]:
        """Normal matrix and gradient at a state."""
        return state.normal

    def step(self, state: "FitState", matrix: Real, gradient: Real) -> Real:
        """Step of the coordinates."""
        return plain_step(matrix, gradient)

    def moved(self, state: "FitState", step: Real) -> "FitState":
        """The state after a step."""
        return state.moved(step)

    def settled(self, state: "FitState") -> "FitState":
        """The state itself: its noise is known."""
        return state


@dataclass(frozen=True)
class FitState:
    """State of a fit, and all that follows from it.

    Parameters
    ----------
    problem
        Recordings, whitening and belief, which stay the same in the fit.
    changes
        Changes with their numbers.
    modes
        Modes that these give in each recording's posture.
    deviations
        Deviations u of the modes of each recording, (n_deviations,).
    """

    problem: FitProblem
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
        cost = misfit + self.problem.belief * float(sum(u @ u for u in self.deviations)) + doubt_of(self.changes)
        return cost if np.isfinite(cost) else np.inf

    @cached_property
    def beside(self) -> list[list[RobotModes]]:
        """Modes with each coordinate a little off in turn: one list for each change, one entry for each recording."""
        result = []
        for which, (change, number) in enumerate(self.changes):
            changes = list(self.changes)
            changes[which] = (change, change.from_fit(change.to_fit(number) + STEP))
            pairs = zip(self.problem.robot.modes(tuple(changes)), self.modes, strict=True)
            result.append([one.aligned(other) for one, other in pairs])
        return result

    def moved(self, step: Real) -> "FitState":
        """The state after a step of the numbers' coordinates and then of all deviations.

        The recordings fix the modes far better than the robot's numbers, so the step is taken linearly in the modes as
        seen; the deviations then give the new robot these modes. A step linear in u would leave a narrow valley.

        Parameters
        ----------
        step : (n_coordinates,)
            Change of the numbers' coordinates, then of the deviations.
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
        return FitState(self.problem, changes, modes, tuple(deviations))

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
        ``2 sum r^H V^-1 r`` over lines and recordings, with the noise covariance V known.
    deviation
        Squared deviations of all modes, ``sum |u|^2``.
    doubt
        ``sum ((number - centre) / spread)^2`` over companions whose numbers are believed to lie near a centre.
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
    problem = FitProblem(robot, tuple(whiteners), belief)
    state = descend(problem, problem.state(changes, start), DESCENT).state
    matrix, _ = state.normal
    deviation, doubt = float(sum(u @ u for u in state.deviations)), doubt_of(state.changes)
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


def _price(changes: Changes, errors: Real, values: int) -> float:
    """Price of the numbers, as :class:`RobotFit`."""
    price = 0.0
    for (one, _), error in zip(changes, errors, strict=True):
        if isinstance(one, Change):
            price += float(np.log(values))
        else:
            price += max(2 * float(np.log(one.spread / max(float(error), 1e-300))), 0.0)
    return price
