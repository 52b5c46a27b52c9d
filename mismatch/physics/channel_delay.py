"""Accelerations that come later than forces by a fixed time."""

import numpy as np
from numpy.typing import NDArray

from modal_fit import ModalModel

from .protocol import Chain, Parameter

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


class ChannelDelay:
    """The response channels pass a longer filter, or another converter, than the forces."""

    name = "channel_delay"
    equation = "y_measured(t) = y(t - tau)"
    source = "Bendat & Piersol, Random Data, 4th ed., section 6.1.3"
    parameters = (Parameter("delay_s", "s", 1e-4, -0.1, 0.1),)
    confusable_with = (
        "ac_coupling",
        "dynamometer_dynamics",
    )

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return one place: the whole measuring chain."""
        return ("",)

    def start(self, model: ModalModel) -> Real:
        """Return the numbers at which the cause is absent."""
        return np.array([0.0])

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        """Return the matrices of the cause at ``s`` (n,), rad/s."""
        late = np.exp(-s * values[0])
        return Chain(response=late[:, None, None] * np.eye(len(model.responses)))


PHYSICS = ChannelDelay()
