"""What the postures can tell apart: eigenvectors of the belief after against the belief before."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .response import UpdateParameter

Real = NDArray[np.float64]

LEFT_OPEN = 0.5
"""A direction is open where its standard deviation is still above this share of the belief before."""

SHARE = 0.35
"""Size of a parameter's part in a direction from which it is mentioned."""


@dataclass(frozen=True)
class OpenDirection:
    """A combination of numbers that the postures leave open.

    Parameters
    ----------
    names
        Numbers that take part, largest first.
    parts
        Their parts in the unit vector, in units of the beliefs before.
    left : float
        Standard deviation after over that before, along the direction.
    """

    names: tuple[str, ...]
    parts: tuple[float, ...]
    left: float

    @property
    def sentence(self) -> str:
        """The same in words."""
        share = f"{100 * self.left:.0f} % of the belief before is left"
        if len(self.names) == 1:
            return f"cannot tell {self.names[0]} here ({share})"
        listed = ", ".join(self.names[:-1]) + f" and {self.names[-1]}"
        return f"cannot tell {listed} apart here ({share})"


def open_directions(parameters: Sequence[UpdateParameter], covariance: Real) -> tuple[OpenDirection, ...]:
    """Eigenvectors of ``D^-1 C D^-1``, D the beliefs' spreads, with a root eigenvalue above :data:`LEFT_OPEN`.

    Parameters
    ----------
    covariance : (n_parameters, n_parameters)
        Covariance after the measurements.
    """
    spread = np.array([one.spread for one in parameters])
    values, vectors = np.linalg.eigh(covariance / np.outer(spread, spread))
    found = []
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        if value < LEFT_OPEN**2:
            break
        order = [i for i in np.argsort(-np.abs(vector)) if abs(vector[i]) > SHARE]
        names = tuple(parameters[i].name for i in order)
        found.append(OpenDirection(names, tuple(float(vector[i]) for i in order), float(np.sqrt(value))))
    return tuple(found)
