"""`CutPhysics`: what a cause of a wrong cutting force states about itself; `ToothView`: what it is given."""

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
        Number of the tooth, from 0, and how many teeth the cutter has.
    index : (m,)
        Instants of the recording at which the tooth cuts.
    sine, cosine : (m,)
        Sine and cosine of the immersion angle phi.
    sine_edge, cosine_edge
        Sine and cosine of the edge angle gamma.
    share : (m,)
        Share of the instant's step that lies in the immersion, 0 to 1.
    outward : (n_earlier + 1, m), m
        The tip's displacement along the direction in which chip thickness is counted: now, and when the tool stood at
        the same angle one, two ... tooth passings earlier. It is zero where no motion is known.
    velocity : (m,), m/s
        The tip's velocity along the same direction, now.
    cutting_speed : (m,), m/s
        Speed of the edge along its path.
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
        Name in files, the equation that it adds, and where the equation is published.
    moves
        Whether it depends on the tip's motion, which must then be known.
    """

    name = ""
    equation = ""
    source = ""
    moves = False

    def obstacle(self, process: MillingProcess) -> str:
        """Why it cannot be weighed for this cutter; empty where it can.

        Parameters
        ----------
        process
            The cutting file's process.
        """
        return ""

    @abstractmethod
    def parameters(self, process: MillingProcess) -> tuple[Parameter, ...]:
        """The numbers of the cause, as they are fitted.

        Parameters
        ----------
        process
            The cutting file's process.
        """

    def stated(self, process: MillingProcess) -> Real:
        """The numbers that the cutting file states: what is computed before any cause is named, (n_numbers,), SI.

        Parameters
        ----------
        process
            The cutting file's process.
        """
        return np.zeros(len(self.parameters(process)))

    def advance(self, values: Real, tooth: ToothView, earlier: int) -> Real | float:
        """How far an edge stands out of the edge of a rigid cutter that runs true, (m,), m.

        The chip is ``h = min_k (k f sin(phi) sin(gamma) + advance_0 - advance_k)``, not below zero.

        Parameters
        ----------
        values : (n_numbers,)
            The cause's numbers, SI.
        tooth
            The tooth that cuts now.
        earlier
            Which edge: 0 is the tooth itself, ``k`` the tooth that stood at the same angle ``k`` passings ago.
        """
        return 0.0

    def force(self, values: Real, tooth: ToothView) -> Real | float:
        """Force on the tool beside shearing and edge, (m, 3), N per metre of depth, while a chip is cut.

        Parameters
        ----------
        values : (n_numbers,)
            The cause's numbers, SI.
        tooth
            The tooth that cuts.
        """
        return 0.0

    def told(
        self, values: Real, covariance: Real, process: MillingProcess
    ) -> tuple[dict[str, float], dict[str, float]]:
        """Numbers and standard errors by name, SI, as they stand in files.

        Parameters
        ----------
        values : (n_numbers,)
            The cause's numbers, SI.
        covariance : (n_numbers, n_numbers)
            Covariance of these numbers, SI.
        process
            The cutting file's process.
        """
        names = [parameter.name for parameter in self.parameters(process)]
        errors = np.sqrt(np.diag(covariance))
        return (
            dict(zip(names, map(float, values), strict=True)),
            dict(zip(names, map(float, errors), strict=True)),
        )

    def improved(self, process: MillingProcess, values: Real) -> MillingProcess:
        """The cutting file's process with these numbers, where it has a place for them.

        Parameters
        ----------
        process
            The process so far.
        values : (n_numbers,)
            The cause's numbers, SI.
        """
        return process
