"""Warning about limits that edge forces lower because a vibration moves the thin ends of the chip."""

import numpy as np

from estimation import Frf
from millfrf.core import Real
from millfrf.cutting import MillingProcess
from millfrf.stability import edge_end_effect
from modal_fit import ModalModel

LARGE = 0.02  # share of a limit from which the effect is stated


def edge_end_warnings(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float
) -> list[str]:
    """Return a warning that states by how much limits fall because a vibration moves the ends of edge forces.

    Parameters
    ----------
    structure
        Receptance at the tool tip.
    process
        Milling process of the limits.
    spindle_speeds : (n_speeds,), rad/s
        Speeds of the limits.
    max_depth : m
        Largest axial depth that is searched.
    """
    effect = edge_end_effect(structure, process, spindle_speeds, max_depth)
    if effect is None or effect.lowered < LARGE:
        return []
    return [
        "edge forces begin or end with the thin end of the chip, which a vibration moves: with edges that act on any "
        f"chip, limits are up to {100 * effect.lowered:.0f} % lower (at {effect.speed * 30 / np.pi:.0f} rpm); "
        "simulate the cut with `millfrf cut simulate`"
    ]
