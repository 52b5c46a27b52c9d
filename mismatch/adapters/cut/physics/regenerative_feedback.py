"""Regenerative feedback: the chip carries the tip's displacement now less that of the tooth before."""

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess

from ....physics import Parameter
from .protocol import CutPhysics, ToothView

Real = NDArray[np.float64]


class RegenerativeFeedback(CutPhysics):
    """``h += mu (u(t) - u(t - tau))``, ``u = (x sin(phi) + y cos(phi)) sin(gamma) - z cos(gamma)``; theory: mu = 1.

    A motion that repeats from tooth to tooth cancels: a perfectly steady cut without runout says nothing of mu.
    """

    name = "regenerative_feedback"
    equation = "h += mu [(dx sin(phi) + dy cos(phi)) sin(gamma) - dz cos(gamma)], d(t) = x(t) - x(t - tau)"
    source = "Mohammadi & Ahmadi, Eqs. 1 and 4; Altintas, Manufacturing Automation, 2nd ed., section 4.2"
    moves = True

    def parameters(self, process: MillingProcess) -> tuple[Parameter, ...]:
        """The share mu of the feedback that theory expects."""
        return (Parameter("share", "", 0.1, 0.0, 3.0),)

    def advance(self, values: Real, tooth: ToothView, earlier: int) -> Real:
        """The displacement when the edge stood there."""
        return np.asarray(values[0] * tooth.outward[earlier])


PHYSICS = RegenerativeFeedback()
