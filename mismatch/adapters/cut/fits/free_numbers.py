"""`FreeNumbers`: which numbers a fit moves, in which order, in which units and within which bounds."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ....physics import Parameter
from ..recordings import SpindleLaw
from .hypothesis import CutHypothesis
from .measured_cut import MeasuredCut

Real = NDArray[np.float64]

TURN = 0.01
"""Unit of the spindle's angle in a fit, rad, at the middle or at the ends of the recording."""

FAR = 40.0
"""Bound of a coefficient's deviation, in a laboratory's standard deviations."""


@dataclass(frozen=True)
class FreeNumbers:
    """Coordinates of a fit: deviations of coefficients, numbers of freed causes, and three of each spindle law.

    Parameters
    ----------
    cut
        Recordings of the cut.
    start
        Hypothesis to begin with; what is not free stays as it is there.
    freed
        Names of the causes whose numbers are free.
    refit
        Whether the coefficients are free.
    """

    cut: MeasuredCut
    start: CutHypothesis
    freed: tuple[str, ...]
    refit: bool

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the freed causes, one after the other."""
        process = self.cut.belief.process
        return tuple(one for name in self.freed for one in self.start.cause(name).parameters(process))

    @property
    def coefficients(self) -> int:
        """Number of deviations that are free: 6 or 0."""
        return 6 if self.refit else 0

    @property
    def physical(self) -> int:
        """Number of coordinates that are not the spindle's; they come first."""
        return self.coefficients + len(self.parameters)

    @cached_property
    def bounds(self) -> tuple[Real, Real]:
        """Lowest and highest coordinates, (n,) each."""
        steps = np.array([one.unit_step for one in self.parameters])
        spindle = np.full(3 * len(self.start.laws), np.inf)
        lowest = self.cut.belief.lowest[: self.coefficients]
        low = np.array([one.low for one in self.parameters]) / steps
        high = np.array([one.high for one in self.parameters]) / steps
        return (
            np.concatenate([lowest, low, -spindle]),
            np.concatenate([np.full(self.coefficients, FAR), high, spindle]),
        )

    @cached_property
    def begin(self) -> Real:
        """Coordinates of the hypothesis to begin with, within the bounds, (n,)."""
        values = [float(value) for name in self.freed for value in self.start.values(name)]
        fitted = [one.to_fit(value) for one, value in zip(self.parameters, values, strict=True)]
        spindle = np.zeros(3 * len(self.start.laws))
        parts = [self.start.deviations[: self.coefficients], np.array(fitted), spindle]
        return np.asarray(np.clip(np.concatenate(parts), *self.bounds))

    def hypothesis(self, coordinates: Real) -> CutHypothesis:
        """The hypothesis at a point.

        Parameters
        ----------
        coordinates : (n,)
            Coordinates of the point.
        """
        found = replace(self.start, deviations=coordinates[:6]) if self.refit else self.start
        numbers = coordinates[self.coefficients : self.physical]
        values = [one.from_fit(float(x)) for one, x in zip(self.parameters, numbers, strict=True)]
        for name in self.freed:
            count = len(self.start.values(name))
            found, values = found.with_values(name, np.array(values[:count])), values[count:]
        turns = coordinates[self.physical :].reshape(-1, 3) * self._spindle_units
        laws = [
            SpindleLaw(law.middle, law.angle + float(by[0]), law.speed + float(by[1]), law.change + float(by[2]))
            for law, by in zip(self.start.laws, turns, strict=True)
        ]
        return replace(found, laws=tuple(laws))

    def covariance(self, matrix: Real) -> Real:
        """Covariance of deviations, then of the causes' numbers in SI, the spindle's angle taken into account.

        Parameters
        ----------
        matrix : (n, n)
            Normal matrix of the coordinates.
        """
        spread = np.linalg.pinv(matrix, hermitian=True)[: self.physical, : self.physical]
        units = np.array([1.0] * self.coefficients + [one.unit_step for one in self.parameters])
        return np.asarray(spread * np.outer(units, units), dtype=np.float64)

    @cached_property
    def _spindle_units(self) -> Real:
        """Units of angle, speed and its change in each recording, (n_recordings, 3)."""
        spans = [len(one.recording.force) / one.recording.rate / 2 for one in self.cut.spectra]
        return np.array([[TURN, TURN / span, 2 * TURN / span**2] for span in spans])
