"""Sections on stability: lobes, a recommended cut, verdicts on recorded cuts."""

import math
from dataclasses import dataclass

import numpy as np

from millfrf.core import InputError
from millfrf.core.terminal import Table
from millfrf.cutting import (
    MillingProcess,
    approach_angle_of,
    coefficients_in_words,
    edges_in_words,
    law_in_words,
    shape_in_words,
)
from millfrf.figures import (
    Advice,
    LobesBand,
    ShownCut,
    StableAbove,
    TriedCut,
    advice_figure,
    chatter_figure,
    lobes_figure,
    shows_chatter,
    zoomed_limits,
)
from millfrf.stability import KeptCut, StabilityLobes

from ..collection import Collected
from ..lobes_check import CheckedLobes, checked_lobes, lobes_warnings, searched_depth, stable_above
from ..recommendation import Recommendation, recommendation, shown_depth
from ..section import Picture, Section, picture_of
from ..tables import tone_table, verdict_table

DIFFERS = 0.1  # relative difference of two depth limits that counts as different advice


@dataclass(frozen=True)
class StabilityFindings:
    """The section on stability, with the answer, its picture and the warnings for the head of the page.

    Parameters
    ----------
    section
        The section.
    answer
        The recommended cut, or the lowest limit, in one sentence; empty without lobes.
    picture
        Limits with the recommended cut; None without lobes.
    warnings
        Warnings, one sentence each.
    recommended
        Recommended cut with its reasons; None without lobes.
    process
        Milling process of the limits; None: not known.
    advice
        Content of the picture; None without lobes.
    """

    section: Section
    answer: tuple[str, ...] = ()
    picture: Picture | None = None
    warnings: tuple[str, ...] = ()
    recommended: Recommendation | None = None
    process: MillingProcess | None = None
    advice: Advice | None = None


def stability_findings(collected: Collected) -> StabilityFindings:
    """Draw and list all lobes and compare them with the certified limits; the most exact lobes come first."""
    if not collected.lobes:
        return StabilityFindings(Section("Stability lobes"))
    checked = checked_lobes(collected)
    curves = dict(check.headline for check in checked)
    advised = recommendation(checked[0])
    sentences = [_cutter(file.path.name, process) for file, process in collected.cutting]
    sentences += [_method(check) for check in checked] + list(advised.sentences)
    tables = [lobes_table(curves, {check.headline[0]: _deepest(check) for check in checked})]
    (first_name, first), *others = curves.items()
    for name, lobes in others:
        table = advice_table(first, lobes, first_name, name)
        if table.rows:
            tables.append(table)
        else:
            sentences.append(f"{first_name} and {name} agree within {100 * DIFFERS:.0f} % at every speed.")
    lowest = _lowest(first_name, first)
    advice = _advice(checked[0], advised)
    pictures = _compared(curves, checked, advice)
    section = Section("Stability lobes", (*lowest, *sentences), tuple(tables), pictures)
    # doubtful limits are not stated first
    answer = advised.headline if advised.cut is not None or advised.warnings else (*lowest, *advised.headline)
    warnings = (*lobes_warnings(checked, collected), *advised.warnings)
    return StabilityFindings(
        section, answer, _decisive(first_name, advice), warnings, advised, checked[0].process, advice
    )


def _advice(leading: CheckedLobes, advised: Recommendation) -> Advice:
    """Join the first limits, their interval and the recommended cut."""
    first, band, cut = leading.headline[1], None, None
    unmeasured = np.array(first.band) == "unmeasured"
    if advised.band is not None and not unmeasured.all():
        # an interval of errors alone would belittle dynamics that were not measured
        low = np.where(unmeasured, np.nan, advised.band.low)
        band = LobesBand(first.spindle_speeds_rpm, low, np.minimum(advised.band.high, 1.5 * leading.max_depth))
    if advised.cut is not None:
        cut = TriedCut(advised.cut.spindle_speed * 30 / math.pi, advised.cut.depth, "recommended")
    return Advice(first, cut, 0.0 if advised.cut is None else advised.cut.drift, band, _islands(leading))


def _decisive(name: str, advice: Advice) -> Picture:
    """Draw the picture for the head of the page."""
    caption = f"Depth limit over spindle speed ({name}); cuts in the grey area are unstable."
    if advice.cut is not None:
        caption += f" Bar at the star: speeds within {100 * advice.drift:g} %."
    caption += _hatching(advice)
    return picture_of(advice_figure(advice), caption, "Depth limit over spindle speed and the recommended cut")


def _hatching(advice: Advice) -> str:
    """Explain broken lines and hatched areas."""
    lobes = advice.lobes
    text = " Hatched: stable above an island of instability." if advice.stable_above else ""
    if "unmeasured" in lobes.band:
        text += " Dotted: limits that dynamics which were not measured may lower or raise by more than 5 %."
    if "uncertain" in lobes.model:
        text += (
            " Dashed: limits whose 95 % interval, from the errors of the structure, is wider than 7 %, or which edge "
            "forces lower by more."
        )
    return text


def _compared(
    curves: dict[str, StabilityLobes], checked: tuple[CheckedLobes, ...], advice: Advice
) -> tuple[Picture, ...]:
    """Draw all limits with chatter frequencies."""
    drawn = curves | {f"{check.file.label}, as given": check.given for check in checked if check.wrong}
    caption = "Largest stable axial depth over spindle speed."
    if shows_chatter(drawn):
        caption = "(a) Largest stable axial depth over spindle speed; (b) chatter frequency at the limit."
    words = f"Stability lobes: depth limit over spindle speed of {', '.join(drawn)}"
    drawing = lobes_figure(drawn, (), advice.band, advice.stable_above)
    zoomed = zoomed_limits(drawn, advice.band, advice.stable_above)
    return (picture_of(drawing, caption + _hatching(advice), words, zoomed=zoomed),)


def _islands(leading: CheckedLobes) -> tuple[StableAbove, ...]:
    """Return the stable depths above islands of instability of the first lobes; none without structure and cut."""
    if leading.structure is None or leading.process is None or leading.certified is None:
        return ()
    try:
        return stable_above(leading.structure[1], leading.process, leading.headline[1], leading.max_depth)
    except InputError:
        return ()


def _lowest(name: str, lobes: StabilityLobes) -> tuple[str, ...]:
    """State the lowest limit and its chatter; nothing if no limit is known."""
    if not np.isfinite(lobes.depth_limits).any():
        return ()
    lowest = int(np.nanargmin(lobes.depth_limits))
    kind = ", period doubling" if lobes.bifurcations[lowest] == "period-doubling" else ""
    frequency = lobes.chatter_frequencies[lowest]
    chatter = f", chatter at {frequency:.2f} Hz{kind}" if np.isfinite(frequency) else ""
    return (
        f"{name}: the lowest depth limit is {shown_depth(float(lobes.depth_limits[lowest]))} at "
        f"{lobes.spindle_speeds_rpm[lowest]:.0f} rpm{chatter}.",
    )


def _method(check: CheckedLobes) -> str:
    """Describe the method and the status of a file's limits."""
    status = {name: check.given.status.count(name) for name in dict.fromkeys(check.given.status)}
    counted = ", ".join(f"{count} {name}" for name, count in status.items())
    if check.structure is None:
        return f"{check.file.path.name}: {check.method}; limits by status: {counted}."
    result = "not the stability limits of this cut" if check.wrong else "the certified ones"
    return (
        f"{check.file.path.name}: {check.method}, of {check.structure[0].path.name}; its limits are {result} (by "
        f"status: {counted})."
    )


def advice_table(first: StabilityLobes, second: StabilityLobes, first_name: str, second_name: str) -> Table:
    """List ranges of spindle speed in which two limits differ by more than a tenth, with the largest difference."""
    low, high = (f(first.spindle_speeds) for f in (np.min, np.max))
    inside = (second.spindle_speeds >= low) & (second.spindle_speeds <= high)
    speeds = second.spindle_speeds[inside]
    ours = np.interp(speeds, first.spindle_speeds, np.nan_to_num(first.depth_limits, posinf=1e3))
    theirs = np.nan_to_num(second.depth_limits[inside], posinf=1e3)
    known = ~np.isnan(np.interp(speeds, first.spindle_speeds, first.depth_limits)) & ~np.isnan(
        second.depth_limits[inside]
    )
    ratio = np.where(known, theirs, 1.0) / np.where(known, ours, 1.0)
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


def _coefficients(p: MillingProcess) -> str:
    edges = edges_in_words(p)
    return coefficients_in_words(p) + law_in_words(p) + (f", {edges}" if edges else "")


def _cutter(name: str, p: MillingProcess) -> str:
    if p.is_turning:
        return (
            f"Turning of {name}: edge at {np.degrees(approach_angle_of(p)):g}° to the feed, workpiece of "
            f"{1e3 * p.diameter:g} mm, {_coefficients(p)}, feed "
            f"{1e3 * p.feed_per_tooth:g} mm a revolution{_shape(p)}."
        )
    return (
        f"Cutter of {name}: {p.teeth} teeth, {1e3 * p.diameter:g} mm, edge angle {np.degrees(p.edge_angle):g}°, "
        f"{_coefficients(p)}, "
        f"immersion {np.degrees(p.start_angle):g}° to {np.degrees(p.exit_angle):g}°, "
        f"feed {1e3 * p.feed_per_tooth:g} mm a tooth{_shape(p)}."
    )


def _shape(p: MillingProcess) -> str:
    words = shape_in_words(p)
    if max(p.helices) > 0 and len(set(p.helices)) == 1:
        words = ", ".join(filter(None, [f"helix {np.degrees(p.helices[0]):g}°", words]))
    return f"; {words}" if words else ""


def lobes_table(curves: dict[str, StabilityLobes], deepest: dict[str, float], most: int = 12) -> Table:
    """Make a table of the depth limits of all curves at some speeds of the first curve.

    Parameters
    ----------
    curves
        Lobes by name.
    deepest : m
        Largest depth of the search, by the same names; 0: not known.
    most
        Number of evenly spaced speeds; the lowest limit and both sides of each change of type are added.
    """
    first = next(iter(curves.values()))
    rpm = first.spindle_speeds_rpm
    even = np.linspace(0, len(rpm) - 1, min(most, len(rpm))).round().astype(int)
    chosen = sorted({*even.tolist(), *_telling(first, 2 * most)})
    columns = ["spindle speed (rpm)"]
    columns += [f"{name} (mm)" for name in curves]
    columns += ["chatter frequency (Hz)", "type", "status"]
    rows = []
    for k in chosen:
        depths = [
            _depth_at(lobes.spindle_speeds_rpm, lobes.depth_limits, rpm[k], deepest[name])
            for name, lobes in curves.items()
        ]
        frequency = first.chatter_frequencies[k]
        shown = f"{frequency:.2f}" if np.isfinite(frequency) else ""
        rows.append((f"{rpm[k]:.0f}", *depths, shown, first.bifurcations[k], first.status[k]))
    return Table("", tuple(columns), tuple(rows))


def _deepest(checked: CheckedLobes) -> float:
    """Return the largest depth (m) searched for the limits that the page shows first; 0 if it is not known."""
    if checked.certified is not None and checked.wrong:
        return checked.max_depth
    return searched_depth(checked.file, checked.given, checked.process)


def _telling(lobes: StabilityLobes, most: int) -> set[int]:
    """Return the numbers of the speeds that a table must contain.

    These are the speed of the lowest limit, and the speeds before and after each change of the bifurcation type; the
    changes are left out if they give more than ``most`` speeds.
    """
    known = np.isfinite(lobes.depth_limits)
    lowest = {int(np.where(known, lobes.depth_limits, np.inf).argmin())} if known.any() else set()
    kinds = lobes.bifurcations
    changes = [k for k in range(1, len(kinds)) if kinds[k] != kinds[k - 1]]
    sides = {k for change in changes for k in (change - 1, change)}
    return lowest | (sides if len(sides) <= most else set())


def _depth_at(rpm: np.ndarray, depths: np.ndarray, wanted: float, max_depth: float) -> str:
    """Format the depth limit (mm) at the speed nearest to ``wanted``; return an empty text if no speed is near."""
    nearest = int(np.argmin(np.abs(rpm - wanted)))
    if abs(rpm[nearest] - wanted) > 0.5:
        return ""
    if np.isnan(depths[nearest]):
        return "not resolved"
    if np.isfinite(depths[nearest]):
        return f"{1e3 * depths[nearest]:.3f}"
    return f"none up to {1e3 * max_depth:.3g} mm" if max_depth > 0 else "no limit"


PER_FIGURE = 3  # cuts in one figure
MAX_SPECTRA = 12  # spectra that are drawn: unstable and uncertain cuts first


def chatter_section(collected: Collected) -> Section:
    """Show the verdict on each cut, tones of other sources, and spectra."""
    sentences, tables, pictures = [], [], []
    for file, kept in collected.chatter:
        cuts = [judged.cut for judged in kept]
        sentences += [f"{cut.name}: {cut.verdict.kind}: {cut.verdict.reason}" for cut in cuts]
        tables.append(verdict_table(cuts))
        if any(cut.verdict.foreign for cut in cuts):
            tables.append(tone_table(cuts))
        shown = sorted(kept, key=lambda judged: judged.cut.verdict.kind == "stable")[:MAX_SPECTRA]
        if len(shown) < len(kept):
            sentences.append(f"{file.path.name}: spectra of {len(shown)} of {len(kept)} cuts are drawn.")
        pictures += [_picture(file.path.name, shown[i : i + PER_FIGURE]) for i in range(0, len(shown), PER_FIGURE)]
    return Section("Was it chatter?", tuple(sentences), tuple(tables), tuple(pictures))


def chatter_in_brief(collected: Collected) -> list[str]:
    """Summarise the verdicts on the cuts of each file in one sentence."""
    sentences = []
    for file, kept in collected.chatter:
        verdicts = "; ".join(f"{each.cut.name} {each.cut.verdict.in_words}" for each in kept)
        sentences.append(f"{file.path.name}: {verdicts}.")
    return sentences


def _picture(name: str, kept: list[KeptCut]) -> Picture:
    caption = (
        f"{name}: spectra of the second half of each cut in the channel that shows it best, a value being the root "
        "mean square of one line. Spindle orders (grey) repeat with every revolution and are removed; the remaining "
        "spectrum (solid) is compared with the recording's own noise floor (dashed). Gaps: hidden by an order. Named "
        "lines are labelled."
    )
    return picture_of(chatter_figure([ShownCut.of(cut) for cut in kept]), caption, "Spectra of classified cuts")
