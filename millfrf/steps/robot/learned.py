"""Receptance and lobes with bands in postures that were not measured."""

import csv
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from estimation import write_frf
from millfrf.core import TIP, InputError, Real, refuse_replacing, warning_lines, writing_whole_file
from millfrf.core.progress import bar
from millfrf.core.provenance import add_comment, add_to_json, made, origin
from millfrf.core.terminal import Table, say, show, tell
from millfrf.cutting import MillingProcess
from millfrf.figures import save_figure
from millfrf.gate import check_depth, check_speeds, lowest_frequency, read_checked_cutting
from millfrf.options import check_band, check_output
from millfrf.robot_model import PredictedPosture, predict_posture, read_learned_postures, read_robot, shown_values
from millfrf.stability import StabilityLobes, lowest_limits, write_lobes
from modal_fit import ModalModel, write_modal_model

from ..answers import lobes_answer, model_answer
from ..lobes import compute_lobes, lobes_summary, speed_axis
from .postures import Asked, check_positive, posture_of, spatial

SAMPLES = 79
"""Between the second smallest and the second largest of 79 limits the next one lies with 76 / 80 = 95 %."""


@dataclass(frozen=True)
class DepthBand:
    """95 % band of the depth limit at each speed.

    Parameters
    ----------
    spindle_speeds : (n_speeds,), rad/s
        Spindle speeds of the limits.
    low, middle, high : (n_speeds,), m
        Ends of the band and median of the draws; ``max_depth`` where the limit lies above it.
    max_depth : m
        Largest depth that was looked at.
    """

    spindle_speeds: Real
    low: Real
    middle: Real
    high: Real
    max_depth: float


def depth_band(
    draws: Sequence[ModalModel],
    process: MillingProcess,
    spindle_speeds: Real,
    max_depth: float,
    samples: int = SAMPLES,
    progress: Callable[[int], None] | None = None,
) -> DepthBand:
    """Solve the depth limits of drawn models, time-periodic and converged, and order them.

    Parameters
    ----------
    draws
        Modal models of the prediction; ``samples`` of them are taken at equal steps.
    process
        Cutter and engagement.
    spindle_speeds : (n_speeds,), rad/s
        Spindle speeds of the wanted limits.
    max_depth : m
        Largest depth that is looked at.
    samples
        Number of models; the band leaves ``round(0.025 (n + 1))`` limits out at either end, itself included.
    progress
        Function that is told how many models are done.
    """
    chosen = np.linspace(0, len(draws) - 1, min(samples, len(draws))).astype(int)
    limits = np.empty((len(chosen), len(spindle_speeds)))
    for row, index in enumerate(chosen):
        found = lowest_limits(draws[index], process, spindle_speeds, max_depth).lowest()
        unresolved = np.array([status == "unresolved" for status in found.status])
        limits[row] = np.where(unresolved, 0.0, np.minimum(found.depth_limits, max_depth))
        if progress is not None:
            progress(row + 1)
    ordered = np.sort(limits, axis=0)
    end = max(round(0.025 * (len(chosen) + 1)), 1)
    return DepthBand(np.asarray(spindle_speeds), ordered[end - 1], np.median(ordered, axis=0), ordered[-end], max_depth)


RPM = np.pi / 30


def draw_depth_band(path: Path, band: DepthBand, lobes: StabilityLobes) -> None:
    """Draw the band, its median, and the lobes of the model in the middle; readable in grey."""
    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    axes = figure.add_subplot()
    speeds = band.spindle_speeds / RPM
    axes.fill_between(speeds, 1e3 * band.low, 1e3 * band.high, color="0.82", label="95 % band")
    axes.plot(speeds, 1e3 * band.middle, color="0.25", linestyle="--", label="median of the draws")
    axes.plot(
        lobes.spindle_speeds_rpm,
        1e3 * np.minimum(lobes.depth_limits, band.max_depth),
        color="C0",
        label="model in the middle",
    )
    axes.set(xlabel="spindle speed (rpm)", ylabel="depth limit (mm)", ylim=(0, 1.05e3 * float(band.high.max())))
    axes.set_xlim(float(speeds.min()), float(speeds.max()) if len(speeds) > 1 else float(speeds.max()) + 1)
    axes.legend(frameon=False)
    axes.grid(True, color="0.9")
    save_figure(figure, path)


def predicted_in(robot: str, learned: Path, asked: Asked) -> tuple[PredictedPosture, str]:
    """What a file of learned postures says of a posture, and the posture in words.

    Raises
    ------
    InputError
        A planar robot, another robot than that which was learned, or a posture out of reach.
    """
    case = spatial(read_robot(robot))
    known = read_learned_postures(learned, case.robot)
    driven, axes = posture_of(case, asked)
    with bar("predicting"):
        found = predict_posture(known, driven, axes=axes)
    return found, shown_values(case.robot.mechanism, driven)


def write_learned_receptance(
    robot: str, learned: Path, asked: Asked, out: Path, band: tuple[float, float], lines: int
) -> None:
    """Modal model with covariance (.json), receptance in the middle (.h5), or its band as a table (.csv)."""
    check_output(out, (".h5", ".json", ".csv"), [learned])
    check_band(band)
    check_positive("band", band[1], "Hz", 1e6)
    if not 2 <= lines <= 1_000_000:
        raise InputError(f"{lines} frequency lines: give 2 to 1000000")
    found, posture = predicted_in(robot, learned, asked)
    provenance = {
        "command": "robot frf",
        "robot": robot,
        "posture": posture,
        "warnings": list(found.warnings),
        **origin("robot frf", [robot, learned], {"learned": learned.name}),
    }
    axis = np.linspace(*band, lines)
    if out.suffix == ".json":
        with writing_whole_file(out) as temporary:
            write_modal_model(temporary, found.model)
            add_to_json(temporary, provenance)
    elif out.suffix == ".h5":
        write_frf(out, found.model.frf(axis), provenance=json.dumps(provenance))
    else:
        with writing_whole_file(out) as temporary:
            _write_band_of_learned_receptance(temporary, axis, found)
            add_comment(temporary, provenance)
    tell(lambda: {"posture": posture, **model_answer(found.model)})
    show(_table(found, posture))
    for warning in found.warnings:
        say(f"warning: {warning}")
    told = {".json": "with covariance", ".h5": "the middle alone; .csv has its band", ".csv": "with its 95 % band"}
    say(f"wrote {out}: {len(found.model.poles)} modes, {told[out.suffix]}")


def _table(found: PredictedPosture, posture: str) -> Table:
    frequency, damping = found.frequency_band(), 100 * found.damping_band()
    rows = tuple(
        (str(r + 1), f"{f:.3f}", _span(frequency[:, r], 3), f"{100 * z:.2f}", _span(damping[:, r], 2))
        for r, (f, z) in enumerate(zip(found.model.natural_frequencies, found.model.damping_ratios, strict=True))
    )
    columns = ("mode", "frequency (Hz)", "95 % band", "damping ratio (%)", "95 % band")
    return Table(f"Modes predicted in the posture {posture}", columns, rows)


def _span(ends: Real, digits: int) -> str:
    return f"{ends[0]:.{digits}f} - {ends[1]:.{digits}f}"


def _write_band_of_learned_receptance(path: Path, axis: Real, found: PredictedPosture) -> None:
    """A row for each line and entry: magnitude in the middle and the ends of its band, m/N."""
    middle, ends = np.abs(found.model.receptance(axis)), found.receptance_band(axis)
    with path.open("w", newline="", encoding="utf-8") as stream:
        stream.writelines(warning_lines(found.warnings))
        writer = csv.writer(stream)
        writer.writerow(["frequency_hz", "response", "excitation", "magnitude_m_per_n", "low_m_per_n", "high_m_per_n"])
        for k, frequency in enumerate(axis):
            for p, response in enumerate(TIP):
                for q, excitation in enumerate(TIP):
                    values = (middle[k, p, q], ends[0, k, p, q], ends[1, k, p, q])
                    writer.writerow([f"{frequency:.9g}", response, excitation, *(f"{value:.6g}" for value in values)])


def write_learned_lobes(
    robot: str,
    learned: Path,
    asked: Asked,
    cut: tuple[Path, tuple[float, float, int] | None, float, str],
    out: Path,
    picture: Path | None = None,
) -> None:
    """Lobes of the model in the middle, and their 95 % band in ``<OUT>_band.csv``.

    Parameters
    ----------
    robot, learned, asked
        Robot, file of learned postures, and the posture as typed.
    cut
        File of the cut, spindle speeds ``LO HI N`` in rpm, largest depth in m, and method.
    out, picture
        Table of lobes, and a picture or None.

    Raises
    ------
    InputError
        No speeds, or files that cannot be used.
    """
    cutting, speeds, max_depth, method = cut
    check_output(out, (".csv",), [learned, cutting])
    beside = out.with_name(f"{out.stem}_band.csv")
    refuse_replacing(beside)
    if picture is not None:
        check_output(picture, (".png", ".pdf", ".svg"))
    if speeds is None:
        raise InputError("give --speeds LO HI N: a band of learned postures is over spindle speeds")
    process, doubts = read_checked_cutting(cutting)
    doubts += check_depth(max_depth, process)
    found, posture = predicted_in(robot, learned, asked)
    doubts += [*check_speeds(speeds, process, lowest_frequency(found.model.natural_frequencies)), *found.warnings]
    axis = speed_axis(*speeds)
    lobes = compute_lobes(found.model, process, axis, max_depth, method, bar)
    lobes = replace(lobes, warnings=(*doubts, *lobes.warnings))
    with bar("band of the depth limit", SAMPLES) as update:
        band = depth_band(found.draws, process, axis, max_depth, progress=update)
    options = {"posture": posture, "speeds_rpm": speeds, "depth_max_m": max_depth, "method": method}
    write_lobes(out, lobes, provenance=made("robot lobes", [robot, learned, cutting], options))
    with writing_whole_file(beside) as temporary:
        _write_band_of_learned_lobes(temporary, band, lobes)
        add_comment(temporary, origin("robot lobes", [robot, learned, cutting], options))
    for warning in lobes.warnings:
        say(f"warning: {warning}")
    lowest = int(np.argmin(band.low))
    tell(lambda: {"max_depth_m": max_depth, **lobes_answer(lobes)})
    say(f"wrote {out}: {lobes_summary(lobes, max_depth)}")
    say(
        f"wrote {beside}: at {axis[lowest] / RPM:.0f} rpm the limit lies between {1e3 * band.low[lowest]:.3g} and "
        f"{1e3 * band.high[lowest]:.3g} mm (95 %)"
    )
    if picture is not None:
        draw_depth_band(picture, band, lobes)
        say(f"wrote {picture}")


def _write_band_of_learned_lobes(path: Path, band: DepthBand, lobes: StabilityLobes) -> None:
    with path.open("w", newline="", encoding="utf-8") as stream:
        stream.writelines(warning_lines(lobes.warnings))
        writer = csv.writer(stream)
        writer.writerow(["spindle_speed_rpm", "depth_low_m", "depth_median_m", "depth_high_m"])
        for row in zip(band.spindle_speeds / RPM, band.low, band.middle, band.high, strict=True):
            writer.writerow([f"{value:.8g}" for value in row])
