"""Robots drawn at random: close, heavily damped modes of joints, hidden modes above, another stiffness at rest.

Shares nothing with the simulated cell: each mode turns the spindle as a rigid body about an axis at the joints.
"""

from dataclasses import dataclass, replace

import numpy as np

from estimation import Frf, FrfCovariance
from millfrf.core import HOUSING, TIP, Band
from modal_fit import ModalModel

SENSOR = np.array([0.05, -0.03, 0.22])  # m from the tip


@dataclass(frozen=True)
class Robot:
    """Modes in the cut and at rest, at tip and sensor, excited at the tip; row k of all models is the same mode."""

    cut_at_tip: ModalModel
    cut_at_sensor: ModalModel
    rest_at_tip: ModalModel
    rest_at_sensor: ModalModel

    @property
    def n_low(self) -> int:
        """Number of modes below 50 Hz, which a cut excites."""
        return int((self.cut_at_tip.natural_frequencies < 50).sum())

    def in_process(self, band: Band = (8.0, 50.0)) -> ModalModel:
        """Return what a perfect fit of the cut gives at the sensor: its modes below 50 Hz, in a shuffled order."""
        return first_modes(replace(self.cut_at_sensor, band=band), self.n_low)

    def hammer(self) -> ModalModel:
        """Return a perfect fit of both hammer FRFs, the rows of the tip first."""
        tip, sensor = self.rest_at_tip, self.rest_at_sensor
        return replace(tip, right=np.hstack([tip.right, sensor.right]), responses=TIP + HOUSING)


def first_modes(model: ModalModel, count: int) -> ModalModel:
    return replace(model, poles=model.poles[:count], right=model.right[:count], left=model.left[:count])


def draw_robot(rng: np.random.Generator, shifts: Band, *, hidden: int = 2) -> Robot:
    """Draw a robot whose natural frequencies at rest are higher by the shares ``shifts`` (lower where negative)."""
    while True:
        n = int(rng.integers(3, 6))
        low = np.sort(rng.uniform(11, 42, n))
        if rng.random() < 0.7:  # a close pair
            low[1] = low[0] * rng.uniform(1.04, 1.12)
        if np.min(np.diff(np.sort(low)) / np.sort(low)[:-1]) > 0.03:
            break
    frequencies = np.concatenate([np.sort(low), np.sort(rng.uniform(70, 140, hidden))])
    zeta = np.concatenate([rng.uniform(0.03, 0.12, n), rng.uniform(0.015, 0.04, hidden)])
    count = n + hidden
    axes = rng.normal(size=(count, 3)) * [0.3, 0.3, 0.2] + [0, 0, -1.3]  # m: the tip relative to the axes
    directions = rng.normal(size=(count, 3)) * [1, 1, 0.4]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    tip = directions / np.sqrt(rng.uniform(40, 250, count))[:, None]  # kg^-1/2
    turn = np.cross(axes, tip) / np.sum(axes**2, axis=1, keepdims=True)
    sensor = tip + np.cross(turn, SENSOR)
    at_rest = frequencies * (1 + rng.uniform(*shifts, count))
    models = [
        modes(f, zeta, shapes, tip, responses)
        for f in (frequencies, at_rest)
        for shapes, responses in ((tip, TIP), (sensor, HOUSING))
    ]
    return Robot(*models)


def modes(
    frequencies: np.ndarray, zeta: np.ndarray, shapes: np.ndarray, forces: np.ndarray, responses: tuple[str, ...]
) -> ModalModel:
    """Return real modes with mass-normalised shapes (kg^-1/2) at the responses and at the forces."""
    natural = 2 * np.pi * frequencies
    damped = natural * np.sqrt(1 - zeta**2)
    left = forces / (2j * damped[:, None])
    return ModalModel(-zeta * natural + 1j * damped, shapes.astype(complex), left, responses, TIP)


def tapped(model: ModalModel, rng: np.random.Generator, *, noise: float = 1e-3, top: float = 200.0) -> Frf:
    """Return the accelerance of a tap test with white noise, ``noise`` of the root mean square of each row."""
    lines = np.arange(2.0, top, 0.25)
    values = -((2 * np.pi * lines) ** 2)[:, None, None] * model.receptance(lines)
    size = noise * np.sqrt(np.mean(np.abs(values) ** 2, axis=(0, 2)))
    shape = values.shape
    values = values + size[:, None] / np.sqrt(2) * (rng.standard_normal(shape) + 1j * rng.standard_normal(shape))
    ones = np.ones((len(lines), 1, 1))
    covariance = FrfCovariance(ones * np.diag(size**2) + 0j, ones * np.eye(3) + 0j)
    return Frf(
        lines, values, model.responses, TIP, "accelerance", "m/s^2/N", lines > 0, covariance=covariance, band=(2.0, top)
    )
