"""The section on stability: lobes with their band, a recommended cut, and where two measurements differ in advice."""

import math

import numpy as np

from cutting import MillingProcess
from estimation import Frf
from foundation import InputError
from modal_fit import ModalModel
from stability import RecommendedCut, StabilityLobes, depth_errors, recommended_cut, zero_order

from ..figures.embed import as_data_uri
from ..figures.lobes_figure import Band, lobes_figure
from ..tables import Table
from .collect import Collected
from .section import Picture, Section

CONFIDENCE, DRIFT = 0.95, 0.02
"""Of the recommended cut: probability of stability, and relative drift of the spindle's speed."""

DIFFERS = 0.1
"""Relative difference of two depth limits that counts as different advice."""


def lobes_section(collected: Collected) -> Section:
    """All lobes in one figure and one table, with the band of the first where its structure is among the files."""
    if not collected.lobes:
        return Section("Stability lobes")
    curves = {file.label: lobes for file, lobes in collected.lobes}
    sentences = [_cutter(file.path.name, process) for file, process in collected.cutting]
    band, cut = _band(collected)
    if cut is not None:
        sentences.append(
            f"Most material at {100 * CONFIDENCE:.0f} % confidence of stability, the speed drifting by "
            f"{100 * DRIFT:.0f} %: {1e3 * cut.depth:.2f} mm at {cut.spindle_speed * 30 / math.pi:.0f} rpm "
            "(zero-order limit less its error; the errors of the cutting coefficients are not in it)."
        )
    tables = [_lobes_table(collected)]
    first_file, first = collected.lobes[0]
    for file, lobes in collected.lobes[1:]:
        table = advice_table(first, lobes, first_file.label, file.label)
        if table.rows:
            tables.append(table)
        else:
            sentences.append(
                f"{first_file.label} and {file.label} advise the same within {100 * DIFFERS:.0f} % at every speed."
            )
    caption = "(a) Largest stable axial depth over spindle speed; (b) chatter frequency at the limit."
    if band is not None:
        caption += f" Light band: 95 % interval of {next(iter(curves))}, from the covariance of its modal model."
    picture = Picture(as_data_uri(lobes_figure(curves, band=band)), caption, "Stability lobes")
    return Section("Stability lobes", tuple(sentences), tuple(tables), (picture,))


def advice_table(first: StabilityLobes, second: StabilityLobes, first_name: str, second_name: str) -> Table:
    """Ranges of spindle speed in which two depth limits differ by more than a tenth, with the largest difference."""
    low, high = (f(first.spindle_speeds) for f in (np.min, np.max))
    inside = (second.spindle_speeds >= low) & (second.spindle_speeds <= high)
    speeds = second.spindle_speeds[inside]
    ours = np.interp(speeds, first.spindle_speeds, np.nan_to_num(first.depth_limits, posinf=1e3))
    theirs = np.nan_to_num(second.depth_limits[inside], posinf=1e3)
    ratio = theirs / ours
    differs = np.abs(np.log(ratio)) > np.log(1 + DIFFERS)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], differs.astype(int), [0]])))
    rows = []
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        worst = start + int(np.argmax(np.abs(np.log(ratio[start:stop]))))
        rpm = speeds * 30 / math.pi
        rows.append(
            (
                f"{rpm[start]:.0f} to {rpm[stop - 1]:.0f}",
                f"{rpm[worst]:.0f}",
                _depth(ours[worst]),
                _depth(theirs[worst]),
                f"{100 * (ratio[worst] - 1):+.0f} %" if ratio[worst] < 100 else "no limit",
            )
        )
    columns = ("speeds (rpm)", "worst at (rpm)", f"{first_name} (mm)", f"{second_name} (mm)", "difference")
    return Table(f"Where {second_name} advises otherwise than {first_name}", columns, tuple(rows))


def _depth(metres: float) -> str:
    return f"{1e3 * metres:.2f}" if metres < 100 else "no limit"


def _cutter(name: str, p: MillingProcess) -> str:
    return (
        f"Cutter of {name}: {p.teeth} teeth, {1e3 * p.diameter:g} mm, edge angle {np.degrees(p.edge_angle):g}°, "
        f"Ktc {p.ktc / 1e6:g} MPa, krc {p.krc:g}, kac {p.kac:g}, immersion {np.degrees(p.start_angle):g}° to "
        f"{np.degrees(p.exit_angle):g}°, feed {1e3 * p.feed_per_tooth:g} mm a tooth."
    )


def _band(collected: Collected) -> tuple[Band | None, RecommendedCut | None]:
    """The band of the first lobes, by whichever structure among the files gives them."""
    first = collected.lobes[0][1]
    structures: list[ModalModel | Frf] = [model for _, model in collected.models if model.covariance is not None]
    for _, process in collected.cutting:
        for structure in structures:
            found = _errors(structure, process, first)
            if found is None:
                continue
            lobes, errors = found
            half = 1.96 * np.nan_to_num(errors)
            band = Band(lobes.spindle_speeds_rpm, lobes.depth_limits - half, lobes.depth_limits + half)
            try:
                return band, recommended_cut(lobes, errors, confidence=CONFIDENCE, drift=DRIFT)
            except InputError:
                return band, None
    return None, None


def _errors(
    structure: ModalModel | Frf, process: MillingProcess, lobes: StabilityLobes
) -> tuple[StabilityLobes, np.ndarray] | None:
    """Zero-order lobes of a structure and their errors, if these are the lobes that were given."""
    finite = lobes.depth_limits[np.isfinite(lobes.depth_limits)]
    if not len(finite):
        return None
    try:
        again = zero_order(structure, process, lobes.spindle_speeds, 1.01 * float(finite.max()))
        errors = depth_errors(structure, process, again)
    except InputError:  # another point of the structure, or another quantity
        return None
    both = np.isfinite(again.depth_limits) & np.isfinite(lobes.depth_limits)
    if not both.any() or not np.allclose(again.depth_limits[both], lobes.depth_limits[both], rtol=1e-3):
        return None
    return again, errors


def _lobes_table(collected: Collected, most: int = 12) -> Table:
    """Depth limits at up to twelve speeds of the first curve, the others interpolated."""
    first = collected.lobes[0][1]
    rpm = first.spindle_speeds_rpm
    chosen = np.unique(np.linspace(0, len(rpm) - 1, min(most, len(rpm))).round().astype(int))
    columns = ["spindle speed (rpm)"]
    for file, _ in collected.lobes:
        columns += [f"{file.label} (mm)"]
    columns += ["chatter frequency (Hz)", "type"]
    rows = []
    for k in chosen:
        depths = [_depth_at(lobes.spindle_speeds_rpm, lobes.depth_limits, rpm[k]) for _, lobes in collected.lobes]
        frequency = first.chatter_frequencies[k]
        shown = f"{frequency:.2f}" if np.isfinite(frequency) else ""
        rows.append((f"{rpm[k]:.0f}", *depths, shown, first.bifurcations[k]))
    return Table("", tuple(columns), tuple(rows))


def _depth_at(rpm: np.ndarray, depths: np.ndarray, wanted: float) -> str:
    """Depth in mm at the nearest speed, empty where none is near."""
    nearest = int(np.argmin(np.abs(rpm - wanted)))
    if abs(rpm[nearest] - wanted) > 0.5:
        return ""
    return f"{1e3 * depths[nearest]:.3f}" if np.isfinite(depths[nearest]) else "no limit"
