"""One channel with a wrong sensitivity."""

import numpy as np
from numpy.typing import NDArray

from modal_fit import ModalModel

from .protocol import Chain, Parameter

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


class GainError:
    """A sensitivity mistyped, a cable changed, a range switched: the channel shows a multiple of the truth."""

    name = "gain_error"
    equation = "measured = (1 + e) true, of one channel"
    source = "ISO 16063-21, comparison calibration of vibration transducers"
    parameters = (Parameter("gain_minus_one", "", 0.01, -0.95, 20.0),)
    confusable_with = (
        "modal_parameters",
        "axis_misalignment",
    )

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return each channel by its degree of freedom."""
        return (*(f"response {name}" for name in model.responses), *(f"force {name}" for name in model.excitations))

    def start(self, model: ModalModel) -> Real:
        """Return the numbers at which the cause is absent."""
        return np.array([0.0])

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        """Return the matrices of the cause at ``s`` (n,), rad/s."""
        kind, label = place.split(" ", 1)
        if kind == "response":
            gains = np.where(np.array(model.responses) == label, 1 + values[0], 1.0)
            return Chain(response=np.tile(np.diag(gains).astype(complex), (len(s), 1, 1)))
        gains = np.where(np.array(model.excitations) == label, 1 / (1 + values[0]), 1.0)
        return Chain(force=np.tile(np.diag(gains).astype(complex), (len(s), 1, 1)))


PHYSICS = GainError()
