"""Step ``lobes``: depth limit over spindle speed."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, to_receptance
from millfrf.core import InputError
from millfrf.core.progress import progress
from millfrf.core.provenance import of_lobes
from millfrf.core.steps import File, Grid, Typed, Writes, step
from millfrf.core.terminal import manner, say, say_written, tell, warn
from millfrf.cutting import MillingProcess
from millfrf.gate import (
    check_band_of_lobes,
    check_depth,
    check_frf,
    check_model,
    check_speeds,
    check_window_damping,
    lowest_frequency,
    rigid_directions,
    terms_left_out,
)
from millfrf.stability import (
    ModeCouplingLimit,
    StabilityLobes,
    certified_lobes,
    collocation,
    mode_coupling_limit,
    multi_frequency,
    nyquist_limits,
    semi_discretisation,
    write_lobes,
    zero_order,
)
from modal_fit import ModalModel

from .answers import lobes_answer
from .given import CutGiven, DynamicsGiven, dynamics_of, files_among, process_of

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

LobeMethod = Literal["certified", "zero-order", "nyquist", "multi-frequency", "collocation", "semi-discretization"]


SPEEDS = 100
"""Spindle speeds where none are given."""

SMALL = 0.1
"""Modes whose largest resonant term is below this share of the largest do not choose the range of speeds."""


@step
def lobes(
    dynamics: DynamicsGiven,
    /,
    cutting: CutGiven,
    *,
    speeds: Grid | None = None,
    max_depth: Annotated[float, Typed("M")] | None = None,
    out: Annotated[File | None, Writes(suffixes=(".csv",), needed=True)] = None,
    method: LobeMethod = "certified",
    picture: Annotated[File | None, Writes(suffixes=(".png", ".pdf", ".svg"))] = None,
) -> StabilityLobes:
    """Stability lobes from a modal model or straight from a measured FRF: the largest stable depth at each speed.

    certified: collocation, each limit verified by Floquet multipliers; of an FRF the multi-frequency solution. Other
    solvers are taken by name.

    Parameters
    ----------
    dynamics
        Modal model or FRF at the tool tip.
    cutting
        Cutter, engagement and force coefficients.
    speeds : rpm
        Lowest and highest spindle speed, and their number; without it 100 speeds at which the teeth pass at a third of
        the lowest to 1.2 times the highest natural frequency of the modes that move the tip.
    max_depth : m
        Largest axial depth that is searched; without it one diameter of the cutter.
    out
        Table of lobes to write.
    method
        Solver of the depth limits.
    picture
        Picture of the lobes to write, islands drawn.

    Returns
    -------
    StabilityLobes
        Limits with their status, and the warnings.

    Raises
    ------
    InputError
        Dynamics, a cut, speeds or a depth that cannot be used.

    Examples
    --------
    ::

        $ millfrf lobes tip.json --cutting cut.toml --speeds 300 2400 200 --max-depth 0.01 --out lobes.csv
    """
    known, name, stored = dynamics_of(dynamics)
    process, doubts = process_of(cutting)
    depth = process.diameter if max_depth is None else max_depth
    axis = _speeds(known, process) if speeds is None else speeds
    doubts += [*check_depth(depth, process), *rigid_directions(known)]
    mode = lowest_frequency(known.natural_frequencies) if isinstance(known, ModalModel) else None
    doubts += check_speeds(axis, process, mode)
    result = compute_lobes(known, process, speed_axis(*axis), depth, method, name)
    result = replace(result, warnings=(*stored, *doubts, *result.warnings))
    if out is not None:
        asked = {"speeds_rpm": axis, "max_depth_m": depth, "method": method}
        write_lobes(out, result, provenance=of_lobes(files_among(dynamics, cutting), asked))
    if picture is not None:  # matplotlib takes as long to load as lobes take to compute
        from millfrf.figures import lobes_figure, save_figure
        from millfrf.reports.islands import stable_above

        islands = stable_above(known, process, result, depth) if isinstance(known, ModalModel) else ()
        save_figure(lobes_figure({result.method: result}, stable_above=islands), Path(picture))
    warn(result.warnings)
    tell(lambda: {"max_depth_m": depth, **lobes_answer(result)})
    say_written([file for file in (out, picture) if file is not None], lobes_summary(result, depth))
    if isinstance(known, ModalModel) and not manner().silent:
        say(mode_coupling_line(known, process, depth))
    return result


def _speeds(known: ModalModel | Frf, process: MillingProcess) -> tuple[float, float, int]:
    """Speeds over the lobes of the modes that move the tip; lowest and highest in rpm."""
    if isinstance(known, Frf):
        raise InputError("lobes of an FRF need spindle speeds in rpm, for example --speeds 300 2400 100")
    if not len(known.poles):
        raise InputError("the model has no mode: give speeds in rpm, for example --speeds 300 2400 100")
    size = np.abs(known.right).max(axis=1) * np.abs(known.left).max(axis=1) / np.abs(known.poles.real)
    chosen = known.natural_frequencies[size >= SMALL * size.max()]
    return 60 * float(chosen.min()) / (3 * process.teeth), 1.2 * 60 * float(chosen.max()) / process.teeth, SPEEDS


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
    name: str = "the structure",
) -> StabilityLobes:
    """Depth limit at each spindle speed (rad/s), up to ``max_depth`` (m), certified unless a solver is named.

    ``name`` is that of the file, for messages.

    Raises
    ------
    InputError
        Dynamics that are not a receptance at the tool tip or that :mod:`millfrf.gate` refuses.
    """
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
