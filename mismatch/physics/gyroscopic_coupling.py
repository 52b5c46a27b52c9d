"""Velocity coupling of two coordinates with opposite signs: a spinning rotor."""

import numpy as np
from numpy.typing import NDArray

from modal_fit import ModalModel

from .protocol import Chain, Parameter, axes_of

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


class GyroscopicCoupling:
    """The angular momentum of spindle or tool couples motions across its axis."""

    name = "gyroscopic_coupling"
    equation = "F = F_outer - [n]x X', [n]x antisymmetric"
    source = "Meirovitch, Fundamentals of Vibrations, section 4.7"
    parameters = (
        Parameter("coupling_x_ns_per_m", "N s/m", 20.0),
        Parameter("coupling_y_ns_per_m", "N s/m", 20.0),
        Parameter("coupling_z_ns_per_m", "N s/m", 20.0),
    )
    acts_on_motion = True
    confusable_with = ("modal_parameters",)

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return the columns and rows that are X, Y, Z; none without both triads."""
        return _triads(model)

    def start(self, model: ModalModel) -> Real:
        """Return the numbers at which the cause is absent."""
        return np.array([0.0, 0.0, 0.0])

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        """Return the matrices of the cause at ``s`` (n,), rad/s."""
        columns = [int(text) for text in place.split("|")[0].split()]
        rows = [int(text) for text in place.split("|")[1].split()]
        x, y, z = values
        cross = np.zeros((len(model.excitations), len(model.responses)))
        cross[np.ix_(columns, rows)] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
        return Chain(feedback=s[:, None, None] * cross)


def _triads(model: ModalModel) -> tuple[str, ...]:
    found = []
    for labels in (model.excitations, model.responses):
        axes = axes_of(labels)
        if any(axes.count(axis) != 1 for axis in "XYZ"):
            return ()
        found.append(" ".join(str(axes.index(axis)) for axis in "XYZ"))
    return ("|".join(found),)


PHYSICS = GyroscopicCoupling()
