"""What recordings can tell of a payload's mass at best: Fisher's information, from the other robot alone.

Each mode may be off by u standard deviations (1 % in frequency, 15 % in damping, 5 % of a shape's size), noise on
forces and responses is as recorded, and a stated belief goes with the place. Nothing of the package is used.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from independent_robot import OtherRobot, modes, of_modes
from numpy.typing import NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

FREQUENCY, DAMPING, SHAPE = 0.01, 0.15, 0.05
"""By how much a right model's modes are off."""
STEPS = np.array([0.01, 0.001, 0.001, 0.001])
"""Of mass (kg) and place (m) for the differences."""


@dataclass(frozen=True)
class Recorded:
    """Force lines (n_lines, 3) at ``lines`` Hz of one recording of n samples, and its noise's standard deviations."""

    q: Real
    lines: Real
    force: Complex
    samples: int
    force_noise: Real
    response_noise: Real


def mass_errors(robot: OtherRobot, mass: float, place: Real, recorded: list[Recorded], belief: Real) -> Real:
    """Least standard errors: of the mass with a free place, of the place (3,), of the mass with the place known; (5,).

    Parameters
    ----------
    robot
        Without the payload.
    mass, place
        kg, and m from the tip.
    recorded
        All recordings.
    belief : (3,), m
        Standard deviation of what is believed of the place.
    """
    whole = sum((_information(robot, np.array([mass, *place]), each) for each in recorded), np.zeros((4, 4)))
    free = whole.copy()
    free[1:, 1:] += np.diag(1 / belief**2)
    return np.array([*np.sqrt(np.diag(np.linalg.inv(free))), 1 / np.sqrt(whole[0, 0])])


def _information(robot: OtherRobot, numbers: Real, one: Recorded) -> Real:
    """Of mass and place in one recording, its modes' deviations eliminated, (4, 4)."""

    def at(changed: Real) -> tuple[Real, Real]:
        return modes(robot.loaded(float(changed[0]), tuple(changed[1:])), one.q)

    natural, shapes = at(numbers)
    ratio = np.full(len(natural), robot.ratio)
    slopes = [_by_number(one, ratio, at, numbers, i, shapes) for i in range(4)]
    slopes += [_by_mode(one, natural, shapes, ratio, k, what) for k in range(len(natural)) for what in range(5)]
    white = np.linalg.inv(np.linalg.cholesky(_noise(one, natural, shapes, ratio)))
    table = np.einsum("kij,ckj->cki", white, np.array(slopes)).reshape(len(slopes), -1)
    matrix = 2 * (table.conj() @ table.T).real
    matrix[4:, 4:] += np.eye(len(slopes) - 4)
    return np.asarray(matrix[:4, :4] - matrix[:4, 4:] @ np.linalg.solve(matrix[4:, 4:], matrix[4:, :4]))


def _predicted(one: Recorded, natural: Real, shapes: Real, ratio: Real) -> Complex:
    inertia = (2j * np.pi * one.lines[:, None]) ** 2
    return np.asarray(np.einsum("kpq,kq->kp", of_modes(natural, shapes, ratio, one.lines), one.force) * inertia)


def _noise(one: Recorded, natural: Real, shapes: Real, ratio: Real) -> Complex:
    """Covariance of the residual a line, (n_lines, 3, 3): of the responses, and of the forces through the robot."""
    gain = of_modes(natural, shapes, ratio, one.lines) * (2j * np.pi * one.lines[:, None, None]) ** 2
    through = np.einsum("kpq,q,krq->kpr", gain, one.force_noise**2, gain.conj())
    return np.asarray(one.samples * (through + np.diag(one.response_noise**2)))


def _by_number(
    one: Recorded,
    ratio: Real,
    at: Callable[[Real], tuple[Real, Real]],
    numbers: Real,
    which: int,
    reference: Real,
) -> Complex:
    sides = []
    for sign in (1, -1):
        natural, shapes = at(numbers + sign * STEPS * (np.arange(4) == which))
        shapes = shapes * np.sign(np.sum(shapes * reference, axis=0))
        sides.append(_predicted(one, natural, shapes, ratio))
    return np.asarray((sides[0] - sides[1]) / (2 * STEPS[which]))


def _by_mode(one: Recorded, natural: Real, shapes: Real, ratio: Real, mode: int, what: int) -> Complex:
    """By a deviation of one mode: 0 frequency, 1 damping, 2 to 4 an entry of the shape."""
    sides, step = [], 1e-4
    for sign in (step, -step):
        f, z, phi = natural.copy(), ratio.copy(), shapes.copy()
        f[mode] *= np.exp(FREQUENCY * sign * (what == 0))
        z[mode] *= np.exp(DAMPING * sign * (what == 1))
        if what > 1:
            phi[what - 2, mode] += SHAPE * np.sqrt(np.mean(shapes[:, mode] ** 2)) * sign
        sides.append(_predicted(one, f, phi, z))
    return np.asarray((sides[0] - sides[1]) / (2 * step))
