"""Sheet of one A4 page for the machine: the recommended cut, its limits, and what was not measured."""

import math
import os

import numpy as np

from millfrf.core import InputError, counted
from millfrf.cutting import MillingProcess, coefficients_in_words, edges_in_words
from millfrf.figures import SheetContent, save_figure, sheet_figure
from millfrf.stability import CONFIDENCE, RecommendedCut, StabilityLobes

from .recommendation import shown_depth
from .results_page import DEFAULT_TITLE, ResultsPage, doubts_of
from .sections.stability import StabilityFindings


def write_sheet(path: str | os.PathLike[str], page: ResultsPage, stability: StabilityFindings) -> None:
    """Write the sheet of a report's recommended cut.

    Parameters
    ----------
    path
        File to write, ``.pdf`` or ``.png``.
    page
        Head of the report, with its warnings.
    stability
        Lobes and recommended cut of the report.

    Raises
    ------
    InputError
        A report without lobes.
    """
    if stability.advice is None:
        raise InputError("no sheet without stability lobes: add a lobes file, its model and its cutting file")
    (answer, *deductions), stated = stability.answer, set(stability.answer)
    chosen = doubts_of([warning for warning in page.warnings if warning not in stated])
    doubts = (*deductions, *chosen.opened)
    title = "Cut for the machine" if page.title == DEFAULT_TITLE else page.title
    content = SheetContent(
        title, page.subtitle, answer, sheet_rows(stability), doubts, stability.advice, len(chosen.folded)
    )
    save_figure(sheet_figure(content), path)


def sheet_rows(stability: StabilityFindings) -> tuple[tuple[str, str], ...]:
    """List speed, depth, width, feed, removal rate, limit and confidence of the recommended cut; none without one."""
    cut = None if stability.recommended is None else stability.recommended.cut
    if cut is None or stability.process is None or stability.advice is None:
        return ()
    process, lobes = stability.process, stability.advice.lobes
    rpm = cut.spindle_speed * 30 / math.pi
    rows = [("Spindle speed", f"{rpm:.0f} rpm"), ("Depth of cut", shown_depth(cut.depth))]
    rows += [*_feed_and_rate(process, cut), *_cutter_and_coefficients(process)]
    rows.append(("Limit of stability there", limit_near(lobes, rpm)))
    confidence = f"{100 * CONFIDENCE:g} %, speed within {100 * cut.drift:g} %"
    return (*rows, ("Confidence of stability", confidence))


def limit_near(lobes: StabilityLobes, rpm: float) -> str:
    """Describe the limit at a spindle speed (rpm): the lower one of the two nearest speeds, and whether it is known."""
    speeds = lobes.spindle_speeds_rpm
    nearest = np.argsort(np.abs(speeds - rpm))[: 1 if np.isclose(speeds, rpm).any() else 2]
    lowest = float(np.min(lobes.depth_limits[nearest]))  # NaN if one of both is not known
    if math.isnan(lowest):
        return "not resolved"
    text = shown_depth(lowest) if math.isfinite(lowest) else "none found"
    measured = not any(lobes.band[place] == "unmeasured" for place in nearest) if lobes.band else True
    return text if measured else f"{text} before deductions"


def _feed_and_rate(process: MillingProcess, cut: RecommendedCut) -> list[tuple[str, str]]:
    """Return width of cut, feed and removal rate of a milling cut; only the feed of a turning cut."""
    rpm = cut.spindle_speed * 30 / math.pi
    if process.is_turning:
        return [("Feed", f"{1e3 * process.feed_per_tooth:.3g} mm a revolution")]
    width = radial_width(process)
    rows = [("Width of cut", f"{1e3 * width:.3g} mm of {1e3 * process.diameter:g} mm diameter")]
    if process.feed_per_tooth > 0:
        feed = process.feed_per_tooth * process.teeth * rpm  # m/min
        rows.append(
            ("Feed", f"{1e3 * process.feed_per_tooth:.3g} mm a tooth, {1e3 * feed:.4g} mm/min, towards +X of the tip")
        )
        rows.append(("Removal rate", f"{1e6 * feed * width * cut.depth:.3g} cm³/min"))
    return rows


def _cutter_and_coefficients(process: MillingProcess) -> list[tuple[str, str]]:
    """Return the cutter with its engagement, and the force coefficients, which the machine's operator can check."""
    rows = [("Coefficients", coefficients_in_words(process))]
    if edges := edges_in_words(process):
        rows.append(("Edge coefficients", edges))
    if process.is_turning:
        return rows
    angles = sorted({round(math.degrees(angle), 1) for angle in process.helices})
    helix = f", helix {' and '.join(f'{angle:g}' for angle in angles)}°" if any(angles) else ""
    return [("Cutter", f"{counted(process.teeth, 'edge')}{helix}, {engagement_in_words(process)}"), *rows]


def engagement_in_words(process: MillingProcess) -> str:
    """Name the engagement: a slot, up or down milling, or the angles of entry and exit.

    Up milling begins with a thin chip at 0, down milling ends with one at 180 degrees.
    """
    start, leave = math.degrees(process.start_angle), math.degrees(process.exit_angle)
    at_start, at_end = math.isclose(start, 0, abs_tol=0.1), math.isclose(leave, 180, abs_tol=0.1)
    if at_start and at_end:
        return "slot"
    angles = f"{start:.4g} to {leave:.4g}°"
    return f"up milling, {angles}" if at_start else f"down milling, {angles}" if at_end else f"engaged from {angles}"


def radial_width(process: MillingProcess) -> float:
    """Return the radial width of cut (m) between the angles of entry and exit.

    The width is ``D (cos phi_start - cos phi_exit) / 2`` with the diameter D; angles are measured from the direction
    across the feed.
    """
    return process.diameter * (math.cos(process.start_angle) - math.cos(process.exit_angle)) / 2
