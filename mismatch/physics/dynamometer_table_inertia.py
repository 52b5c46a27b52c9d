"""Mass between force cell and structure: its inertia is measured as force, or is missing from it."""

import numpy as np
from numpy.typing import NDArray

from modal_fit import ModalModel

from .protocol import Chain, Parameter, axes_of

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


class DynamometerTableInertia:
    """A table, a holder or another tool moves with the structure, and the model does not have its mass."""

    name = "dynamometer_table_inertia"
    equation = "F = F_measured - m X''"
    source = "Ewins, Modal Testing, 2nd ed., section 3.7 (mass cancellation)"
    parameters = (Parameter("mass_kg", "kg", 0.05, -100.0, 100.0),)
    drives, acts_on_motion = ("force", "moment"), True
    confusable_with = ("modal_parameters",)

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return one place if every force has a response along its axis."""
        return ("",) if set(axes_of(model.excitations)) <= set(axes_of(model.responses)) else ()

    def start(self, model: ModalModel) -> Real:
        """Return the numbers at which the cause is absent."""
        return np.array([0.0])

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        """Return the matrices of the cause at ``s`` (n,), rad/s."""
        rows = axes_of(model.responses)
        moved = np.zeros((len(model.excitations), len(model.responses)))
        for column, axis in enumerate(axes_of(model.excitations)):
            moved[column, rows.index(axis)] = values[0]
        return Chain(feedback=s[:, None, None] ** 2 * moved)

    def impossible(self, values: Real, margin: Real) -> str:
        """Say why these numbers are impossible by more than their margins of error; empty where they are possible."""
        if values[0] >= -margin[0]:
            return ""
        return (
            f"a table cannot have a mass of {values[0]:.3g} {self.parameters[0].unit}; a tool lighter than the model's "
            "is other modes"
        )


PHYSICS = DynamometerTableInertia()
