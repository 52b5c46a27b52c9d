"""Gauss-Newton on recordings in several postures: a few numbers of the robot, and each mode's deviation from it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_model import Companion

from .robot_receptance import RobotModes, predicted_lines, quick_lines
from .robot_setting import Changes, Setting

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

STEP = 1e-3
"""Of a change's coordinate for its derivative: ln of a factor, or rad."""


@dataclass(frozen=True)
class RobotFit:
    """A robot with changes, fitted to recordings.

    Parameters
    ----------
    changes
        With their numbers.
    deviations
        u of each recording, in units of the setting's error.
    misfit
        ``2 sum r^H V^-1 r`` over lines and recordings, V known.
    deviation
        ``sum |u|^2``.
    doubt
        ``sum ((number - centre) / spread)^2`` over companions of the changes, of which something is believed.
    standard_errors : (n_changes,)
        Of the numbers, in their units.
    modes
        Of each recording's posture, deviations included.
    told
        How many deviations the recordings tell: ``sum 1 - belief var(u)``; what |u|^2 is expected to be.
    """

    changes: Changes
    deviations: tuple[Real, ...]
    misfit: float
    deviation: float
    doubt: float
    standard_errors: Real
    modes: tuple[RobotModes, ...]
    told: float

    @property
    def cost(self) -> float:
        """Misfit, deviation and doubt: what the changes are judged by."""
        return self.misfit + self.deviation + self.doubt

    @property
    def price(self) -> float:
        """``2 ln(spread / standard error)`` over companions: what their freedom costs (Laplace's approximation)."""
        return float(
            sum(
                max(2 * np.log(one.spread / max(float(error), 1e-300)), 0.0)
                for (one, _), error in zip(self.changes, self.standard_errors, strict=True)
                if isinstance(one, Companion)
            )
        )


def fit_robot(
    setting: Setting,
    changes: Changes,
    whiteners: Sequence[Complex],
    *,
    start: Sequence[Real] | None = None,
    belief: float = 1.0,
    iterations: int = 12,
) -> RobotFit:
    """Fit the changes' numbers and the modes' deviations: minimise ``2 sum |W r|^2 + belief |u|^2``.

    Parameters
    ----------
    setting
    changes
        With their numbers at the start.
    whiteners
        W of each recording, (n_lines, n_responses, n_responses).
    start
        Deviations to begin with; None: zero.
    belief
        Precision of the belief that u is zero: 1, or little to fit the modes freely.
    iterations
        At most.
    """
    state = _State(setting, changes, list(start) if start is not None else None)
    cost, rest = _cost(setting, state, whiteners, belief)
    damping = 0.0
    beside = state.beside()
    matrix, gradient = _normal(setting, state, beside, rest, whiteners, belief)
    for _ in range(iterations):
        step = np.asarray(np.linalg.solve(matrix + damping * np.diag(np.diag(matrix)), gradient), dtype=float)
        for shorter in (1.0, 0.25):
            trial = state.moved(np.asarray(shorter * step, dtype=float), beside)
            trial_cost, trial_rest = _cost(setting, trial, whiteners, belief)
            if trial_cost < cost:
                break
        if not trial_cost < cost:
            if damping > 10:
                break
            damping = max(10 * damping, 0.1)
            continue
        gained, state, cost, rest, damping = cost - trial_cost, trial, trial_cost, trial_rest, damping / 10
        beside = state.beside()
        matrix, gradient = _normal(setting, state, beside, rest, whiteners, belief)
        if gained < 0.05:
            break
    deviation, doubt = float(sum(u @ u for u in state.deviations)), _doubt(state.changes)
    variance = np.maximum(np.diag(np.linalg.inv(matrix)), 0.0)
    spread, told = np.sqrt(variance[: len(changes)]), float(np.sum(1 - belief * variance[len(changes) :]))
    units = np.array([change.slope(number) for change, number in state.changes])
    seen = tuple(one.moved(u, setting.error) for one, u in zip(state.modes, state.deviations, strict=True))
    misfit = cost - belief * deviation - doubt
    return RobotFit(state.changes, tuple(state.deviations), misfit, deviation, doubt, spread * units, seen, told)


def start_cost(setting: Setting, changes: Changes, whiteners: Sequence[Complex], deviations: Sequence[Real]) -> float:
    """``2 sum |W r|^2 + |u|^2`` at given numbers and deviations."""
    return _cost(setting, _State(setting, changes, list(deviations)), whiteners, 1.0)[0]


class _State:
    """Where a fit stands."""

    def __init__(
        self,
        setting: Setting,
        changes: Changes,
        deviations: list[Real] | None,
        reference: list[RobotModes] | None = None,
    ) -> None:
        self.changes = changes
        self.modes = setting.modes(changes)
        if reference is not None:
            self.modes = [one.aligned(other) for one, other in zip(self.modes, reference, strict=True)]
        self.deviations = deviations if deviations is not None else [np.zeros(modes.size) for modes in self.modes]
        self._setting = setting

    def beside(self) -> list[list[RobotModes]]:
        """Modes with one coordinate after the other a little off: one list a change, one entry a recording."""
        result = []
        for which, (change, number) in enumerate(self.changes):
            changes = list(self.changes)
            changes[which] = (change, change.from_fit(change.to_fit(number) + STEP))
            pairs = zip(self._setting.modes(tuple(changes)), self.modes, strict=True)
            result.append([one.aligned(other) for one, other in pairs])
        return result

    def moved(self, step: Real, beside: list[list[RobotModes]]) -> "_State":
        """The state after a step of the numbers' coordinates and then of all deviations.

        The recordings fix the modes far better than the robot's numbers, so the step is taken linearly in the modes as
        seen; deviations are what the new robot needs to show them. Taken linearly in u, it would leave a narrow valley.
        """
        count, error = len(self.changes), self._setting.error
        changes = tuple(
            (change, change.from_fit(change.to_fit(number) + float(np.clip(part, -0.5, 0.5))))
            for (change, number), part in zip(self.changes, step[:count], strict=True)
        )
        state = _State(self._setting, changes, None, self.modes)
        taken = [
            change.to_fit(after) - change.to_fit(before)
            for (change, before), (_, after) in zip(self.changes, changes, strict=True)
        ]
        at = count
        for number, (old, u) in enumerate(zip(self.modes, self.deviations, strict=True)):
            shown = u + np.clip(step[at : at + len(u)], -15.0, 15.0)
            for part, aside in zip(taken, beside, strict=True):
                shown = shown + part / STEP * old.deviations(aside[number], error)
            state.deviations[number] = state.modes[number].deviations(old.moved(shown, error), error)
            at += len(u)
        return state


def _doubt(changes: Changes) -> float:
    """``sum ((number - centre) / spread)^2`` over companions."""
    return float(
        sum(((number - one.centre) / one.spread) ** 2 for one, number in changes if isinstance(one, Companion))
    )


def _cost(setting: Setting, state: _State, whiteners: Sequence[Complex], belief: float) -> tuple[float, list[Complex]]:
    """Misfit and belief; whitened residuals (n_lines, n_responses) of each recording."""
    rest = []
    for modes, u, recording, white in zip(state.modes, state.deviations, setting.recordings, whiteners, strict=True):
        predicted = predicted_lines(modes.moved(u, setting.error), recording.lines)
        rest.append(np.einsum("kij,kj->ki", white, recording.lines.measured - predicted))
    misfit = 2 * sum(float(np.sum(np.abs(one) ** 2)) for one in rest)
    cost = misfit + belief * float(sum(u @ u for u in state.deviations)) + _doubt(state.changes)
    return (cost if np.isfinite(cost) else np.inf), rest


def _normal(
    setting: Setting,
    state: _State,
    beside: list[list[RobotModes]],
    rest: list[Complex],
    whiteners: Sequence[Complex],
    belief: float,
) -> tuple[Real, Real]:
    """Normal equations over the numbers' coordinates and all deviations, in this order."""
    count = len(state.changes)
    size = count + sum(len(u) for u in state.deviations)
    matrix, gradient = np.diag(np.full(size, belief)), np.zeros(size)
    matrix[:count, :count] = 1e-6 * np.eye(count)
    for place, (one, value) in enumerate(state.changes):
        if isinstance(one, Companion):
            slope = one.slope(value) / one.spread
            matrix[place, place] += slope**2
            gradient[place] -= slope * (value - one.centre) / one.spread
    at = count
    for number, (recording, white) in enumerate(zip(setting.recordings, whiteners, strict=True)):
        lines, u = recording.lines, state.deviations[number]
        modes = state.modes[number].moved(u, setting.error)
        slopes = modes.slopes(state.modes[number], lines.frequencies, lines.force_here, setting.error)
        slopes = slopes * lines.kinematic[:, :, None]
        here = quick_lines(modes, lines)
        columns = []
        for aside in (one[number] for one in beside):
            # modes that may deviate are followed exactly, the others by differences: the valley is narrow
            followed = slopes @ state.modes[number].deviations(aside, setting.error)
            held = aside.moved(aside.deviations(modes, setting.error), setting.error)
            columns.append(((followed + quick_lines(held, lines) - here) / STEP)[:, :, None])
        turned = (white @ np.concatenate([*columns, slopes], axis=2)).reshape(rest[number].size, -1)
        small = rest[number].ravel()
        places = np.concatenate([np.arange(count), np.arange(at, at + len(u))])
        matrix[np.ix_(places, places)] += 2 * (turned.real.T @ turned.real + turned.imag.T @ turned.imag)
        gradient[places] += 2 * (turned.real.T @ small.real + turned.imag.T @ small.imag)
        gradient[at : at + len(u)] -= belief * u
        at += len(u)
    return matrix, gradient
