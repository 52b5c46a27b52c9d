"""A cell of its own, sharing no code with the package: joints whose stiffness and loss depend on angle and load."""

from dataclasses import dataclass

import numpy as np
from independent_robot import LUMPS, SPRINGS, Lump, mass_and_tip, weight_torques
from numpy.typing import NDArray

Real = NDArray[np.float64]

LOAD = np.array([2000.0, 9000.0, 5000.0, 300.0, 300.0, 80.0])
"""Turning moments, N m, at which a gear's stiffness has left its light-load value."""

TOOL_MASS = 0.3
"""kg, on the spring between spindle and tip."""

LOWEST = np.array([-60.0, -40.0, 40.0, -90.0, 30.0, -90.0])
HIGHEST = np.array([60.0, 45.0, 120.0, 90.0, 110.0, 90.0])
"""Range of the postures, degrees."""


@dataclass(frozen=True)
class NonlinearCell:
    """A six-axis robot as it is.

    Parameters
    ----------
    lumps, springs
        Bodies on axes, and springs at light load, N m/rad.
    tool
        Compliance between spindle and tip, m/N, which no model knows.
    stiffening, wave, phase : (6,)
        Shares by which a joint stiffens under load and over its angle, and the angle of the wave, rad.
    loss, friction : (6,)
        Loss factor of each joint, and how much load adds to it.
    """

    lumps: tuple[Lump, ...]
    springs: Real
    tool: tuple[float, float, float]
    stiffening: Real
    wave: Real
    phase: Real
    loss: Real
    friction: Real

    def joints(self, q: Real) -> tuple[Real, Real]:
        """Stiffness, N m/rad, and loss factor of each joint about a posture."""
        load = np.tanh(np.abs(weight_torques(self.lumps, q)) / LOAD)
        wave = 1 + self.wave * np.cos(2 * q + self.phase)
        return self.springs * (1 + self.stiffening * load) * wave, self.loss * (1 + self.friction * load) * wave

    def modes(self, q: Real) -> tuple[Real, Real, Real]:
        """Natural angular frequencies, rad/s, damping ratios, and mass-normalised motion of the tip (n_modes, 3)."""
        mass, tip = mass_and_tip(self.lumps, q, TOOL_MASS)
        stiffness, loss = self.joints(q)
        springs = np.concatenate([stiffness, 1 / np.array(self.tool)])
        root = np.linalg.inv(np.linalg.cholesky(mass))
        squares, turned = np.linalg.eigh(root @ np.diag(springs) @ root.T)
        vectors = root.T @ turned
        energy = springs[:, None] * vectors**2 / squares
        return np.sqrt(squares), np.append(loss, [0.02] * 3) @ energy / 2, (tip @ vectors).T


def drawn_cell(rng: np.random.Generator) -> tuple[NonlinearCell, tuple[Lump, ...], tuple[float, ...]]:
    """A cell, and the bodies and springs that its model believes in."""
    believed = tuple(
        Lump(each.axis, each.mass * float(np.exp(rng.normal(0, 0.08))), each.centre, each.inertia) for each in LUMPS
    )
    springs = tuple(float(k * np.exp(rng.normal(0, 0.15))) for k in SPRINGS)
    tool = 1e-8 * np.exp(rng.normal(0, 0.3))
    cell = NonlinearCell(
        LUMPS,
        np.array(SPRINGS),
        (tool, tool, 0.3 * tool),
        rng.uniform(0.0, 0.35, 6),
        rng.uniform(0.0, 0.12, 6),
        rng.uniform(0, 2 * np.pi, 6),
        0.08 * np.exp(rng.normal(0, 0.3, 6)),
        rng.uniform(0.0, 0.8, 6),
    )
    return cell, believed, springs


def drawn_postures(rng: np.random.Generator, count: int) -> Real:
    """Postures of the range, rad, (count, 6)."""
    return np.radians(rng.uniform(LOWEST, HIGHEST, (count, 6)))
