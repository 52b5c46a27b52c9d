"""Postures spread over a work area, by inverse kinematics of a vertical tool."""

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from millfrf.core import InputError
from millfrf.robot_model import Mechanism, target_of, tool_down, tool_postures

Real = NDArray[np.float64]

LOWEST = np.array([1.1, -0.8, 0.5, 110.0])
HIGHEST = np.array([2.1, 0.8, 1.2, 250.0])
"""Work area: place of the tool tip in the base frame, m, and turn about the tool, degrees; 180 leaves joint 6 at 0."""

MARGIN = np.radians(5.0)
"""Distance that is kept from the joints' limits, rad."""

DIGITS = 3
"""Decimals of the angles, degrees, as a robot's controller shows them."""


def spread_postures(mechanism: Mechanism, ready: Real, count: int, generator: np.random.Generator) -> Real:
    """Postures over the work area, each the branch nearest to ``ready``.

    Places are a scrambled Halton sequence; those that the tool does not reach within the limits are left out.

    Parameters
    ----------
    mechanism
        Kinematics of the robot.
    ready : (n_driven,), rad
        Posture from which branches are chosen.
    count
        Number of postures.
    generator
        Random generator that scrambles the sequence.

    Returns
    -------
    (count, n_driven), rad
        Angles, whole thousandths of a degree.

    Raises
    ------
    InputError
        The robot reaches too few places of the area.
    """
    halton = qmc.Halton(len(LOWEST), rng=generator)
    found: list[Real] = []
    for _ in range(20 * count):
        x, y, z, turn = LOWEST + (HIGHEST - LOWEST) * halton.random(1)[0]
        target = target_of(tool_down([x, y, z], float(np.radians(turn))))
        branches = [q for q in tool_postures(mechanism, target, ready) if _inside(mechanism, q)]
        if branches:
            nearest = min(branches, key=lambda q: float(np.abs(q - ready).max()))
            found.append(np.radians(np.round(np.degrees(nearest), DIGITS)))
        if len(found) == count:
            return np.array(found)
    raise InputError(f"the robot reaches {len(found)} of {count} places of the work area; ask for fewer poses")


def _inside(mechanism: Mechanism, q: Real) -> bool:
    frames = [mechanism.frames[index] for index in mechanism.moving]
    return all(frame.lower + MARGIN < value < frame.upper - MARGIN for frame, value in zip(frames, q, strict=True))
