"""Step ``cut identify``: force coefficients and runout from the forces of the user's own cuts."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from acquisition import opened
from millfrf.core import InputError, counted, tables_of_setup, with_error
from millfrf.core.progress import progress
from millfrf.core.provenance import made
from millfrf.core.steps import File, Reads, Typed, Writes, step
from millfrf.core.terminal import Table, say, say_written, show, tell, warn
from millfrf.cutting import MillingProcess, immersion_angles, write_cutting_process
from millfrf.gate import check_cutting, check_depth, check_feed, check_several, read_checked_cutter
from millfrf.mismatch import (
    COEFFICIENT_SYMBOLS,
    CutCoefficients,
    CutForces,
    identify_coefficients,
    read_cut_forces,
    read_dynamometer,
)

from .given import Picture, Speed
from .settings import RPM

FEED, DEPTH = "feed_per_tooth_m", "depth_m"
ENGAGEMENT = frozenset({"start_angle_deg", "exit_angle_deg", "immersion", "radial_depth_m"})


@step
def cut_identify(
    cutting: Annotated[File, Reads("CUT.toml")],
    /,
    *recordings: Annotated[File, Reads("REC...")],
    depth: Annotated[float, Typed("M")] | None = None,
    feeds: Annotated[str | Sequence[float] | None, Typed("M,M,...", str)] = None,
    speed: Speed | None = None,
    axes: Annotated[str | None, Typed("X,Y,Z", str)] = None,
    highest: Annotated[float, Typed("HZ")] | None = None,
    stream: str | None = None,
    dynamometer: Annotated[File | None, Reads("FRF")] = None,
    out: Annotated[File | None, Writes(suffixes=(".toml",), needed=True)] = None,
    picture: Picture = None,
) -> CutCoefficients:
    """Identify force coefficients and runout from the forces of cuts at several feeds.

    Axes, signs and the number of teeth are checked by trying every other one. Compared are all orders of the spindle;
    the mean forces are the second witness. With edge_radius_m in the cutting file, F-tests decide whether the force
    needs exponents of the chip thickness, edge forces, or both.

    Parameters
    ----------
    cutting
        Cutter, and engagement of recordings that state none; force coefficients may be missing.
    recordings
        Forces at the tool tip of cuts that differ in feed, or of speed sweeps in several immersions; three or more are
        best. Engagement, depth and feed are those of each set-up where it states them.
    depth : m
        Axial depth of the cuts; without it that of each set-up.
    feeds : m
        Feed per tooth of each recording, in their order; without it that of its set-up.
    speed : rpm
        Spindle speed within 2 %; without it the speed that each recording states.
    axes
        Measured direction along X, Y and Z of the cut, such as +Y,+X,-Z, or -X,-Y,-Z for a dynamometer under the
        workpiece; without it as the channels state.
    highest : Hz
        Highest frequency that is compared; without it the fourth harmonic of the tooth passing, or the end of the
        dynamometer's FRF.
    stream
        Sample clock; needed where a recording has several.
    dynamometer
        FRF of measured over applied force, from taps on the dynamometer with the workpiece on it; without it one mode
        along each axis is inferred where that predicts left-out cuts.
    out
        Cutting file to write, with coefficients, their errors and the runout.
    picture
        Picture to write: forces over a revolution, measured and computed, and mean forces over the feed.

    Returns
    -------
    CutCoefficients
        Coefficients with their errors, the runout, and the forces of each cut.

    Raises
    ------
    InputError
        Files that cannot be used, feeds that are missing, or forces that fit with other axes or teeth only.

    Examples
    --------
    ::

        $ millfrf cut identify cutter.toml f25.h5 f50.h5 f75.h5 --depth 0.003 --feeds 25e-6,50e-6,75e-6 --out cut.toml
    """
    paths = [Path(recording) for recording in recordings]
    check_several(recordings)
    process, warnings = read_checked_cutter(cutting)
    stated = _stated_cuts(paths, process, depth, feeds)
    depths = sorted({cut.depth for cut in stated})
    warnings += [doubt for each in depths for doubt in check_depth(each, process, "depth")]
    warnings += [doubt for cut in stated for doubt in check_feed(cut.process.feed_per_tooth)]
    turned = () if axes is None else tuple(axes.split(","))
    tapped = None if dynamometer is None else read_dynamometer(dynamometer)
    warnings += [] if tapped is None else tapped.warnings
    cuts = []
    channels: tuple[str, ...] = ()
    for path, known in zip(paths, stated, strict=True):
        cut, channels = read_cut_forces(
            path,
            known.process,
            known.depth,
            speed=None if speed is None else speed * RPM,
            highest=highest,
            stream=stream,
            dynamometer=tapped,
        )
        cuts.append(cut)
    with progress("fitting the forces"):
        result = identify_coefficients(cuts, channels, turned)
    result = replace(result, warnings=(*warnings, *result.warnings, *check_cutting(result.process)))
    if out is not None:
        options = {"depths_m": [cut.depth for cut in stated], "feeds_m": [cut.process.feed_per_tooth for cut in stated],
                   "speed_rpm": speed, "axes": axes, "highest_hz": highest, "stream": stream}  # fmt: skip
        inputs = [cutting, *paths, *([] if dynamometer is None else [dynamometer])]
        comments = [
            f"provenance: {made('cut identify', inputs, options)}",
            *(f"warning: {text}" for text in result.warnings),
        ]
        write_cutting_process(out, result.process, comments)
    if picture is not None:  # matplotlib loads slowly
        from millfrf.figures import cut_coefficients_figure, save_figure

        save_figure(cut_coefficients_figure(result), Path(picture))
    warn(result.warnings)
    tell(lambda: coefficients_answer(result))
    show(coefficients_table(result))
    for line in coefficient_lines(result):
        say(line)
    say_written([file for file in (out, picture) if file is not None])
    return result


@dataclass(frozen=True)
class _Cut:
    """Conditions of one recording: those of the options, else of its set-up, else of the cutting file."""

    process: MillingProcess
    depth: float


def _stated_cuts(
    paths: Sequence[Path], process: MillingProcess, depth: float | None, feeds: str | Sequence[float] | None
) -> list[_Cut]:
    """Return the conditions of each recording."""
    if not paths:
        raise InputError("no recording is given; give the forces of one cut or more")
    tables = [_stated(path) for path in paths]
    given = _given_feeds(paths, process, tables, feeds)
    cuts = []
    for path, table, feed in zip(paths, tables, given, strict=True):
        if not (math.isfinite(feed) and feed > 0):
            raise InputError(f"{path.name}: feed per tooth {feed} m must be positive")
        stated = depth if depth is not None else table.get(DEPTH)
        if stated is None:
            raise InputError(f"{path.name}: no depth is stated; give --depth, or {DEPTH} in [cut] of its set-up")
        start, leave = _engagement(path, table, process)
        engaged = replace(process, feed_per_tooth=feed, start_angle=start, exit_angle=leave)
        cuts.append(_Cut(engaged, float(stated)))
    return cuts


def _engagement(path: Path, table: Mapping[str, Any], process: MillingProcess) -> tuple[float, float]:
    """Return start and exit angle (rad) of a set-up, else those of the cutting file."""
    try:
        if "immersion" in table:
            return immersion_angles(table["immersion"], float(table.get("radial_depth_m", 0.0)), process.diameter)
        if "start_angle_deg" in table and "exit_angle_deg" in table:
            return math.radians(float(table["start_angle_deg"])), math.radians(float(table["exit_angle_deg"]))
    except InputError as error:
        raise InputError(f"{path.name}: {error}") from error
    return process.start_angle, process.exit_angle


def _stated(path: Path) -> dict[str, Any]:
    """Return what the set-up of a recording states of cutter and cut."""
    with opened(path) as recording:
        tables = tables_of_setup(recording.setup)
    cutting, cut = dict(tables.get("cutting", {})), tables.get("cut", {})
    if cut.keys() & ENGAGEMENT:  # another form of it would contradict
        cutting = {key: value for key, value in cutting.items() if key not in ENGAGEMENT}
    return cutting | cut


def _given_feeds(
    paths: Sequence[Path],
    process: MillingProcess,
    tables: Sequence[Mapping[str, Any]],
    feeds: str | Sequence[float] | None,
) -> list[float]:
    if feeds is not None:
        given = list(_numbers(feeds) if isinstance(feeds, str) else feeds)
        if len(given) != len(paths):
            raise InputError(
                f"{counted(len(given), 'feed')} for {counted(len(paths), 'recording')}: give one for each, in their "
                "order, such as --feeds 25e-6,50e-6"
            )
        return [float(feed) for feed in given]
    stated = [table.get(FEED) for table in tables]
    if len(paths) == 1 and stated[0] is None and process.feed_per_tooth > 0:
        return [process.feed_per_tooth]
    missing = [path.name for path, feed in zip(paths, stated, strict=True) if feed is None]
    if missing:
        raise InputError(
            f"{', '.join(missing)}: no feed per tooth is stated; give --feeds, one for each recording, in metres "
            f"and in their order, or {FEED} in [cut] of their set-up"
        )
    return [float(feed) for feed in stated if feed is not None]


def _numbers(text: str) -> list[float]:
    try:
        return [float(word) for word in text.split(",")]
    except ValueError:
        raise InputError(
            f"feeds {text!r} are no numbers; give metres per tooth with commas between, such as --feeds 25e-6,50e-6"
        ) from None


def coefficients_table(result: CutCoefficients) -> Table:
    """Table of the coefficients with two standard errors, and of those from the mean forces alone."""
    rows = []
    for k, symbol in enumerate(COEFFICIENT_SYMBOLS):
        factor, unit = (1e-6, "MPa") if k < 3 else (1e-3, "N/mm")
        if not math.isfinite(result.coefficients[k]):
            continue
        fitted = result.fit.coefficients[k], math.sqrt(result.fit.covariance[k, k])
        pairs = (
            (result.coefficients[k], result.errors[k]),
            fitted,
            (result.mean_coefficients[k], result.mean_errors[k]),
        )
        rows.append((f"{symbol} ({unit})", *(_with_two_errors(factor * v, factor * e) for v, e in pairs)))
    for k, symbol in enumerate(COEFFICIENT_SYMBOLS[:3]):
        if result.exponent_errors[k] > 0:
            used = _with_two_errors(result.exponents[k], result.exponent_errors[k])
            rows.append((f"exponent of {symbol}", used, used, "-"))
    return Table(
        "Force coefficients (± 2 standard errors)",
        ("coefficient", f"used: {result.method}", "waveforms", "mean forces"),
        tuple(rows),
    )


def _with_two_errors(value: float, error: float) -> str:
    return with_error(value, 2 * error) if math.isfinite(value) else "-"


def coefficient_lines(result: CutCoefficients) -> list[str]:
    """Sentences on runout, on the law of the force, and on how well the forces are explained."""
    runout, error = math.hypot(*result.fit.runout), max(result.fit.runout_error)
    cuts, process = len(result.cuts), result.process
    lines = [
        f"of the root mean square of the forces {100 * result.fit.misfit:.2g} % is not explained ({cuts} "
        f"{'cut' if cuts == 1 else 'cuts'}, spindle orders 0 to {min(cut.top for cut in result.cuts)})"
    ]
    if result.law is not None:
        lines.append(result.law.sentence)
    if process.chip_law.varies:
        at_unit = result.coefficients[:3] * (process.chip_law.reference / 1e-3) ** result.exponents
        values = ", ".join(f"{1e-6 * value:.4g}" for value in at_unit[np.isfinite(at_unit)])
        lines.append(
            f"the coefficients hold at a chip of {1e6 * process.chip_law.reference:.3g} µm; at 1 mm, as in tables of "
            f"Kienzle's kc1.1, the law gives {values} MPa"
        )
    if process.teeth > 1:
        lines.append(f"runout {1e6 * runout:.1f} ± {2e6 * error:.1f} µm")
    return lines


def coefficients_answer(result: CutCoefficients) -> dict[str, Any]:
    """Coefficients, runout and misfit as numbers; unknown ones become null in JSON."""
    names = ("ktc_pa", "krc_pa", "kac_pa", "kte_n_per_m", "kre_n_per_m", "kae_n_per_m")
    return {
        "method": result.method,
        "coefficients": dict(zip(names, result.coefficients, strict=True)),
        "standard_errors": dict(zip(names, result.errors, strict=True)),
        **_law_answer(result),
        "mean_forces": dict(zip(names, result.mean_coefficients, strict=True)),
        "runout_m": float(np.hypot(*result.fit.runout)),
        "runout_p_value": result.fit.runout_chance,
        "misfit": result.fit.misfit,
        "cuts": [_cut_answer(cut) for cut in result.cuts],
    }


def _law_answer(result: CutCoefficients) -> dict[str, Any]:
    """Exponents of the chip thickness and the F-tests of the law; nothing where no law was chosen."""
    if result.law is None:
        return {}
    names = ("ktc_exponent", "krc_exponent", "kac_exponent")
    return {
        "exponents": dict(zip(names, result.exponents, strict=True)),
        "exponent_standard_errors": dict(zip(names, result.exponent_errors, strict=True)),
        "reference_chip_m": result.process.chip_law.reference,
        "without_exponents_p_value": result.law.without_exponents,
        "without_edges_p_value": result.law.without_edges,
    }


def _cut_answer(cut: CutForces) -> dict[str, Any]:
    process = cut.process
    return {
        "name": cut.name,
        FEED: process.feed_per_tooth,
        DEPTH: cut.depth,
        "start_angle_deg": math.degrees(process.start_angle),
        "exit_angle_deg": math.degrees(process.exit_angle),
    }
