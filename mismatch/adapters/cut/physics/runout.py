"""Runout: the spindle turns about another axis than the cutter's, so that teeth cut unequal chips."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess

from ....physics import Parameter
from .protocol import CutPhysics, ToothView

Real = NDArray[np.float64]


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


PHYSICS = Runout()
