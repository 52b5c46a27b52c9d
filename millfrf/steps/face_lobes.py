"""`lobes`: depth limits over spindle speed, from a modal model or an FRF at the tool tip."""

from dataclasses import replace

import numpy as np

from estimation import Frf
from millfrf.core import InputError
from millfrf.core.progress import Progress, silent
from millfrf.cutting import MillingProcess
from millfrf.gate import check_depth, check_speeds, lowest_frequency, rigid_directions
from millfrf.stability import StabilityLobes
from modal_fit import ModalModel

from .given import File, GivenFrf, GivenModel, dynamics_of, process_of, warn_of
from .lobes import CERTIFIED, compute_lobes, speed_axis

SPEEDS = 100
"""Spindle speeds where none are given."""

SMALL = 0.1
"""Modes whose largest resonant term is below this share of the largest do not choose the range of speeds."""


def lobes(
    dynamics: GivenModel | GivenFrf,
    cutting: File | MillingProcess,
    *,
    speeds: tuple[float, float, int] | None = None,
    max_depth: float | None = None,
    method: str = CERTIFIED,
    progress: Progress = silent,
) -> StabilityLobes:
    """Stability lobes: the largest stable axial depth at each spindle speed.

    Parameters
    ----------
    dynamics
        Modal model or FRF at the tool tip, what ``fit``, ``calibrate`` or ``estimate`` returned, or the name of a file.
    cutting
        The cut, or the name of its file (TOML).
    speeds
        Lowest and highest spindle speed in rpm, and their number. None: 100 speeds at which the teeth pass at a third
        of the lowest to 1.2 times the highest natural frequency of the modes that move the tip.
    max_depth
        Largest depth that is looked at, m; None: one diameter of the cutter.
    method
        ``certified`` or a solver by its name, one of ``LOBE_METHODS``.
    progress
        Shows progress, such as ``millfrf.progress.bar``.

    Returns
    -------
    StabilityLobes
        Limits with their status, and the doubts, which are warned of as well.

    Raises
    ------
    InputError
        Dynamics, a cut, speeds or a depth that cannot be used.
    """
    known, name, stored = dynamics_of(dynamics)
    process, doubts = process_of(cutting)
    depth = process.diameter if max_depth is None else max_depth
    axis = _speeds(known, process) if speeds is None else speeds
    doubts += [*check_depth(depth, process), *rigid_directions(known)]
    mode = lowest_frequency(known.natural_frequencies) if isinstance(known, ModalModel) else None
    doubts += check_speeds(axis, process, mode)
    found = compute_lobes(known, process, speed_axis(*axis), depth, method, progress, name)
    found = replace(found, warnings=(*stored, *doubts, *found.warnings))
    warn_of(found.warnings)
    return found


def _speeds(known: ModalModel | Frf, process: MillingProcess) -> tuple[float, float, int]:
    """Speeds over the lobes of the modes that move the tip; lowest and highest in rpm."""
    if isinstance(known, Frf):
        raise InputError("lobes of an FRF need spindle speeds in rpm, for example speeds=(300, 2400, 100)")
    if not len(known.poles):
        raise InputError("the model has no mode: give speeds in rpm, for example speeds=(300, 2400, 100)")
    size = np.abs(known.right).max(axis=1) * np.abs(known.left).max(axis=1) / np.abs(known.poles.real)
    chosen = known.natural_frequencies[size >= SMALL * size.max()]
    return 60 * float(chosen.min()) / (3 * process.teeth), 1.2 * 60 * float(chosen.max()) / process.teeth, SPEEDS
