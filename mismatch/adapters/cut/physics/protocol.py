"""What a hypothesis about left-out cutting physics has to say: `CutPhysics`, and the `ToothView` that it is given."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess

from ....physics import Parameter

Real = NDArray[np.float64]


@dataclass(frozen=True)
class ToothView:
    """One tooth at the instants at which it is in the cut.

    Parameters
    ----------
    number, teeth
        Of the tooth, and how many there are.
    index : (m,)
        Which instants of the recording.
    sine, cosine : (m,)
        Of the immersion angle phi.
    sine_edge, cosine_edge
        Of the edge angle gamma.
    share : (m,)
        Of the instant's step that lies in the immersion, 0 to 1.
    outward : (n_earlier + 1, m), m
        The tip's displacement along the direction in which chip thickness is counted: now, and when the tool stood at
        the same angle one, two ... tooth passings earlier. Zero where no motion is known.
    velocity : (m,), m/s
        Of the same, now.
    cutting_speed : (m,), m/s
        Of the edge.
    """

    number: int
    teeth: int
    index: NDArray[np.int64]
    sine: Real
    cosine: Real
    sine_edge: float
    cosine_edge: float
    share: Real
    outward: Real
    velocity: Real
    cutting_speed: Real

    @property
    def normal(self) -> Real:
        """Direction in which chip thickness is counted, (m, 3)."""
        along = np.full_like(self.sine, -self.cosine_edge)
        return np.stack([self.sine * self.sine_edge, self.cosine * self.sine_edge, along], axis=-1)


class CutPhysics(ABC):
    """A cause: a subclass says what it adds to the chip or to the force; what it leaves as it is adds nothing.

    Attributes
    ----------
    name, equation, source
        For people.
    moves
        Whether it lives on the tip's motion, which must then be known.
    """

    name = ""
    equation = ""
    source = ""
    moves = False

    def obstacle(self, process: MillingProcess) -> str:
        """Why it cannot be weighed for this cutter; empty where it can."""
        return ""

    @abstractmethod
    def parameters(self, process: MillingProcess) -> tuple[Parameter, ...]:
        """Its numbers, as they are fitted."""

    def stated(self, process: MillingProcess) -> Real:
        """The numbers that the cutting file states: what is computed before anything is blamed."""
        return np.zeros(len(self.parameters(process)))

    def advance(self, values: Real, tooth: ToothView, earlier: int) -> Real | float:
        """How much further out than a rigid true edge the edge stands, m, that cuts ``earlier`` passings ago.

        ``earlier`` 0 is the tooth itself, 1 the one before it in the cut; the chip is
        ``h = min_k (k f sin(phi) sin(gamma) + advance_0 - advance_k)``, not below zero.
        """
        return 0.0

    def force(self, values: Real, tooth: ToothView) -> Real | float:
        """Force on the tool beside shearing and edge, (m, 3), N per metre of depth, while a chip is cut."""
        return 0.0

    def told(
        self, values: Real, covariance: Real, process: MillingProcess
    ) -> tuple[dict[str, float], dict[str, float]]:
        """Numbers and standard errors by name, SI, as they stand in files."""
        names = [parameter.name for parameter in self.parameters(process)]
        errors = np.sqrt(np.diag(covariance))
        return (
            dict(zip(names, map(float, values), strict=True)),
            dict(zip(names, map(float, errors), strict=True)),
        )

    def improved(self, process: MillingProcess, values: Real) -> MillingProcess:
        """The cutting file's process with these numbers, where it has a place for them."""
        return process
