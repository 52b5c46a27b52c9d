"""Stable depths above an island of instability."""

import numpy as np

from estimation import Frf
from millfrf.cutting import MillingProcess
from millfrf.figures import StableAbove
from millfrf.stability import StabilityLobes, collocation_limits
from modal_fit import ModalModel


def stable_above(
    structure: ModalModel | Frf, process: MillingProcess, lobes: StabilityLobes, max_depth: float
) -> tuple[StableAbove, ...]:
    """Find every range of stable depths with unstable depths below it, at the speeds of the lobes.

    Parameters
    ----------
    structure
        Modal model at the tool tip. For an FRF no range is returned: its band limits the search at larger depths.
    process, lobes
        Milling process, and its lowest limits.
    max_depth : m
        Largest depth of the search.

    Returns
    -------
    tuple of StableAbove
        No range at a speed whose lowest limit differs from that of ``lobes`` by more than 5 %, or whose search is
        not complete.
    """
    if isinstance(structure, Frf):
        return ()
    limits = collocation_limits(structure, process, lobes.spindle_speeds, max_depth)
    lowest = limits.lowest().depth_limits
    ranges = []
    for k, speed in enumerate(lobes.spindle_speeds_rpm):
        agreed = np.isfinite(lowest[k]) and abs(lowest[k] - lobes.depth_limits[k]) <= 0.05 * lowest[k]
        if not agreed or limits.resolved[k] < max_depth:
            continue
        ranges += [StableAbove(float(speed), low, high) for low, high in limits.stable_intervals(k) if low > 0]
    return tuple(ranges)
