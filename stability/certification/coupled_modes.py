"""Whether mode coupling or regeneration sets a limit: the limit again without either of them."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess
from foundation import InputError
from modal_fit import ModalModel

from ..milling_loop import with_residual_flexibility, with_static_high_modes
from ..solvers import mode_coupling_limit
from .certified import certified_lobes

Real = NDArray[np.float64]

SAME = 0.1
"""Share by which two limits differ before the words call them different."""

_MODES = 10
"""Lowest modes whose coupling is judged."""


@dataclass(frozen=True)
class CouplingJudgement:
    """Limits of one cut with and without what could set it.

    Parameters
    ----------
    limit : m
        Certified limit of the whole structure; infinite where there is none, NaN where it is not known.
    alone : m
        Lowest certified limit of the modes one by one, each as if the structure had no other.
    without_regeneration : m
        Depth from which the cut grows if no tooth meets the waves of another; infinite where there is none.
    decides
        ``mode coupling``, ``coupled regeneration``, ``regeneration``, ``no limit`` or ``cannot tell``.
    words
        The judgement and its ground in one sentence.
    """

    limit: float
    alone: float
    without_regeneration: float
    decides: str
    words: str


def judge_mode_coupling(
    model: ModalModel, process: MillingProcess, speed: float, max_depth: float
) -> CouplingJudgement:
    """Compare the limit at one speed with those of single modes and of the cut without regeneration.

    One mode alone cannot couple: its limit is regenerative. ``mode coupling``: together the modes have a limit that
    lies a tenth or more below that of each alone, and they grow without regeneration too, at no more than 1.1 times
    the limit (:func:`mode_coupling_limit`). ``coupled regeneration``: single modes alone have another limit, but
    without regeneration the cut is stable there. Else ``regeneration``. The ten lowest modes are judged.

    Parameters
    ----------
    model
        Modal model over TCP X, Y, Z in the axes of the cut.
    process
        Cutter and engagement; helix, pitch and process damping are left out of the comparison.
    speed : rad/s
        Spindle speed of the cut.
    max_depth : m
        Largest depth that is searched.
    """
    plain = replace(process, helix_angle=0.0, pitch_angles=(), process_damping=0.0)
    natural = np.sort(model.natural_frequencies)
    small = with_static_high_modes(
        with_residual_flexibility(model), natural[min(_MODES, len(natural)) - 1] * (1 + 1e-9)
    )
    limit = _limit(small, plain, speed, max_depth)
    single = [_limit(_alone(small, mode), plain, speed, max_depth) for mode in range(len(small.poles))]
    alone = float(np.min(single))
    try:
        free = mode_coupling_limit(replace(small, residuals=None), plain, max_depth).depth
    except InputError:
        free = np.nan
    decides, ground = _judged(limit, alone, free, max_depth)
    words = f"at {speed * 30 / np.pi:.5g} rpm {ground}"
    return CouplingJudgement(limit, alone, free, decides, words)


def _limit(model: ModalModel, process: MillingProcess, speed: float, max_depth: float) -> float:
    """Verified limit, m; infinite where there is none, NaN where it is not verified."""
    found = certified_lobes(model, process, np.array([speed]), max_depth)
    return float(found.depth_limits[0]) if found.status[0] == "verified" else np.nan


def _alone(model: ModalModel, mode: int) -> ModalModel:
    """The structure with one mode, and nothing else that gives way."""
    one = slice(mode, mode + 1)
    return replace(model, poles=model.poles[one], right=model.right[one], left=model.left[one], residuals=None)


def _judged(limit: float, alone: float, free: float, max_depth: float) -> tuple[str, str]:
    """Which of the three decides, and why."""
    if np.isnan(limit) or np.isnan(alone):
        return "cannot tell", "it cannot be told whether mode coupling decides: a limit there is not verified"
    if limit == np.inf:
        return "no limit", f"there is no limit up to {_mm(max_depth)}: mode coupling decides nothing"
    least = f"above {_mm(max_depth)}" if alone == np.inf else _mm(alone)
    ground = f"the limit is {_mm(limit)}, that of each mode alone {'' if alone == np.inf else 'at least '}{least}, "
    ground += "and without regeneration the cut "
    ground += f"is stable up to {_mm(max_depth)}" if free == np.inf else f"grows from {_mm(free)} on"
    apart = abs(min(alone, max_depth) / limit - 1) > SAME
    if np.isnan(free):
        return "cannot tell", f"it cannot be told whether mode coupling decides: {ground}"
    if apart and alone > limit and free <= (1 + SAME) * limit:
        return "mode coupling", f"mode coupling decides: {ground}"
    if apart:
        way = "lowers" if alone > limit else "raises"
        return "coupled regeneration", f"coupling of modes {way} the regenerative limit: {ground}"
    return "regeneration", f"regeneration decides, mode coupling does not: {ground}"


def _mm(depth: float) -> str:
    return f"{1e3 * depth:.3g} mm"
