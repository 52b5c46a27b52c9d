"""Stability lobes of a robot's modal model at the tool tip."""

from dataclasses import replace

import numpy as np

from millfrf.core import TIP, Real
from millfrf.cutting import MillingProcess, shape_in_words
from millfrf.stability import (
    LimitBand,
    StabilityLobes,
    certified_lobes,
    judge_mode_coupling,
    with_residual_flexibility,
    with_static_high_modes,
)
from modal_fit import ModalModel, Residuals

from ..lobes import LobeMethod, compute_lobes
from ..settings import LOBES
from .uncertainty import band_of_lobes

TIME_PERIODIC = ("certified", "collocation", "semi-discretization")  # methods whose cost grows with the highest mode


def lobes_at_the_tip(
    model: ModalModel, process: MillingProcess, speeds: Real, max_depth: float, method: LobeMethod
) -> tuple[StabilityLobes, LimitBand | None, str]:
    """Lobes of a model in the axes of the cut, their 95 % band, and a sentence on mode coupling."""
    full = at_the_tip(model)
    reduced, notes = settled_modes(full, process, speeds, max_depth) if method in TIME_PERIODIC else (full, ())
    lobes = compute_lobes(reduced, process, speeds, max_depth, method)
    band, no_band = band_of_lobes(full, process, lobes, max_depth)
    lobes = replace(lobes, warnings=(*no_band, *notes, *lobes.warnings))
    return lobes, band, _coupling(reduced, process, lobes, max_depth)


def at_the_tip(model: ModalModel) -> ModalModel:
    """The model over X, Y and Z of the tip; a direction that it does not have (Y of a planar robot) is rigid."""
    if model.responses == TIP:
        return model
    columns = [model.responses.index(label) if label in model.responses else -1 for label in TIP]

    def at_tip(vectors: np.ndarray) -> np.ndarray:
        return np.column_stack([np.zeros(len(vectors)) if i < 0 else vectors[:, i] for i in columns])

    residuals = with_residual_flexibility(model).residuals
    if residuals is not None:
        upper, lower = (at_tip(at_tip(matrix).T).T for matrix in (residuals.upper, residuals.lower))
        residuals = Residuals(upper, lower)
    return ModalModel(model.poles, at_tip(model.right), at_tip(model.left), TIP, TIP, residuals=residuals)


def settled_modes(
    model: ModalModel, process: MillingProcess, speeds: Real, max_depth: float
) -> tuple[ModalModel, tuple[str, ...]]:
    """Replace high modes by their static flexibility if this changes the limits at three speeds by less than 0.5 %.

    A model whose modes have at most 20 periods in the longest tooth period (speeds in rad/s) is returned unchanged.
    Otherwise the limits at the slowest, a middle and the fastest speed are computed with all modes up to 20 periods,
    and the fewest modes with the same limits are kept. A note states their number and the change of the limits.
    """
    natural = np.sort(model.natural_frequencies)
    most = LOBES.periods_in_tooth_period * process.teeth * float(speeds.min()) / (2 * np.pi)
    if natural[-1] <= most or not process.is_plain:
        return model, ()
    tops = [float(natural[count - 1]) * 1.0001 for count in LOBES.mode_counts if count < len(natural)]
    tops = [top for top in tops if top <= most] + [max(most, tops[0] if tops else 0.0)]
    checked = np.unique([speeds.min(), speeds[len(speeds) // 2], speeds.max()])
    reference = _limits(with_static_high_modes(model, tops[-1]), process, checked, max_depth)
    for top in tops:
        small = with_static_high_modes(model, top)
        change = float(np.abs(_limits(small, process, checked, max_depth) / reference - 1).max())
        if change < LOBES.negligible_change:
            break
    note = (
        f"{len(model.poles) - len(small.poles)} modes above {top:.0f} Hz are replaced by their static flexibility: at "
        f"{len(checked)} speeds, limits with modes up to {tops[-1]:.0f} Hz differ by at most {100 * change:.2g} %"
    )
    return small, (note,)


def _limits(model: ModalModel, process: MillingProcess, speeds: Real, max_depth: float) -> Real:
    limits = certified_lobes(model, process, speeds, max_depth).depth_limits
    return np.maximum(np.minimum(np.nan_to_num(limits, nan=0.0, posinf=max_depth), max_depth), 1e-9)


def _coupling(model: ModalModel, process: MillingProcess, lobes: StabilityLobes, max_depth: float) -> str:
    """State whether and why mode coupling determines the limit at the speed with the lowest limit."""
    if not process.is_cylinder:
        return f"mode coupling is not computed with {shape_in_words(process)}"
    if not np.isfinite(lobes.depth_limits).any():
        return "mode coupling is not computed: no speed has a limit"
    lowest = int(np.nanargmin(np.where(np.isfinite(lobes.depth_limits), lobes.depth_limits, np.nan)))
    return judge_mode_coupling(model, process, float(lobes.spindle_speeds[lowest]), max_depth).words
