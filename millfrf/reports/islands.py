"""Depths that are stable above an island of instability, where every limit of a cut is known."""

import numpy as np

from estimation import Frf
from millfrf.cutting import MillingProcess
from millfrf.figures import StableAbove
from millfrf.stability import StabilityLobes, collocation_limits
from modal_fit import ModalModel


def stable_above(
    structure: ModalModel | Frf, process: MillingProcess, lobes: StabilityLobes, max_depth: float
) -> tuple[StableAbove, ...]:
    """Every range of depths that is stable with unstable depths beneath it, at the speeds of the lobes.

    Parameters
    ----------
    structure
        Modal model at the tool tip. Of an FRF nothing is told: its lines bound what lies deeper.
    process, lobes
        Cut, and its lowest limits.
    max_depth : m
        Largest depth that is looked at.

    Returns
    -------
    tuple of StableAbove
        None at a speed whose lowest limit is found elsewhere than ``lobes`` says, or whose search left a gap.
    """
    if isinstance(structure, Frf):
        return ()
    limits = collocation_limits(structure, process, lobes.spindle_speeds, max_depth)
    found = limits.lowest().depth_limits
    told = []
    for k, speed in enumerate(lobes.spindle_speeds_rpm):
        agreed = np.isfinite(found[k]) and abs(found[k] - lobes.depth_limits[k]) <= AGREE * found[k]
        if not agreed or limits.resolved[k] < max_depth:
            continue
        told += [StableAbove(float(speed), low, high) for low, high in limits.stable_intervals(k) if low > 0]
    return tuple(told)


AGREE = 0.05
"""Relative difference of the lowest limit from the one that was told, up to which deeper limits are told as well."""
