"""Step ``lobes``: depth limit over spindle speed."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, to_receptance
from millfrf.core import InputError
from millfrf.core.file_kinds import MODEL, kind_of
from millfrf.core.progress import Progress, silent
from millfrf.cutting import MillingProcess
from millfrf.figures import StableAbove, lobes_figure, save_figure
from millfrf.gate import (
    check_band_of_lobes,
    check_frf,
    check_model,
    check_window_damping,
    read_checked_cutting,
    terms_left_out,
)
from millfrf.report.islands import stable_above
from millfrf.stability import (
    ModeCouplingLimit,
    StabilityLobes,
    certified_lobes,
    collocation,
    mode_coupling_limit,
    multi_frequency,
    nyquist_limits,
    semi_discretisation,
    zero_order,
)
from modal_fit import ModalModel, read_modal_model

Speeds = NDArray[np.float64]

OF_ANY: dict[str, Callable[[Frf | ModalModel, MillingProcess, Speeds, float], StabilityLobes]] = {
    "zero-order": zero_order,
    "nyquist": nyquist_limits,
    "multi-frequency": multi_frequency,
}
"""Solvers that take a modal model or a measured FRF, by the name that ``--method`` takes."""

OF_MODELS: dict[str, Callable[[ModalModel, MillingProcess, Speeds, float], StabilityLobes]] = {
    "collocation": collocation,
    "semi-discretization": semi_discretisation,
}
"""Solvers that need a modal model."""

CERTIFIED = "certified"
"""The default: ``stability.certified_lobes``, each limit of a modal model verified."""

LOBE_METHODS = (CERTIFIED, *OF_ANY, *OF_MODELS)


def speed_axis(lowest: float, highest: float, count: int) -> NDArray[np.float64]:
    """Spindle speeds from two in rpm, evenly spaced, rad/s.

    Raises
    ------
    InputError
        Speeds that are not positive and increasing, or a count below 1.
    """
    if not (0 < lowest <= highest and np.isfinite(highest)):
        raise InputError(f"spindle speeds {lowest:g} to {highest:g} rpm are not positive and increasing; give LO HI N")
    if count < 1 or (count == 1 and lowest != highest):
        raise InputError(f"{count} spindle speeds between {lowest:g} and {highest:g} rpm; give 2 or more")
    return np.asarray(np.linspace(lowest, highest, count) * np.pi / 30)


def compute_lobes(
    dynamics: Frf | ModalModel,
    process: MillingProcess,
    spindle_speeds: NDArray[np.float64],
    max_depth: float,
    method: str = CERTIFIED,
    progress: Progress = silent,
    name: str = "the structure",
) -> StabilityLobes:
    """Depth limit at each spindle speed (rad/s), up to ``max_depth`` (m), certified unless a solver is named.

    ``name`` is that of the file, for messages.

    Raises
    ------
    InputError
        An unknown method, or dynamics that are not a receptance at the tool tip or that :mod:`millfrf.gate` refuses.
    """
    if method not in LOBE_METHODS:
        raise InputError(f"unknown method {method!r}; use one of {', '.join(LOBE_METHODS)}")
    if not (np.isfinite(max_depth) and max_depth > 0):
        raise InputError(f"largest depth {max_depth!r} m must be positive, for example 0.005 (5 mm)")
    known = to_receptance(dynamics) if isinstance(dynamics, Frf) else dynamics
    if known.quantity != "receptance":
        raise InputError(f"lobes need a receptance in m/N at the tool tip; this is a {known.quantity} in {known.unit}")
    if isinstance(dynamics, Frf):
        check_window_damping(dynamics, name)
        doubts = check_frf(dynamics, name)
    else:
        doubts = [*check_model(dynamics, name), *terms_left_out(dynamics, name)]
    with progress(f"lobes, {method}"):
        found = _solved(known, process, spindle_speeds, max_depth, method)
    doubts += check_band_of_lobes(known, found, process)
    return replace(found, warnings=(*found.warnings, *doubts))


def _solved(
    known: Frf | ModalModel, process: MillingProcess, spindle_speeds: Speeds, max_depth: float, method: str
) -> StabilityLobes:
    if method == CERTIFIED:
        return certified_lobes(known, process, spindle_speeds, max_depth)
    if method in OF_ANY:
        return OF_ANY[method](known, process, spindle_speeds, max_depth)
    if isinstance(known, Frf):
        raise InputError(f"method {method} needs a modal model, not an FRF; fit one, or use multi-frequency")
    return OF_MODELS[method](known, process, spindle_speeds, max_depth)


def lobes_summary(lobes: StabilityLobes, max_depth: float) -> str:
    """Lowest limit, and of how many speeds the limit is verified, a lower bound, not verified or unresolved."""
    known = np.isfinite(lobes.depth_limits)
    told = f"no limit up to {1e3 * max_depth:.3g} mm"
    if known.any():
        lowest = int(np.where(known, lobes.depth_limits, np.inf).argmin())
        told = f"lowest limit {1e3 * lobes.depth_limits[lowest]:.3g} mm at {lobes.spindle_speeds_rpm[lowest]:.0f} rpm"
        if lobes.status[lowest] == "lower-bound":
            told += " (a lower bound)"
    elif np.isnan(lobes.depth_limits).any():
        told = "no limit known"
    names = {"verified": "verified", "not-verified": "not verified", "lower-bound": "a lower bound only"}
    counts = [
        f"{lobes.status.count(status)} {word}"
        for status, word in (names | {"unresolved": "unresolved"}).items()
        if status in lobes.status
    ]
    return f"{told}; of {len(lobes.status)} speeds {', '.join(counts)}"


def mode_coupling_line(model: ModalModel, process: MillingProcess, max_depth: float) -> str:
    """One sentence on whether two modes couple at any depth up to ``max_depth`` (m) if no tooth cuts into waves."""
    if model.residuals is not None and model.residuals.upper.any():
        return (
            "mode coupling in a cut without regeneration: not computed, since the model has a residual flexibility; "
            "the depth limits hold where a tooth cuts into the waves of the one before"
        )
    return f"mode coupling in a cut without regeneration: {_coupling(mode_coupling_limit(model, process, max_depth))}"


def _coupling(found: ModeCouplingLimit) -> str:
    if found.kind == "none":
        return "none"
    beside = "the limits of the lobes hold where a tooth cuts into the waves of the one before"
    if found.kind == "fold":
        return f"from {1e3 * found.depth:.3g} mm the cutting force exceeds the structure's stiffness; {beside}"
    return f"from {1e3 * found.depth:.3g} mm at {found.frequency:.4g} Hz; {beside}"


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
