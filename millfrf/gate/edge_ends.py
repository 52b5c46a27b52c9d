"""Warning about limits that edge forces lower because a vibration moves the thin ends of the chip."""

import numpy as np

from millfrf.cutting import MillingProcess
from millfrf.stability import EdgeEndEffect, edges_end_thin

LARGE = 0.02  # share of a limit from which the effect is stated


def edge_end_warnings(process: MillingProcess, effect: EdgeEndEffect | None) -> list[str]:
    """Return a warning that states by how much limits fall because a vibration moves the ends of edge forces.

    Parameters
    ----------
    process
        Milling process of the limits.
    effect
        What the motion of the ends changes (:func:`millfrf.stability.edge_end_effect`); None: not known.
    """
    if not edges_end_thin(process):
        return []
    if effect is not None and effect.lowered < LARGE:
        return []
    if effect is None:
        size = "by how much they are lower is not known at unequal pitch, on a cutter that is no cylinder, or so slow"
    else:
        size = f"they are up to {100 * effect.lowered:.0f} % lower (at {effect.speed * 30 / np.pi:.0f} rpm)"
    return [
        "the limits neglect that a vibration moves the end of the edge force where the chip begins or ends at zero "
        f"thickness: {size}; simulate the cut with `millfrf cut simulate`"
    ]
