"""Step ``lobes``: depth limit over spindle speed."""

import math
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np

from estimation import Frf, to_receptance
from millfrf.core import InputError, Real, counted
from millfrf.core.progress import progress
from millfrf.core.provenance import of_lobes
from millfrf.core.steps import Band, File, Grid, Typed, Writes, step
from millfrf.core.terminal import manner, say, say_written, tell, warn
from millfrf.cutting import MillingProcess, approach_angle_of, law_in_words, shape_in_words
from millfrf.gate import (
    check_band_of_lobes,
    check_depth,
    check_frf,
    check_model,
    check_recorded_cuts,
    check_speeds,
    check_window_damping,
    cross_term_warnings,
    edge_end_warnings,
    lowest_frequency,
    recorded_cuts,
    rigid_directions,
    terms_left_out,
)
from millfrf.stability import (
    SpeedVariation,
    StabilityLobes,
    certified_lobes,
    collocation,
    edge_end_effect,
    known_lines,
    mode_coupling_limit,
    multi_frequency,
    nyquist_limits,
    restricted_to,
    semi_discretisation,
    uncertain_by_edge_ends,
    varied_speed_limits,
    with_band,
    with_model,
    write_lobes,
    zero_order,
)
from modal_fit import ModalModel

from .answers import lobes_answer
from .given import CutGiven, DynamicsGiven, Variation, WorkpieceGiven, dynamics_of, files_among, process_of, relative_to
from .settings import STEPS

# Solvers that take a modal model or a measured FRF, by the name that ``--method`` takes
OF_ANY: dict[str, Callable[[Frf | ModalModel, MillingProcess, Real, float], StabilityLobes]] = {
    "zero-order": zero_order,
    "nyquist": nyquist_limits,
    "multi-frequency": multi_frequency,
}

# Solvers that need a modal model
OF_MODELS: dict[str, Callable[[ModalModel, MillingProcess, Real, float], StabilityLobes]] = {
    "collocation": collocation,
    "semi-discretization": semi_discretisation,
}

CERTIFIED = "certified"

LobeMethod = Literal["certified", "zero-order", "nyquist", "multi-frequency", "collocation", "semi-discretization"]


@step
def lobes(
    dynamics: DynamicsGiven,
    /,
    cutting: CutGiven,
    *,
    speeds: Grid | None = None,
    max_depth: Annotated[float, Typed("M")] | None = None,
    band: Band | None = None,
    workpiece: WorkpieceGiven = None,
    variation: Variation | None = None,
    out: Annotated[File | None, Writes(suffixes=(".csv",), needed=True)] = None,
    method: LobeMethod = "certified",
    picture: Annotated[File | None, Writes(suffixes=(".png", ".pdf", ".svg"))] = None,
) -> StabilityLobes:
    """Stability lobes from a modal model or straight from a measured FRF: the largest stable depth at each speed.

    certified: collocation, each limit verified by Floquet multipliers; for an FRF the multi-frequency solution. Other
    solvers can be chosen by name.

    Parameters
    ----------
    dynamics
        Modal model or FRF at the tool tip.
    cutting
        Cutter, engagement and force coefficients.
    speeds : rpm
        Lowest and highest spindle speed, and their number; without it 100 speeds at which the teeth pass at a third of
        the lowest to 1.2 times the highest natural frequency of the modes that move the tip, or peak of the FRF.
    max_depth : m
        Largest axial depth that is searched; without it one diameter of the cutter.
    band : Hz
        Lowest and highest frequency of the FRF's lines, or of the model's modes, that are used; without it all. Lines
        that are noise, or an error of the integration of an acceleration, are left out in any case.
    workpiece
        Modal model of a workpiece that moves, too, where the cut is, in the same directions; without it the workpiece
        is rigid.
    variation
        Sinusoidal variation of the speed: its share of the speed, and how often in a revolution; without it none. The
        speeds are then the mean ones.
    out
        Table of lobes to write.
    method
        Solver of the depth limits.
    picture
        Picture of the lobes to write, with islands of instability.

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
    structure, name, stored = dynamics_of(dynamics)
    structure, of_workpiece = relative_to(structure, workpiece)
    if band is not None:
        structure = restricted_to(structure, band)
    process, warnings = process_of(cutting)
    if isinstance(cutting, str | os.PathLike):
        warnings += check_recorded_cuts(process, Path(cutting).name, recorded_cuts(files_among(dynamics)))
    depth = process.diameter if max_depth is None else max_depth
    axis = default_speeds(structure, process) if speeds is None else speeds
    warnings += [*check_depth(depth, process), *rigid_directions(structure)]
    mode = lowest_frequency(structure.natural_frequencies) if isinstance(structure, ModalModel) else None
    warnings += check_speeds(axis, process, mode)
    varied = None if variation is None else SpeedVariation(*variation)
    result = compute_lobes(structure, process, speed_axis(*axis), depth, method, name, varied)
    result = replace(result, warnings=(*stored, *of_workpiece, *warnings, *result.warnings))
    if out is not None:
        options = {"speeds_rpm": axis, "max_depth_m": depth, "method": method} | ({"band_hz": band} if band else {})
        options |= {"variation": variation} if variation else {}
        write_lobes(out, result, provenance=of_lobes(files_among(dynamics, cutting, workpiece), options))
    if picture is not None:  # matplotlib takes as long to load as lobes take to compute
        from millfrf.figures import lobes_figure, save_figure
        from millfrf.reports.lobes_check import stable_above

        plain = isinstance(structure, ModalModel) and varied is None
        islands = stable_above(structure, process, result, depth) if plain else ()
        save_figure(lobes_figure({result.method: result}, stable_above=islands), Path(picture))
    warn(result.warnings)
    tell(lambda: {"max_depth_m": depth, **lobes_answer(result)})
    say_written([file for file in (out, picture) if file is not None], lobes_summary(result, depth))
    if isinstance(structure, ModalModel) and not manner().silent:
        say(mode_coupling_line(structure, process, depth))
    say(assumed_cut(process))
    return result


def default_speeds(structure: ModalModel | Frf, process: MillingProcess) -> tuple[float, float, int]:
    """Return the range of speeds (rpm) with lobes of the modes that move the tip, and the number of speeds."""
    natural = _peaks(structure) if isinstance(structure, Frf) else _frequencies_of_modes(structure)
    lowest, highest = float(natural.min()), float(natural.max())
    if process.is_turning:  # a lathe turns far slower than its modes
        return 2 * lowest, 20 * highest, STEPS.n_speeds
    return 60 * lowest / (3 * process.teeth), 1.2 * 60 * highest / process.teeth, STEPS.n_speeds


def _frequencies_of_modes(model: ModalModel) -> Real:
    """Return the natural frequencies (Hz) of the modes that move the tip."""
    if not len(model.poles):
        raise InputError("the model has no mode: give speeds in rpm, for example --speeds 300 2400 100")
    size = np.abs(model.right).max(axis=1) * np.abs(model.left).max(axis=1) / np.abs(model.poles.real)
    return np.asarray(model.natural_frequencies[size >= STEPS.small_mode * size.max()])


def _peaks(frf: Frf) -> Real:
    """Return the frequencies (Hz) of the peaks of an FRF's known lines, as those of modes that move the tip."""
    known, _ = known_lines(to_receptance(frf))
    lines = np.flatnonzero(known.valid & (known.frequencies > 0))
    size = np.linalg.norm(known.values[lines], axis=(1, 2))
    peaks = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:])) + 1
    peaks = peaks[size[peaks] >= STEPS.small_mode * size[peaks].max(initial=0.0)]
    if not len(peaks):
        raise InputError("the FRF has no peak: give speeds in rpm, for example --speeds 300 2400 100")
    return np.asarray(known.frequencies[lines[peaks]])


def speed_axis(lowest: float, highest: float, count: int) -> Real:
    """Evenly spaced spindle speeds between two in rpm, as rad/s."""
    if not (0 < lowest <= highest and np.isfinite(highest)):
        raise InputError(f"spindle speeds {lowest:g} to {highest:g} rpm are not positive and increasing; give LO HI N")
    if count < 1 or (count == 1 and lowest != highest):
        raise InputError(f"{count} spindle speeds between {lowest:g} and {highest:g} rpm; give 2 or more")
    return np.asarray(np.linspace(lowest, highest, count) * np.pi / 30)


def compute_lobes(
    dynamics: Frf | ModalModel,
    process: MillingProcess,
    spindle_speeds: Real,
    max_depth: float,
    method: str = CERTIFIED,
    name: str = "the structure",
    variation: SpeedVariation | None = None,
) -> StabilityLobes:
    """Depth limit at each spindle speed (rad/s), up to ``max_depth`` (m); ``name`` of the file for messages."""
    if not (np.isfinite(max_depth) and max_depth > 0):
        raise InputError(f"largest depth {max_depth!r} m must be positive, for example 0.005 (5 mm)")
    structure = to_receptance(dynamics) if isinstance(dynamics, Frf) else dynamics
    if structure.quantity != "receptance":
        kind = f"{structure.quantity} in {structure.unit}"
        raise InputError(f"lobes need a receptance in m/N at the tool tip; this is a {kind}")
    if isinstance(dynamics, Frf):
        check_window_damping(dynamics, name)
        warnings = check_frf(dynamics, name)
    else:
        warnings = [*check_model(dynamics, name), *terms_left_out(dynamics, name)]
    if variation is not None:
        limits = _at_varied_speed(structure, process, spindle_speeds, max_depth, method, variation)
        return replace(limits, warnings=(*limits.warnings, *warnings))
    with progress(f"lobes, {method}"):
        limits = _solved(structure, process, spindle_speeds, max_depth, method)
    if method != CERTIFIED:
        limits = with_model(structure, process, with_band(structure, process, limits, max_depth), max_depth)
    warnings += check_band_of_lobes(structure, limits, process)
    warnings += cross_term_warnings(structure, process, spindle_speeds, max_depth)
    effect = edge_end_effect(structure, process, spindle_speeds, max_depth)
    warnings += edge_end_warnings(process, effect)
    limits = limits if effect is None else uncertain_by_edge_ends(limits, effect)
    return replace(limits, warnings=(*limits.warnings, *warnings))


def _solved(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float, method: str
) -> StabilityLobes:
    if method == CERTIFIED:
        return certified_lobes(structure, process, spindle_speeds, max_depth)
    if method in OF_ANY:
        return OF_ANY[method](structure, process, spindle_speeds, max_depth)
    if isinstance(structure, Frf):
        raise InputError(f"method {method} needs a modal model, not an FRF; fit one, or use multi-frequency")
    return OF_MODELS[method](structure, process, spindle_speeds, max_depth)


def _at_varied_speed(
    structure: Frf | ModalModel,
    process: MillingProcess,
    spindle_speeds: Real,
    max_depth: float,
    method: str,
    variation: SpeedVariation,
) -> StabilityLobes:
    if isinstance(structure, Frf) or method != CERTIFIED:
        given = (
            "an FRF; fit it, and give the model" if isinstance(structure, Frf) else f"--method {method}; leave it out"
        )
        raise InputError(f"limits at a varied speed are not computed from {given}")
    with progress("lobes at a varied speed"):
        return varied_speed_limits(structure, process, spindle_speeds, max_depth, variation)


def lobes_summary(lobes: StabilityLobes, max_depth: float) -> str:
    """Sentence on the lowest limit, and on the number of speeds with each status."""
    finite = np.isfinite(lobes.depth_limits)
    text = f"no limit up to {1e3 * max_depth:.3g} mm"
    text += " of the modes that were measured" if "unmeasured" in lobes.status else ""
    if finite.any():
        lowest = int(np.where(finite, lobes.depth_limits, np.inf).argmin())
        text = f"lowest limit {1e3 * lobes.depth_limits[lowest]:.3g} mm at {lobes.spindle_speeds_rpm[lowest]:.0f} rpm"
        if lobes.numerics[lowest] == "lower-bound":
            text += " (a lower bound)"
    elif np.isnan(lobes.depth_limits).any():
        text = "no limit known"
    names = {
        "verified": "verified",
        "not-verified": "not verified",
        "lower-bound": "a lower bound only",
        "unmeasured": "resting on dynamics that were not measured",
        "uncertain": "uncertain by the errors of the structure or by edge forces",
        "unresolved": "unresolved",
    }
    counts = [f"{lobes.status.count(status)} {word}" for status, word in names.items() if status in lobes.status]
    return f"{text}; of {len(lobes.status)} speeds {', '.join(counts)}"


def assumed_cut(process: MillingProcess) -> str:
    """Sentence on what the limits take from the cutting file alone."""
    start, leave = math.degrees(process.start_angle), math.degrees(process.exit_angle)
    coefficients = f"ktc_pa {process.ktc:.4g}, krc {process.krc:.4g}, kac {process.kac:.4g}{law_in_words(process)}"
    if process.is_turning:
        approach = math.degrees(approach_angle_of(process))
        return (
            f"the cutting file alone states turning with an edge at {approach:.4g} degrees to the feed, and "
            f"{coefficients}: the limits hold for these"
        )
    return (
        f"the cutting file alone states {counted(process.teeth, 'edge')}, engaged from {start:.4g} to {leave:.4g} "
        f"degrees (0 to 90: up milling, 90 to 180: down milling), and {coefficients}: the limits hold for these"
    )


def mode_coupling_line(model: ModalModel, process: MillingProcess, max_depth: float) -> str:
    """Sentence on mode coupling in a cut without regeneration, up to ``max_depth`` (m)."""
    if model.unmeasured:
        return f"mode coupling in a cut without regeneration: not known, as {model.unmeasured} was not measured"
    if not process.is_cylinder:
        return f"mode coupling in a cut without regeneration: not computed with {shape_in_words(process)}"
    limit = mode_coupling_limit(model, process, max_depth)
    text = "none"
    if limit.kind != "none":
        effect = (
            "the cutting force exceeds the structure's stiffness"
            if limit.kind == "fold"
            else f"at {limit.frequency:.4g} Hz"
        )
        text = (
            f"from {1e3 * limit.depth:.3g} mm {effect}; "
            "the limits of the lobes hold where a tooth cuts into the waves of the one before"
        )
    return f"mode coupling in a cut without regeneration: {text}"
