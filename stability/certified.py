"""The depth limits that everything else stands on: a converged time-periodic solver, by what is known of the tool."""

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess
from estimation import Frf
from modal_fit import ModalModel

from .collocation import collocation
from .multi_frequency import multi_frequency
from .stability_lobes import StabilityLobes


def certified_lobes(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: NDArray[np.float64], max_depth: float
) -> StabilityLobes:
    """Lowest limit at each speed with coefficients as they vary: collocation of a model, multi-frequency of an FRF.

    Parameters
    ----------
    structure
        Modal model, or FRF, at the tool tip; receptance.
    process
        Cutter and engagement.
    spindle_speeds : (n_speeds,), rad/s
    max_depth
        Depths above it are not looked for, m.

    Raises
    ------
    InputError
        As :func:`collocation` and :func:`multi_frequency`.
    """
    solver = multi_frequency if isinstance(structure, Frf) else collocation
    return solver(structure, process, spindle_speeds, max_depth)
