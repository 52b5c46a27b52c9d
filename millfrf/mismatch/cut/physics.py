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
    """One tooth at the instants at which it is in the cut."""

    # number of the tooth, from 0, and number of teeth of the cutter
    number: int
    teeth: int
    index: NDArray[np.int64]  # instants of the recording at which the tooth cuts, (m,)
    # sine and cosine of the immersion angle phi, (m,)
    sine: Real
    cosine: Real
    sine_edge: float
    cosine_edge: float
    share: Real  # share of the instant's step that lies in the immersion, 0 to 1, (m,)
    # displacement of the tip along the direction of the chip thickness, m: at the instants, and one, two ... tooth
    # passings earlier, when a tooth was at the same angle; zero without known motion, (n_earlier + 1, m)
    outward: Real
    velocity: Real  # velocity of the tip along this direction at the instants, (m,), m/s
    cutting_speed: Real  # speed of the edge along its path, (m,), m/s

    @property
    def normal(self) -> Real:
        """Direction of the chip thickness, (m, 3)."""
        along = np.full_like(self.sine, -self.cosine_edge)
        return np.stack([self.sine * self.sine_edge, self.cosine * self.sine_edge, along], axis=-1)


class CutPhysics(ABC):
    """Base class of a cause: its methods return additions to the chip thickness or the force, by default zero.

    Attributes
    ----------
    name, equation, source
        Name in files, the equation that it adds, and where the equation is published.
    moves
        Whether the cause depends on the tip's motion, which must then be known.
    """

    name = ""
    equation = ""
    source = ""
    moves = False

    def obstacle(self, process: MillingProcess) -> str:
        """Return why the cause cannot be compared for this cutter; an empty text if it can."""
        return ""

    @abstractmethod
    def parameters(self, process: MillingProcess) -> tuple[Parameter, ...]:
        """Return the parameters of the cause."""

    def stated(self, process: MillingProcess) -> Real:
        """Return the numbers of the cutting file, (n_numbers,), SI."""
        return np.zeros(len(self.parameters(process)))

    def advance(self, values: Real, tooth: ToothView, earlier: int) -> Real | float:
        """Return the displacement of an edge relative to a rigid cutter without runout, (m,), m.

        The chip thickness is ``h = min_k (k f sin(phi) sin(gamma) + advance_0 - advance_k)``, at least zero.
        ``earlier`` is 0 for the tooth itself, and ``k`` for the tooth that was at the same angle ``k`` passings ago.
        """
        return 0.0

    def force(self, values: Real, tooth: ToothView) -> Real | float:
        """Return an additional force on the tool while a chip is cut, (m, 3), N per metre of depth."""
        return 0.0

    def named_numbers(
        self, values: Real, covariance: Real, process: MillingProcess
    ) -> tuple[dict[str, float], dict[str, float]]:
        """Return numbers and standard errors, SI, by their names in files."""
        names = [parameter.name for parameter in self.parameters(process)]
        errors = np.sqrt(np.diag(covariance))
        return (
            dict(zip(names, map(float, values), strict=True)),
            dict(zip(names, map(float, errors), strict=True)),
        )

    def improved(self, process: MillingProcess, values: Real) -> MillingProcess:
        """Return the process of the cutting file with these numbers, if it has a field for them."""
        return process


class ProcessDamping(CutPhysics):
    """``F = -C (v_n / V) n`` per metre of depth, with the tip velocity v_n along the normal n, and cutting speed V."""

    name = "process_damping"
    equation = "F += -a C (v_n / V) n"
    source = "Tyler & Schmitz, Precision Engineering 37, 2013, Eq. 1"
    moves = True

    def parameters(self, process: MillingProcess) -> tuple[Parameter, ...]:
        """Return the coefficient C as the only parameter."""
        return (Parameter("coefficient_n_per_m", "N/m", 1e4, 0.0),)

    def stated(self, process: MillingProcess) -> Real:
        """Return the coefficient C of the cutting file, (1,), N/m."""
        return np.array([process.process_damping])

    def force(self, values: Real, tooth: ToothView) -> Real:
        """Return the force against the velocity of the tip along the normal, (m, 3), N per metre of depth."""
        return np.asarray((-values[0] * tooth.velocity / tooth.cutting_speed)[:, None] * tooth.normal)

    def improved(self, process: MillingProcess, values: Real) -> MillingProcess:
        """Return the process of the cutting file with this coefficient."""
        return replace(process, process_damping=float(values[0]))


PROCESS_DAMPING = ProcessDamping()


class RegenerativeFeedback(CutPhysics):
    """``h += mu (u(t) - u(t - tau))``, ``u = (x sin(phi) + y cos(phi)) sin(gamma) - z cos(gamma)``; theory: mu = 1.

    A motion that repeats from tooth to tooth cancels: a perfectly steady cut without runout does not determine mu.
    """

    name = "regenerative_feedback"
    equation = "h += mu [(dx sin(phi) + dy cos(phi)) sin(gamma) - dz cos(gamma)], d(t) = x(t) - x(t - tau)"
    source = "Mohammadi & Ahmadi, Eqs. 1 and 4; Altintas, Manufacturing Automation, 2nd ed., section 4.2"
    moves = True

    def parameters(self, process: MillingProcess) -> tuple[Parameter, ...]:
        """Return the share mu of the theoretical feedback."""
        return (Parameter("share", "", 0.1, 0.0, 3.0),)

    def advance(self, values: Real, tooth: ToothView, earlier: int) -> Real:
        """Return mu times the displacement of the tip ``earlier`` tooth passings ago, (m,), m."""
        return np.asarray(values[0] * tooth.outward[earlier])


REGENERATIVE_FEEDBACK = RegenerativeFeedback()


class Runout(CutPhysics):
    """``rho_j = r cos(2 pi j / N - lambda)``: radius error of tooth j.

    Source: Altintas, Manufacturing Automation, 2nd ed., 4.8. The fitted numbers are ``p = r cos(lambda)`` and ``q = r
    sin(lambda)``, on which the force depends smoothly even at zero runout. With two teeth only ``p`` is determined. The
    choice of tooth 0 is arbitrary in a recording; ``lambda`` is reported relative to the tooth with the largest radius,
    and therefore within half a pitch of zero.
    """

    name = "runout"
    equation = "h_j += (rho_j - rho_(j+1)) sin(gamma), rho_j = r cos(2 pi j / N - lambda)"
    source = "Altintas, Manufacturing Automation, 2nd ed., section 4.8; Kline & DeVor, Int. J. MTDR 23, 1983"

    def obstacle(self, process: MillingProcess) -> str:
        """Return a reason for a single tooth, whose runout is only a larger diameter."""
        return "one tooth alone shows none" if process.teeth < 2 else ""

    def parameters(self, process: MillingProcess) -> tuple[Parameter, ...]:
        """Return the offset of the axis along and across the direction of tooth 0."""
        offsets = (Parameter("offset_along_m", "m", 1e-6), Parameter("offset_across_m", "m", 1e-6))
        return offsets[:1] if process.teeth <= 2 else offsets

    def stated(self, process: MillingProcess) -> Real:
        """Return the runout of the cutting file, m; it is largest at tooth 0."""
        values = np.zeros(len(self.parameters(process)))
        values[0] = process.runout
        return values

    def advance(self, values: Real, tooth: ToothView, earlier: int) -> float:
        """Return the displacement of the edge of tooth j + k, ``rho_(j+k) sin(gamma)``, m."""
        angle = 2 * np.pi * (tooth.number + earlier) / tooth.teeth
        across = float(values[1]) if len(values) > 1 else 0.0
        return float(values[0] * np.cos(angle) + across * np.sin(angle)) * tooth.sine_edge

    def named_numbers(
        self, values: Real, covariance: Real, process: MillingProcess
    ) -> tuple[dict[str, float], dict[str, float]]:
        """Return the radius r, and the angle lambda for more than two teeth."""
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
        """Return the process of the cutting file with this radius; its convention sets the angle to zero."""
        return replace(process, runout=float(np.hypot(values[0], values[1] if len(values) > 1 else 0.0)))


RUNOUT = Runout()

# all causes of the library; a new one is added here
CAUSES: tuple[CutPhysics, ...] = (PROCESS_DAMPING, REGENERATIVE_FEEDBACK, RUNOUT)


def cut_library() -> dict[str, CutPhysics]:
    """Return all causes of a cut by name.

    >>> sorted(cut_library())
    ['process_damping', 'regenerative_feedback', 'runout']
    """
    return {cause.name: cause for cause in CAUSES}
