"""Causes of a wrong cutting force: runout, process damping, regenerative feedback."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Real
from millfrf.cutting import MillingProcess

from ..physics.protocol import Parameter


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


class ProcessDamping(CutPhysics):
    """``F = -C (v_n / V) n`` per metre of depth: v_n the speed along the normal n, V the cutting speed."""

    name = "process_damping"
    equation = "F += -a C (v_n / V) n"
    source = "Tyler & Schmitz, Precision Engineering 37, 2013, Eq. 1"
    moves = True

    def parameters(self, process: MillingProcess) -> tuple[Parameter, ...]:
        """The coefficient C as the only number."""
        return (Parameter("coefficient_n_per_m", "N/m", 1e4, 0.0),)

    def stated(self, process: MillingProcess) -> Real:
        """The coefficient C that the cutting file states, (1,), N/m."""
        return np.array([process.process_damping])

    def force(self, values: Real, tooth: ToothView) -> Real:
        """Force against the tip's velocity along the normal, (m, 3), N per metre of depth."""
        return np.asarray((-values[0] * tooth.velocity / tooth.cutting_speed)[:, None] * tooth.normal)

    def improved(self, process: MillingProcess, values: Real) -> MillingProcess:
        """The cutting file's process with this coefficient."""
        return replace(process, process_damping=float(values[0]))


PROCESS_DAMPING = ProcessDamping()


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


REGENERATIVE_FEEDBACK = RegenerativeFeedback()


class Runout(CutPhysics):
    """``rho_j = r cos(2 pi j / N - lambda)``: tooth j runs large (Altintas, Manufacturing Automation, 2nd ed., 4.8).

    Fitted as ``p = r cos(lambda)`` and ``q = r sin(lambda)``, in which the force is smooth where there is none. Two
    teeth show ``p`` alone. Which tooth is tooth 0 is free in a recording; ``lambda`` is told from the tooth that
    stands out furthest, so that it lies within half a pitch of zero.
    """

    name = "runout"
    equation = "h_j += (rho_j - rho_(j+1)) sin(gamma), rho_j = r cos(2 pi j / N - lambda)"
    source = "Altintas, Manufacturing Automation, 2nd ed., section 4.8; Kline & DeVor, Int. J. MTDR 23, 1983"

    def obstacle(self, process: MillingProcess) -> str:
        """One tooth follows itself: runout is then only a larger diameter."""
        return "one tooth alone shows none" if process.teeth < 2 else ""

    def parameters(self, process: MillingProcess) -> tuple[Parameter, ...]:
        """The offset of the axis along and across the direction of tooth 0."""
        both = (Parameter("offset_along_m", "m", 1e-6), Parameter("offset_across_m", "m", 1e-6))
        return both[:1] if process.teeth <= 2 else both

    def stated(self, process: MillingProcess) -> Real:
        """The runout that the cutting file states, m; it is largest at tooth 0."""
        values = np.zeros(len(self.parameters(process)))
        values[0] = process.runout
        return values

    def advance(self, values: Real, tooth: ToothView, earlier: int) -> float:
        """How far the edge of tooth j + k stands out, ``rho_(j+k) sin(gamma)``, m."""
        angle = 2 * np.pi * (tooth.number + earlier) / tooth.teeth
        across = float(values[1]) if len(values) > 1 else 0.0
        return float(values[0] * np.cos(angle) + across * np.sin(angle)) * tooth.sine_edge

    def told(
        self, values: Real, covariance: Real, process: MillingProcess
    ) -> tuple[dict[str, float], dict[str, float]]:
        """Radius r, and the angle lambda where more than two teeth show it."""
        if len(values) == 1:
            size = {"radial_offset_m": abs(float(values[0]))}
            return size, {"radial_offset_m": float(np.sqrt(covariance[0, 0]))}
        radius = max(float(np.hypot(*values)), 1e-300)
        pitch = 2 * np.pi / process.teeth
        angle = float(np.mod(np.arctan2(values[1], values[0]) + pitch / 2, pitch) - pitch / 2)
        along = np.asarray(values) / radius
        across = np.array([-along[1], along[0]]) / radius
        errors = [float(np.sqrt(row @ covariance @ row)) for row in (along, across)]
        names = ("radial_offset_m", "angle_rad")
        return dict(zip(names, (radius, angle), strict=True)), dict(zip(names, errors, strict=True))

    def improved(self, process: MillingProcess, values: Real) -> MillingProcess:
        """The cutting file's process with this radius; the file's convention sets the angle to zero."""
        return replace(process, runout=float(np.hypot(values[0], values[1] if len(values) > 1 else 0.0)))


RUNOUT = Runout()
