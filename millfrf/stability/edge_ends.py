"""What edge forces change in depth limits because a vibration moves the thin ends of the chip."""

from dataclasses import dataclass, replace

import numpy as np

from estimation import Frf
from millfrf.core import Real
from millfrf.cutting import MillingProcess, thin_ends
from modal_fit import ModalModel

from .lobes_result import StabilityLobes
from .settings import SETTINGS
from .solvers.multi_frequency import compared_speeds, multi_frequency

UNCERTAIN = "uncertain"  # word of ``StabilityLobes.model`` and ``status``


@dataclass(frozen=True)
class EdgeEndEffect:
    """Change of limits by edge forces whose ends a vibration moves."""

    spindle_speeds: Real  # (n_speeds,), rad/s, at which limits were compared
    decrease: Real  # (n_speeds,), decrease of each limit as a share of it; negative: an increase

    @property
    def lowered(self) -> float:
        """Largest decrease of a limit, as a share of it."""
        return float(max(self.decrease.max(), 0.0))

    @property
    def speed(self) -> float:
        """Spindle speed of the largest decrease, rad/s."""
        return float(self.spindle_speeds[self.decrease.argmax()])


def edges_end_thin(process: MillingProcess) -> bool:
    """Return whether edge forces begin or end where the chip vanishes."""
    edges = any((process.kte, process.kre, process.kae)) and process.feed_per_tooth > 0
    return edges and len(thin_ends(process)) > 0


def edge_end_effect(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float
) -> EdgeEndEffect | None:
    """Compute limits with and without the motion of the ends of edge forces.

    Where the chip vanishes at the beginning or the end of an immersion, a vibration makes the edge cut over a longer or
    shorter angle (:func:`millfrf.cutting.edge_end_harmonics`). Lobes neglect it, as the literature does; simulations in
    time, in which an edge force acts while there is a chip, contain it.

    Parameters
    ----------
    structure
        Receptance at the tip.
    process
        Cutter and engagement; edges count as straight, which changes both limits alike.
    spindle_speeds : (n_speeds,), rad/s
        Speeds of the limits; up to eight of them are compared, those with too many harmonics are left out.
    max_depth : m
        Largest axial depth that is searched; a limit that only one of both cases has counts as this depth in the other.

    Returns
    -------
    EdgeEndEffect or None
        None where edge forces do not end thin (:func:`edges_end_thin`), and where the effect is not known: with unequal
        pitch, a cutter that is no cylinder, or no speed that can be compared.
    """
    if not (edges_end_thin(process) and process.equal_pitch and process.is_cylinder):
        return None
    straight = replace(process, helix_angle=0.0, runout=0.0)
    speeds = compared_speeds(structure, straight, spindle_speeds)
    if not len(speeds):
        return None
    without, limits = (
        np.minimum(multi_frequency(structure, straight, speeds, max_depth, edge_ends=ends).depth_limits, max_depth)
        for ends in (False, True)
    )
    return EdgeEndEffect(speeds, 1 - limits / without)


def uncertain_by_edge_ends(lobes: StabilityLobes, effect: EdgeEndEffect) -> StabilityLobes:
    """Return lobes whose ``model`` is ``uncertain`` where edge forces lower limits by more than a certain one allows.

    A limit counts as lowered by the larger decrease of the two nearest speeds at which limits were compared.

    Parameters
    ----------
    lobes
        Limits that neglect the motion of the ends of edge forces.
    effect
        What that motion changes.
    """
    order = np.argsort(effect.spindle_speeds)
    compared, decrease = effect.spindle_speeds[order], effect.decrease[order]
    above = np.searchsorted(compared, lobes.spindle_speeds).clip(0, len(compared) - 1)
    below = np.searchsorted(compared, lobes.spindle_speeds, side="right").clip(1) - 1
    lowered = np.maximum(decrease[above], decrease[below]) > SETTINGS.certain
    changed = lowered & ~np.isnan(lobes.depth_limits)
    model = [UNCERTAIN if change else word for change, word in zip(changed, lobes.model, strict=True)]
    status = [
        UNCERTAIN if change and word == "verified" else word for change, word in zip(changed, lobes.status, strict=True)
    ]
    return replace(lobes, model=tuple(model), status=tuple(status))
