"""A damper that acts on part of the structure: it couples the modes that proportional damping keeps apart."""

import numpy as np
from numpy.typing import NDArray

from modal_fit import ModalModel

from .protocol import Chain, Parameter, axes_of

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

PLACES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


class NonProportionalDamping:
    """Joints or the cut damp the tool's motion by a symmetric matrix that the model's modal damping does not hold."""

    name = "non_proportional_damping"
    equation = "F = F_outer - C X', C = C^T"
    source = "Caughey & O'Kelly, J. Applied Mechanics 32, 1965; Meirovitch, Fundamentals of Vibrations, section 7.15"
    parameters = tuple(Parameter(f"damping_{'xyz'[i]}{'xyz'[j]}_ns_per_m", "N s/m", 20.0, -1e6, 1e6) for i, j in PLACES)
    acts_on_motion = True
    confusable_with = ("modal_parameters",)

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return one place if forces and responses both have X, Y and Z once."""
        return ("",) if all(sorted(axes_of(labels)) == ["X", "Y", "Z"] for labels in _sides(model)) else ()

    def start(self, model: ModalModel) -> Real:
        """Return the numbers at which the cause is absent."""
        return np.zeros(len(PLACES))

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        """Return the matrices of the cause at ``s`` (n,), rad/s."""
        damping = _matrix(values)
        columns, rows = (["XYZ".index(axis) for axis in axes_of(labels)] for labels in _sides(model))
        return Chain(feedback=s[:, None, None] * damping[np.ix_(columns, rows)])

    def impossible(self, values: Real, margin: Real) -> str:
        """Say why these numbers are impossible by more than their margins of error; empty where they are possible.

        A damper only takes energy: along no direction d may ``d^T C d`` be negative.
        """
        lowest, directions = np.linalg.eigh(_matrix(values))
        weights = _weights(directions[:, 0])
        if lowest[0] >= -float(np.linalg.norm(weights * margin)):
            return ""
        return (
            f"a damper that gives energy ({lowest[0]:.3g} N s/m along one direction); less damping than the model's is "
            "a matter of its modes"
        )


def _matrix(values: Real) -> Real:
    """The symmetric matrix C, (3, 3), of its six numbers."""
    damping = np.zeros((3, 3))
    for value, (i, j) in zip(values, PLACES, strict=True):
        damping[i, j] = damping[j, i] = value
    return damping


def _weights(direction: Real) -> Real:
    """Change of ``d^T C d`` with each of the six numbers, (6,)."""
    return np.array([direction[i] * direction[j] * (1 if i == j else 2) for i, j in PLACES])


def _sides(model: ModalModel) -> tuple[tuple[str, ...], tuple[str, ...]]:
    return model.excitations, model.responses


PHYSICS = NonProportionalDamping()
