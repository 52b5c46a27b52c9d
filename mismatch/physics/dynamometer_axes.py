"""Force channels that pass through the dynamometer's resonances, one for each axis."""

import numpy as np
from numpy.typing import NDArray

from modal_fit import ModalModel

from .protocol import Chain, Parameter, axes_of, resonance_of

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


class DynamometerAxes:
    """A table with a workpiece rocks at other frequencies than it slides: each force axis has its own resonance."""

    name = "dynamometer_axes"
    answers_as = "dynamometer_dynamics"
    equation = "F_measured,q = F_q / (1 + c s + (s / w_q)^2), q = X, Y, Z"
    source = "Korkmaz, Gozen, Bediz & Ozdoganlar 2015, Precision Engineering 39"
    parameters = (
        Parameter("squared_period_x_s2", "s^2", 2e-7, 0.0, 1e-3),
        Parameter("squared_period_y_s2", "s^2", 2e-7, 0.0, 1e-3),
        Parameter("squared_period_z_s2", "s^2", 2e-7, 0.0, 1e-3),
        Parameter("damping_time_s", "s", 2e-5, -1e-2, 1e-2),
    )
    drives = ("force", "moment")
    confusable_with = ("channel_delay", "gain_error")

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return one place if forces along X, Y and Z are measured."""
        return ("",) if set(axes_of(model.excitations)) == set("XYZ") else ()

    def start(self, model: ModalModel) -> Real:
        """Return the numbers at which the cause is absent."""
        return np.zeros(4)

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        """Return the matrices of the cause at ``s`` (n,), rad/s."""
        squared = np.array([values["XYZ".index(axis)] for axis in axes_of(model.excitations)])
        own = 1 + values[3] * s[:, None] + squared * s[:, None] ** 2
        return Chain(force=own[:, :, None] * np.eye(len(squared)))

    def derived(self, values: Real) -> dict[str, float]:
        """Return the resonance, Hz, and the damping ratio of each axis."""
        found = {axis: resonance_of(float(values[k]), float(values[3])) for k, axis in enumerate("xyz")}
        return {f"{axis}_{name}": value for axis, one in found.items() for name, value in one.items()}

    def impossible(self, values: Real, margin: Real) -> str:
        """Say why these numbers are impossible by more than their margins of error; empty where they are possible."""
        if values[3] >= -margin[3]:
            return ""
        return f"a dynamometer cannot have a negative damping, {values[3]:.3g} s"


PHYSICS = DynamometerAxes()
