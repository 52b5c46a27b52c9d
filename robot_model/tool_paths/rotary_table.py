"""A rotary table that carries the work: the second redundancy of a robot cell."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from foundation import InputError

from ..machining import CutPlace

Real = NDArray[np.float64]


@dataclass(frozen=True)
class RotaryTable:
    """Axis about which work, cut and tool turn together.

    Where the axis runs through the tip along the feed, the tip rests and the attitude alone turns: the second
    redundancy of Mousavi et al. (Fig. 10, theta_X7 = theta_Xw). Elsewhere the tip moves on a circle.

    Parameters
    ----------
    point : (3,), m
        A point of the axis in the base frame.
    direction : (3,)
        Direction of the axis; any length.

    Raises
    ------
    InputError
        A direction without length.
    """

    point: Real
    direction: Real

    def __post_init__(self) -> None:
        if not np.linalg.norm(self.direction) > 1e-9:
            raise InputError(f"the table's axis {list(self.direction)} has no direction; give for example 1 0 0")

    def turned(self, place: CutPlace, angle: float) -> CutPlace:
        """The place after the table turned by ``angle``, rad."""
        if angle == 0.0:
            return place
        axis = np.asarray(self.direction) / np.linalg.norm(self.direction)
        turn = Rotation.from_rotvec(angle * axis).as_matrix()
        position = self.point + turn @ (place.position - self.point)
        return CutPlace(position, turn @ place.attitude, turn @ place.axes)
