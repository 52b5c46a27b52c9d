"""The depth limits that everything else stands on: a converged time-periodic solver, verified with multipliers."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess
from estimation import Frf
from modal_fit import ModalModel

from .collocation import lowest_limits
from .delay_system import DelaySystem, delay_system
from .depth_stages import safe_depth
from .multi_frequency import multi_frequency
from .second_look import second_look
from .stability_lobes import StabilityLobes
from .verification import verify


def certified_lobes(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: NDArray[np.float64], max_depth: float
) -> StabilityLobes:
    """Lowest limit at each speed with coefficients as they vary, and with a status that says how sure it is.

    Of a modal model: collocation; each limit is then verified with Floquet multipliers just below it (0.05 %), just
    above it, and on a ladder of depths beneath it, or up to ``max_depth`` where there is none. Where they disagree the
    limit is looked for again (:func:`second_look`); what cannot be settled is a lower bound or unresolved, never
    infinite. Of an FRF: the multi-frequency solution with its stated error, ``not-verified``.

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
    if isinstance(structure, Frf):
        return multi_frequency(structure, process, spindle_speeds, max_depth)
    lobes = lowest_limits(structure, process, spindle_speeds, max_depth).lowest()
    return _certified(delay_system(structure, process), lobes, max_depth)


def _certified(system: DelaySystem, lobes: StabilityLobes, max_depth: float) -> StabilityLobes:
    first = min(safe_depth(system), max_depth)
    speeds, depths = lobes.spindle_speeds, lobes.depth_limits.copy()
    bounded = np.array([status == "lower-bound" for status in lobes.status])
    good = verify(system, speeds, depths, max_depth, first).agrees & ~bounded
    frequencies, kinds = lobes.chatter_frequencies.copy(), list(lobes.bifurcations)
    status = ["verified"] * len(speeds)
    for k in np.flatnonzero(~good):
        claimed = np.inf if bounded[k] else float(depths[k])
        again = second_look(system, float(speeds[k]), claimed, max_depth, first)
        depths[k], frequencies[k], kinds[k], status[k] = again.depth, again.frequency, again.kind, again.status
    return replace(
        lobes,
        depth_limits=depths,
        chatter_frequencies=frequencies,
        bifurcations=tuple(kinds),
        status=tuple(status),
        warnings=tuple(line for line in lobes.warnings if "could not resolve" not in line) + _doubts(status),
    )


def _doubts(status: list[str]) -> tuple[str, ...]:
    """A sentence on the limits that could not be verified."""
    bounds, open_ = status.count("lower-bound"), status.count("unresolved")
    if not bounds + open_:
        return ()
    return (
        f"of {len(status)} speeds {bounds} have a lower bound only and {open_} no limit that could be verified: "
        "plan no cut there",
    )
