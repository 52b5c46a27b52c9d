"""What an effect is made of: a change of the structure, of the forces on it, or of the measuring chain."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..excitation import Test
from ..integrator import Element
from ..structures import Structure

Signals = NDArray[np.float64]
Chain = Callable[[Signals, np.random.Generator], Signals]
"""Signals (n, 3) at 512 Hz in, distorted signals out; the generator is that of one recording."""
Shake = Callable[[int, np.random.Generator], Signals]
"""Unmeasured forces (n, 3) at the tip, of one recording of n samples."""
Joint = Callable[[Test], tuple[Element, ...]]
"""Elements, which may follow the spindle's angle or the time of a test."""


@dataclass(frozen=True)
class Scene:
    """The system that an effect is put into, with its own scales at the middle load level.

    Parameters
    ----------
    direction, other : (3,), or (4,) of a joint inside the structure
        Unit vectors of two joint coordinates.
    deflection, speed
        RMS along ``direction``, m and m/s.
    stiffness
        Static along ``direction``, N/m.
    force
        RMS of all three forces, N.
    accelerations : (3,), m/s^2
        Root mean square of each acceleration.
    seed
        Seed of everything else that the effect draws; the same at every strength.
    """

    structure: Structure
    direction: NDArray[np.float64]
    other: NDArray[np.float64]
    deflection: float
    speed: float
    stiffness: float
    force: float
    accelerations: NDArray[np.float64]
    seed: int

    def rng(self) -> np.random.Generator:
        """A fresh generator, the same each time."""
        return np.random.default_rng(self.seed)


@dataclass(frozen=True)
class Change:
    """What differs from the linear structure and a perfect chain; empty: nothing.

    Parameters
    ----------
    after_noise
        Distortion of noisy accelerations (converters, dropouts).
    parameters
        For the truth, SI units; empty where the law is of no named family.
    """

    joint: Joint | None = None
    structure: Structure | None = None
    shake: Shake | None = None
    force_chain: Chain | None = None
    acceleration_chain: Chain | None = None
    after_noise: Chain | None = None
    parameters: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Effect:
    """A concealed cause.

    Parameters
    ----------
    name
        Name of the right answer.
    families
        Families of its law; the first is the textbook's.
    build
        Change of a family at a ``dial``; the response changes with the dial monotonically for small dials.
    start, largest
        Dial to begin the search of a strength with, and the largest that makes sense.
    directional
        Whether a joint direction is to be found.
    answer
        What a tool may call it, if that is not its name.
    """

    name: str
    families: tuple[str, ...]
    build: Callable[[Scene, str, float], Change]
    start: float = 0.1
    largest: float = 1e4
    directional: bool = False
    answer: str = ""


def fixed(*elements: Element) -> Joint:
    """The same elements in every test."""
    return lambda test: elements
