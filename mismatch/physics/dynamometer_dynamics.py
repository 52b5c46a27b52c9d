"""Force channels that pass through the resonance of the dynamometer."""

import numpy as np
from numpy.typing import NDArray

from modal_fit import ModalModel

from .protocol import Chain, Parameter, resonance_of

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


class DynamometerDynamics:
    """The dynamometer shows the force through its own mass and spring; near its resonance it shows too much."""

    name = "dynamometer_dynamics"
    equation = "F_measured = F / (1 + 2 zeta s / w_n + (s / w_n)^2)"
    source = "Korkmaz, Gozen, Bediz & Ozdoganlar 2015, Precision Engineering 39"
    parameters = (
        Parameter("squared_period_s2", "s^2", 2e-7, 0.0, 1e-3),
        Parameter("damping_time_s", "s", 2e-5, -1e-2, 1e-2),
    )
    drives = ("force", "moment")
    confusable_with = ("channel_delay",)

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return one place: the whole measuring chain."""
        return ("",)

    def start(self, model: ModalModel) -> Real:
        """Return the numbers at which the cause is absent."""
        return np.array([0.0, 0.0])

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        """Return the matrices of the cause at ``s`` (n,), rad/s."""
        whole = 1 + values[1] * s + values[0] * s**2
        return Chain(force=whole[:, None, None] * np.eye(len(model.excitations)))

    def derived(self, values: Real) -> dict[str, float]:
        """Return the resonance, Hz, and the damping ratio."""
        return resonance_of(float(values[0]), float(values[1]))

    def impossible(self, values: Real, margin: Real) -> str:
        """Say why these numbers are impossible by more than their margins of error; empty where they are possible."""
        if values[0] <= 0 or values[1] >= -margin[1]:
            return ""
        return f"a dynamometer cannot have a damping ratio of {self.derived(values)['damping_ratio']:.3g}"


PHYSICS = DynamometerDynamics()
