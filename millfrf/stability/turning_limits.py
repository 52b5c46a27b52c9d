"""Lowest depth limits of turning and boring, verified by the number of unstable roots."""

import math

import numpy as np

from millfrf.core import InputError, Real
from millfrf.cutting import MillingProcess
from modal_fit import ModalModel

from .climbed_limits import UNRESOLVED, SpeedLimit, first_depth, ladder
from .floquet.cut_period import collocated_cut
from .floquet.growth import leading_multipliers
from .floquet.turning_loop import turning_frequency, unstable_turning
from .milling_loop import DelaySystem, delay_system
from .settings import SETTINGS
from .solvers.zero_order import zero_order


def turning_limits(
    structure: ModalModel, process: MillingProcess, speeds: Real, max_depth: float
) -> tuple[list[SpeedLimit], tuple[str, ...]]:
    """Find and verify the lowest limit of a turning cut at each speed (rad/s) up to ``max_depth`` (m).

    With a straight edge the zero-order solution ``a = -1 / (2 K Re G)`` is exact, as the coefficients are constant
    (Tlusty & Polacek 1963; Altintas, Manufacturing Automation, 2nd ed., section 4.2). A cut must have no unstable root
    on a ladder of depths up to 0.05 % below it, and one 0.05 % above it. Otherwise, and with a nose radius or process
    damping, the depth at which the first pair of roots becomes unstable is bisected, and verified if the multipliers of
    a revolution have it within 0.05 %. A revolution of too many waves for these leaves it ``not-verified``.

    Returns
    -------
    limits, warnings
        Limit at each speed, and warnings about the structure.
    """
    system = delay_system(structure, process)
    first = first_depth(system, max_depth)
    if not process.is_plain:
        return [_bisected(system, float(speed), first, max_depth) for speed in speeds], system.warnings
    exact = zero_order(structure, process, speeds, max_depth)
    limits = [
        SpeedLimit(float(depth), float(frequency), "hopf" if math.isfinite(depth) else "none", "verified")
        if _agrees(system, float(speed), float(depth), first, max_depth)
        else _bisected(system, float(speed), first, max_depth)
        for speed, depth, frequency in zip(speeds, exact.depth_limits, exact.chatter_frequencies, strict=True)
    ]
    return limits, system.warnings


def _agrees(system: DelaySystem, speed: float, limit: float, first: float, max_depth: float) -> bool:
    """Check whether the count of unstable roots has the same lowest limit, m; infinite: none."""
    margin = SETTINGS.beside_limit
    top = (1 - margin) * limit if math.isfinite(limit) else max_depth
    if unstable_turning(system, speed, ladder(first, top, SETTINGS.ladder_ratio)).any():
        return False
    return math.isinf(limit) or bool(unstable_turning(system, speed, np.array([(1 + margin) * limit]))[0])


def _bisected(system: DelaySystem, speed: float, first: float, max_depth: float) -> SpeedLimit:
    """Find the lowest depth with an unstable root, on a ladder of depths and by bisection between two of them."""
    rungs = np.unique(
        np.append(ladder(first, max_depth, SETTINGS.ladder_ratio), np.arange(first, max_depth, 0.02 * max_depth))
    )
    unstable = unstable_turning(system, speed, rungs)
    if not unstable.any():
        agreed = _multipliers_agree(system, speed, math.inf, max_depth)
        return SpeedLimit(math.inf, math.nan, "none", "verified" if agreed else "not-verified")
    lowest = int(np.argmax(unstable))
    if lowest == 0:
        return UNRESOLVED
    low, high = float(rungs[lowest - 1]), float(rungs[lowest])
    while high - low > 1e-7 * high:
        middle = (low + high) / 2
        low, high = (low, middle) if unstable_turning(system, speed, np.array([middle]))[0] else (middle, high)
    agreed = _multipliers_agree(system, speed, high, max_depth)
    frequency = turning_frequency(system, speed, high)
    return SpeedLimit(high, frequency, "hopf", "verified" if agreed else "not-verified")


def _multipliers_agree(system: DelaySystem, speed: float, limit: float, max_depth: float) -> bool:
    """Check whether Floquet multipliers of a revolution change sides at a limit, m (infinite: there is none)."""
    margin, limited = SETTINGS.beside_limit, math.isfinite(limit)
    sides = [((1 - margin) * limit, False), ((1 + margin) * limit, True)] if limited else [(max_depth, False)]
    try:
        cuts = [(collocated_cut(system, speed, depth), unstable) for depth, unstable in sides]
        return all((leading_multipliers(cut).radius >= 1) == unstable for cut, unstable in cuts)
    except InputError:  # too many nodes
        return False
