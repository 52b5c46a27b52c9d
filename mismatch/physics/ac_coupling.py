"""Responses that pass a high-pass filter of one stage, or of two equal stages."""

import numpy as np
from numpy.typing import NDArray

from modal_fit import ModalModel

from .protocol import Chain, Parameter

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

TWO_STAGES = "two stages"


class AcCoupling:
    """An IEPE sensor or an amplifier with too high a corner frequency."""

    name = "ac_coupling"
    equation = "C(s) = (s / (s + 2 pi f_c))^n, n = 1 or 2 stages"
    source = "Ewins, Modal Testing, 2nd ed., section 3.5"
    parameters = (Parameter("corner_hz", "Hz", 0.05, 1e-3, 50.0, logarithmic=True),)
    confusable_with = ("channel_delay",)

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return the whole measuring chain, with one stage (sensor or amplifier) or two (both)."""
        return ("", TWO_STAGES)

    def start(self, model: ModalModel) -> Real:
        """Return a corner frequency so low that the high-pass is nearly absent, Hz."""
        return np.array([0.05])

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        """Return the matrices of the cause at ``s`` (n,), rad/s."""
        passed = (s / (s + 2 * np.pi * values[0])) ** (2 if place == TWO_STAGES else 1)
        return Chain(response=passed[:, None, None] * np.eye(len(model.responses)))

    def other_forms(self, values: Real, place: str) -> tuple[tuple[str, Real], ...]:
        """Return the other number of stages, with the corner that gives the same phase ``n f_c / f`` well above it."""
        return (("", 2 * values),) if place == TWO_STAGES else ((TWO_STAGES, values / 2),)


PHYSICS = AcCoupling()
