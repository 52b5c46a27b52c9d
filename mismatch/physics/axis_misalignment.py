"""Force axes rotated against the axes of the responses."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from foundation import DegreeOfFreedom
from modal_fit import ModalModel

from .protocol import Chain, Parameter

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


class AxisMisalignment:
    """The dynamometer stands askew on the table, or the accelerometer on the housing."""

    name = "axis_misalignment"
    equation = "F = R(r) F_measured, R the rotation by the vector r"
    source = "Rodrigues 1840; Goldstein, Classical Mechanics, section 4.7"
    parameters = (
        Parameter("rotation_x_rad", "rad", 0.01, -1.0, 1.0),
        Parameter("rotation_y_rad", "rad", 0.01, -1.0, 1.0),
        Parameter("rotation_z_rad", "rad", 0.01, -1.0, 1.0),
    )
    drives = ("force", "moment", "acceleration")
    confusable_with = (
        "modal_parameters",
        "gain_error",
    )

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return the three columns that are X, Y, Z of one node; none without such a triad."""
        return _triad(model)

    def start(self, model: ModalModel) -> Real:
        """Return the numbers at which the cause is absent."""
        return np.array([0.0, 0.0, 0.0])

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        """Return the matrices of the cause at ``s`` (n,), rad/s."""
        columns = [int(place) for place in place.split()]
        rotation = np.eye(len(model.excitations))
        rotation[np.ix_(columns, columns)] = Rotation.from_rotvec(values).as_matrix()
        return Chain(force=np.tile(rotation.astype(complex), (len(s), 1, 1)))


def _triad(model: ModalModel) -> tuple[str, ...]:
    axes = [DegreeOfFreedom.parse(label).axis for label in model.excitations]
    if any(axes.count(axis) != 1 for axis in "XYZ"):
        return ()
    return (" ".join(str(axes.index(axis)) for axis in "XYZ"),)


PHYSICS = AxisMisalignment()
