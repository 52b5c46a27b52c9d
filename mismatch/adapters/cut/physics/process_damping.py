"""Process damping: the flank rubs on the wave that the edge has just cut."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess

from ....physics import Parameter
from .protocol import CutPhysics, ToothView

Real = NDArray[np.float64]


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


PHYSICS = ProcessDamping()
