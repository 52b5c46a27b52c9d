"""`millfrf robot lobes --learned`: lobes with a band in a posture that was not measured."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np

from millfrf.core import InputError, refuse_replacing, warning_lines, writing_whole_file
from millfrf.stability import StabilityLobes, write_lobes

from ...answers import lobes_answer
from ...chain import compute_lobes, lobes_summary, speed_axis
from ...gate import check_depth, check_speeds, lowest_frequency, read_checked_cutting
from ...options import check_output
from ...progress import bar
from ...provenance import add_comment, made, origin
from ...terminal import say, tell
from ..postures import Asked
from .band_figure import draw_depth_band
from .depth_band import SAMPLES, DepthBand, depth_band
from .learned_receptance import predicted_in

RPM = np.pi / 30


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
        _write_band(temporary, band, lobes)
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


def _write_band(path: Path, band: DepthBand, lobes: StabilityLobes) -> None:
    with path.open("w", newline="", encoding="utf-8") as stream:
        stream.writelines(warning_lines(lobes.warnings))
        writer = csv.writer(stream)
        writer.writerow(["spindle_speed_rpm", "depth_low_m", "depth_median_m", "depth_high_m"])
        for row in zip(band.spindle_speeds / RPM, band.low, band.middle, band.high, strict=True):
            writer.writerow([f"{value:.8g}" for value in row])
