"""Depths that are stable above an island of instability, where every limit of a cut is known; lobes as a picture."""

from pathlib import Path

import numpy as np

from estimation import Frf
from millfrf.cutting import MillingProcess
from millfrf.figures import StableAbove, lobes_figure, save_figure
from millfrf.stability import StabilityLobes, collocation_limits
from modal_fit import ModalModel, read_modal_model

from ...file_kinds import MODEL, kind_of
from ...gate import read_checked_cutting

AGREE = 0.05
"""Relative difference of the lowest limit from the one that was told, up to which deeper limits are told as well."""


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


def draw_lobes_of(dynamics: Path, cutting: Path, lobes: StabilityLobes, max_depth: float, picture: Path) -> None:
    """Lobes as a picture file, with what is stable above islands where the dynamics are a modal model.

    Parameters
    ----------
    dynamics, cutting
        Files that the lobes were made from.
    lobes
        Lowest limit at each speed, with its status.
    max_depth : m
        Largest depth that was looked at.
    picture
        ``.png``, ``.pdf`` or ``.svg``.
    """
    islands: tuple[StableAbove, ...] = ()
    if kind_of(dynamics) == MODEL:
        islands = stable_above(read_modal_model(dynamics), read_checked_cutting(cutting)[0], lobes, max_depth)
    save_figure(lobes_figure({lobes.method: lobes}, stable_above=islands), picture)
