"""`CutHypothesis`: one set of numbers from which the cutting force is computed."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..physics import CutPhysics
from ..recordings import SpindleLaw

Real = NDArray[np.float64]


@dataclass(frozen=True)
class CutHypothesis:
    """Coefficients, causes and the spindle's angle.

    Parameters
    ----------
    deviations : (6,)
        Deviations of the coefficients from the cutting file, in a laboratory's standard deviations.
    acting
        Every cause with its numbers (n_numbers,) in SI; causes that are not fitted keep those of the cutting file.
    laws
        Spindle law of each recording.
    """

    deviations: Real
    acting: tuple[tuple[CutPhysics, Real], ...]
    laws: tuple[SpindleLaw, ...]

    def cause(self, name: str) -> CutPhysics:
        """A cause by its name.

        Parameters
        ----------
        name
            Name of the cause.
        """
        return next(cause for cause, _ in self.acting if cause.name == name)

    def values(self, name: str) -> Real:
        """Numbers of one cause, (n_numbers,), SI.

        Parameters
        ----------
        name
            Name of the cause.
        """
        return next(values for cause, values in self.acting if cause.name == name)

    def with_values(self, name: str, values: Real) -> "CutHypothesis":
        """The same hypothesis with other numbers of one cause.

        Parameters
        ----------
        name
            Name of the cause.
        values : (n_numbers,)
            New numbers of the cause, SI.
        """
        return replace(self, acting=tuple((one, values if one.name == name else old) for one, old in self.acting))

    def with_angle(self, number: int, angle: float) -> "CutHypothesis":
        """The same hypothesis with another spindle angle in one recording.

        Parameters
        ----------
        number
            Number of the recording, from 0.
        angle
            Angle of tooth 0 at the middle of the recording, rad.
        """
        laws = [replace(law, angle=angle) if k == number else law for k, law in enumerate(self.laws)]
        return replace(self, laws=tuple(laws))
