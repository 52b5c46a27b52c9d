"""`RobotUncertainty`: which numbers of a robot were updated, by how much, and with which covariance."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from ..full_update import UpdateParameter


@dataclass(frozen=True)
class RobotUncertainty:
    """Numbers that an update changed in a robot's file, with the covariance of what is still unknown.

    Parameters
    ----------
    parameters
        Numbers that were freed.
    values : (n_parameters,)
        Differences that are in the file already, from the file before.
    covariance : (n_parameters, n_parameters)
        Covariance of these differences, in the parameters' units.

    Raises
    ------
    InputError
        Sizes that do not agree, or a covariance that is not one.
    """

    parameters: tuple[UpdateParameter, ...]
    values: NDArray[np.float64]
    covariance: NDArray[np.float64]

    def __post_init__(self) -> None:
        n = len(self.parameters)
        if self.values.shape != (n,) or self.covariance.shape != (n, n):
            raise InputError(
                f"[update] has {n} numbers and a covariance of shape {self.covariance.shape}; update the robot anew"
            )
        size = np.sqrt(np.abs(np.diag(self.covariance))) + 1e-300
        scaled = (self.covariance + self.covariance.T) / 2 / np.outer(size, size)
        if not np.isfinite(scaled).all() or np.linalg.eigvalsh(scaled)[0] < -1e-6:
            raise InputError("[update] covariance has a negative variance or no number; update the robot anew")
