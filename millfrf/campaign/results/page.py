"""Sections of the report of a campaign."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from millfrf.core.terminal import Table
from millfrf.figures import save_figure
from millfrf.reports.section import Fold, Picture, Section, picture_of
from millfrf.reports.tables import with_error

from .drift import Drift, Drifts
from .identity import IdentifiedModes
from .outliers import Deviation, Outliers
from .pictures import MapPanel, MapPlane, draw_maps, draw_trends
from .regression import TIME
from .sets import LowestLimit, SetResults, as_utc
from .trends import DAMPING, DEPTH, FREQUENCY, PooledTrend, Series, Trend

UNITS = {"_c": "°C", "_k": "K", "_n": "N", "_rpm": "rpm", "_hz": "Hz", "_m": "m", "_mm": "mm", "_kg": "kg", "_s": "s"}
"""Units that the end of a label's name states."""


def mode_words(mode: int, frequency: float, quantity: str) -> str:
    """A quantity and its mode.

    Examples
    --------
    >>> mode_words(2, 24.12, "frequency"), mode_words(2, 24.12, "damping ratio"), mode_words(0, 0.0, "depth limit")
    ('mode 2 (24.1 Hz)', 'damping of mode 2 (24.1 Hz)', 'the lowest depth limit')
    """
    if quantity == DEPTH:
        return "the lowest depth limit"
    named = f"mode {mode} ({frequency:.1f} Hz)"
    return f"damping of {named}" if quantity == DAMPING else named


def percent(change: float, half_width: float, *, sign: bool = False) -> str:
    """A relative change with its half width, in per cent.

    Examples
    --------
    >>> percent(0.0182, 0.0031), percent(-0.0003, 0.0004, sign=True)
    ('1.82 ± 0.31 %', '-0.030 ± 0.040 %')
    """
    return f"{with_error(100 * change, 100 * half_width, sign=sign)} %"


def label_words(label: str) -> str:
    """A label's name with its unit, for an axis.

    Examples
    --------
    >>> label_words("temperature_c"), label_words("session"), label_words("time")
    ('temperature (°C)', 'session', 'time (days)')
    """
    if label == TIME:
        return "time (days)"
    for end, unit in UNITS.items():
        if label.endswith(end) and len(label) > len(end):
            return f"{label.removesuffix(end).replace('_', ' ')} ({unit})"
    return label.replace("_", " ")


def span_words(trend: Trend, sets: Sequence[SetResults]) -> str:
    """From which to which value of the label a trend goes.

    Parameters
    ----------
    trend
        The trend of a quantity.
    sets
        Sets of the campaign, for dates.
    """
    low, high = float(np.min(trend.values)), float(np.max(trend.values))
    if trend.label == TIME:
        times = [sets[row].measured.recorded_at for row in trend.rows]
        known = [time for time in times if time is not None]
        return f"from {as_utc(min(known))[:16]} to {as_utc(max(known))[:16]} (UTC)"
    name, unit = _name_and_unit(trend.label)
    return f"from {name} {low:.4g} to {high:.4g}{unit}"


def drift_words(drift: Drift, sets: Sequence[SetResults]) -> str:
    """One drift in a sentence or two, with what else it may be.

    Parameters
    ----------
    drift
        Trend that is more than chance, with its rivals.
    sets
        Sets of the campaign, for names and dates.
    """
    trend, series = drift.trend, drift.trend.series
    told = (
        f"pose {series.pose}: {mode_words(series.mode, series.frequency, series.quantity)} {_verb(trend.change)} by "
        f"{percent(abs(trend.change), trend.half_width)} {span_words(trend, sets)}{_others(drift)}."
    )
    if drift.rests_on is not None:
        told += (
            f" It rests on the set {sets[drift.rests_on].name} alone: cannot tell a drift from one set that is off; "
            "measure this pose once more."
        )
    if drift.as_good:
        rivals = ", ".join(f"{label_words(name)} (correlation {value:+.2f})" for name, value in drift.as_good)
        moved = "moves" if len(drift.as_good) == 1 else "move"
        told += f" In this pose {rivals} {moved} with {label_words(trend.label)}: cannot tell which is the cause."
    return told


def _others(drift: Drift) -> str:
    if drift.others is None:
        return ""
    rest, wanted = drift.others, drift.trend.slope * np.ptp(drift.trend.values)
    change = float(np.expm1(rest.slope * np.ptp(drift.trend.values)))
    width = rest.half_width * np.ptp(drift.trend.values) / rest.span if rest.span else float("nan")
    figure = f"({percent(change, float(width), sign=True)} over the same span, {rest.poses} poses)"
    if abs(change) + width < 0.5 * abs(wanted):
        return f"; the other poses do not {figure}"
    return f"; the other poses on average {figure}"


def pooled_words(pooled: PooledTrend) -> str:
    """A trend of all poses in a sentence.

    Parameters
    ----------
    pooled
        Mean trend over poses.
    """
    name, unit = _name_and_unit(pooled.label)
    return (
        f"all poses: {mode_words(pooled.mode, pooled.frequency, pooled.quantity)} {_verb(pooled.change)} by "
        f"{percent(abs(pooled.change), pooled.half_width)} over {pooled.span:.3g}{unit} of {name} "
        f"(mean of {pooled.poses} poses; they differ by {100 * pooled.between * pooled.span:.2g} %, "
        "one standard deviation)."
    )


def _verb(change: float) -> str:
    return "falls" if change < 0 else "rises"


def _name_and_unit(label: str) -> tuple[str, str]:
    """Name of a label, and its unit with a blank before it where it has one."""
    name, bracket, unit = label_words(label).partition(" (")
    return name, f" {unit.rstrip(')')}" if bracket else ""


def deviation_words(deviations: Sequence[Deviation], sets: Sequence[SetResults]) -> str:
    """The deviations of one set in a sentence.

    Parameters
    ----------
    deviations
        Deviations of one set, one or more.
    sets
        Sets of the campaign, for names.
    """
    parts = [
        f"{mode_words(one.series.mode, one.series.frequency, one.series.quantity)} lies "
        f"{percent(abs(one.change), one.half_width)} {'below' if one.change < 0 else 'above'}"
        for one in deviations
    ]
    row = deviations[0].row
    rivals = sorted({sets[rival].name for one in deviations for rival in one.rivals})
    recordings = sets[row].measured.recordings
    held = f" ({len(recordings)} recordings)" if len(recordings) > 1 else ""
    told = f"{sets[row].name}{held}: {'; '.join(parts)} what the other sets of its pose lead one to expect."
    if rivals:
        told += f" With so few sets it may as well be {' or '.join(rivals)} that is off: cannot tell which."
    return told


MOST_ROWS = 40
"""Rows of a table of what was looked at; the least likely ones are shown."""


def drift_section(drifts: Drifts, sets: Sequence[SetResults], pictures: Sequence[Picture]) -> Section:
    """What drifts, with which label, and what would have been found.

    Parameters
    ----------
    drifts
        Trends that were looked at and found.
    sets
        Sets of the campaign, as read.
    pictures
        Pictures of the drifts.
    """
    if not drifts.count:
        why = (
            "No trend could be looked at: no label of number and no time varies inside a pose, or no pose has enough "
            "sets. Measure poses again, in another session."
        )
        return Section("Drift", (why,))
    sentences = [
        f"{drifts.count} trends were looked at: frequency and damping of each mode and the lowest depth limit, in each "
        "pose and over all poses, with each label of numbers. Named is what is more than chance among so many: without "
        "any drift, at most one campaign in twenty names one (false discovery rate below 5 %). ± is the 95 % interval, "
        "scatter between repeats included."
    ]
    sentences += [drift_words(one, sets) for one in drifts.drifts] + [pooled_words(one) for one in drifts.pooled]
    if not drifts.drifts and not drifts.pooled:
        sentences.append("No drift was found.")
    tables = [_smallest(drifts)] if drifts.smallest else []
    if drifts.suspects:
        tables.append(
            _trend_table("Worth another measurement: three standard errors alone, chance among so many", drifts)
        )
    folds = (Fold("Trends of all poses together", (_pooled_table(drifts.all_pooled),)),) if drifts.all_pooled else ()
    return Section("Drift", tuple(sentences), tuple(tables), tuple(pictures), folds)


def outlier_section(outliers: Outliers, sets: Sequence[SetResults], more: Sequence[str]) -> Section:
    """Sets that stand off the others of their pose, and what else contradicts.

    Parameters
    ----------
    outliers
        Deviations that were looked at and found.
    sets
        Sets of the campaign, as read.
    more
        Further sentences, such as recordings that disagree within a set.
    """
    sentences = [deviation_words(group, sets) for group in deviations_by_set(outliers)]
    if outliers.count and not sentences:
        sentences.append(f"None of {outliers.count} values stands off the other sets of its pose.")
    if not outliers.count:
        sentences.append("No pose has sets enough to tell whether one of them stands off.")
    return Section("Outlying sets and recordings", (*sentences, *more), tables=_scatter_tables(outliers))


def deviations_by_set(outliers: Outliers) -> list[list[Deviation]]:
    """Deviations that belong to one set together, the most certain set first.

    Parameters
    ----------
    outliers
        Deviations that were found.
    """
    groups: dict[int, list[Deviation]] = {}
    for one in outliers.deviations:
        groups.setdefault(one.row, []).append(one)
    return list(groups.values())


def error_bar_sentences(outliers: Outliers) -> list[str]:
    """Say where stated errors are evidently too small or too large against the repeats.

    Parameters
    ----------
    outliers
        Deviations, with the check of the stated errors.
    """
    found = []
    for quantity, check in outliers.error_bars.items():
        if not np.isfinite(check.ratio) or check.p_value > 0.01 or 0.5 < check.ratio < 2.0:
            continue
        factor = float(np.sqrt(check.ratio))
        kind = "too small" if factor > 1 else "too large"
        found.append(
            f"The fits' error bars of the {quantity} are {kind}: repeats scatter {factor:.2g} times as much as they "
            f"say (reduced chi-square {check.ratio:.2g}, {check.freedom} degrees of freedom). Drift and outliers are "
            "judged by the scatter between repeats."
        )
    return found


def _smallest(drifts: Drifts) -> Table:
    rows = tuple((quantity, label_words(label), f"{100 * change:.2g}") for quantity, label, change in drifts.smallest)
    columns = ("quantity", "label", "smallest change (%)")
    return Table(
        "Smallest change from end to end that the typical pose would have shown (probability 80 %)", columns, rows
    )


def _trend_table(title: str, drifts: Drifts) -> Table:
    rows = tuple(_trend_row(one) for one in drifts.suspects[:MOST_ROWS])
    return Table(title, ("pose", "quantity", "label", "change (%)", "probability"), rows)


def _trend_row(one: Trend) -> tuple[str, ...]:
    what = mode_words(one.series.mode, one.series.frequency, one.series.quantity)
    return one.series.pose, what, label_words(one.label), _change(one), f"{one.p_value:.2g}"


def _pooled_table(pooled: Sequence[PooledTrend]) -> Table:
    ordered = sorted(pooled, key=lambda one: (one.p_value, one.mode, one.quantity, one.label))[:MOST_ROWS]
    rows = tuple(
        (
            mode_words(one.mode, one.frequency, one.quantity),
            label_words(one.label),
            str(one.poses),
            _change(one),
            f"{100 * one.between * one.span:.2g}",
            f"{one.p_value:.2g}",
        )
        for one in ordered
    )
    columns = ("quantity", "label", "poses", "mean change (%)", "between poses (%)", "probability")
    return Table("Mean change over the typical span of the label in a pose, ± 95 %", columns, rows)


def _change(one: Trend | PooledTrend) -> str:
    """A change with its sign and half width, for a column in per cent."""
    return percent(one.change, one.half_width, sign=True).removesuffix(" %")


def _scatter_tables(outliers: Outliers) -> tuple[Table, ...]:
    rows = tuple(
        (quantity, "-" if mode == 0 else "several" if mode < 0 else str(mode), f"{100 * value:.2g}")
        for (quantity, mode), value in sorted(outliers.scatter.items())
    )
    if not rows:
        return ()
    title = "Scatter between sets of one pose beyond the fits' error bars, one standard deviation"
    return (Table(title, ("quantity", "mode", "scatter (%)"), rows),)


MOST = 8
"""Sentences of each kind that stand in the verdict; the sections have all."""


def verdict_sentences(
    sets: Sequence[SetResults],
    drifts: Drifts,
    outliers: Outliers,
    more: Sequence[str],
    failed: Sequence[tuple[str, str]],
) -> list[str]:
    """Say what a reader wants first.

    Parameters
    ----------
    sets
        Sets of the campaign, as read.
    drifts, outliers
        What drifts, and what stands off.
    more
        Further sentences on what stands off, such as poses that the posture model contradicts.
    failed
        Name of the set (empty: of the campaign) and reason of each failure.
    """
    usable = sum(one.model is not None for one in sets)
    told = [f"{usable} of {len(sets)} sets have a modal model."]
    told += _cut("Drift: ", _drift_sentences(drifts, sets)) or [
        "No drift was found." if drifts.count else "Nothing can be said of drift: no pose was measured twice."
    ]
    off = [deviation_words(group, sets) for group in deviations_by_set(outliers)]
    told += _cut("Stands off: ", [*off, *more]) or [
        "No set stands off the others of its pose."
        if outliers.count
        else "Nothing can be said of outlying sets: no pose has enough of them."
    ]
    told += _cut("Failed: ", [f"{name}: {line}" if name else line for name, line in failed]) or ["Nothing failed."]
    return told


def _drift_sentences(drifts: Drifts, sets: Sequence[SetResults]) -> list[str]:
    """Poses that drift while not all do, then what all poses share, and how many poses are like the others in it.

    Where all poses drift in a quantity, a pose is named that differs from the others; where they do not, each.
    """
    common = {(one.mode, one.quantity) for one in drifts.pooled}
    shown = [
        one for one in drifts.drifts if one.own or (one.trend.series.mode, one.trend.series.quantity) not in common
    ]
    alike = len(drifts.drifts) - len(shown)
    told = [drift_words(one, sets) for one in shown] + [pooled_words(one) for one in drifts.pooled]
    words = "1 trend of a single pose is" if alike == 1 else f"{alike} trends of single poses are"
    return [*told, *([f"{words} not told from what all poses do; the section lists them."] if alike else [])]


def _cut(start: str, sentences: Sequence[str]) -> list[str]:
    """The first sentences, and how many more there are."""
    shown = [f"{start}{sentence}" for sentence in sentences[:MOST]]
    more = len(sentences) - len(shown)
    return [*shown, *([f"... and {more} more below."] if more else [])]


def all_failures(sets: Sequence[SetResults], failures: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """Give each failure with the set that it belongs to, each reason once; those that the campaign lists come first.

    Parameters
    ----------
    sets
        Sets of the campaign, as read.
    failures
        Failures that the campaign lists, one line each.
    """
    found: dict[str, str] = dict.fromkeys(failures, "")
    for one in sets:
        for line in one.failures:
            reason = line.partition(": ")[2] or line
            said = next((known for known in found if known.endswith(reason)), line)
            found[said] = found.get(said) or one.name
    return tuple((name, line) for line, name in found.items())


def failure_section(failed: Sequence[tuple[str, str]]) -> Section:
    """Table of what failed, or the sentence that nothing did.

    Parameters
    ----------
    failed
        Name of the set (empty: of the campaign) and reason of each failure.
    """
    if not failed:
        return Section("Failures", ("Nothing failed.",))
    rows = tuple((name or "campaign", line) for name, line in failed)
    return Section("Failures", (), (Table("What failed, and why", ("set", "reason"), rows),))


MOST_OPEN = 30
"""Sets up to which their table is open from the start."""


def set_section(sets: Sequence[SetResults]) -> Section:
    """Each set with its labels, frequencies, lowest limit and verdict.

    Parameters
    ----------
    sets
        Sets of the campaign, as read.
    """
    columns = ("set", "natural frequencies (Hz)", "recordings", "lowest depth limit (mm)", "verdict", "doubts")
    rows = tuple(
        (
            one.name,
            "none" if one.model is None else ", ".join(f"{f:.2f}" for f in one.model.natural_frequencies),
            str(len(one.measured.recordings)),
            _limit(one.limit),
            one.verdict or "-",
            str(len(one.doubts)),
        )
        for one in sets
    )
    table = Table("Sets and their results; modes.csv has all numbers and doubts", columns, rows)
    return Section("Sets", folds=(Fold(f"All {len(sets)} sets", (table,), opened=len(sets) <= MOST_OPEN),))


def _limit(limit: LowestLimit | None) -> str:
    if limit is None:
        return "-"
    if not np.isfinite(limit.depth):
        return "no limit"
    return f"{1e3 * limit.depth:.3g} at {limit.speed_rpm:.0f} rpm"


MOST_MODES = 4
"""Modes that are drawn in one picture, a row each."""


def map_section(folder: Path, series: Sequence[Series], modes: IdentifiedModes, plane: MapPlane, poses: int) -> Section:
    """Maps of frequency, damping and depth limit with their scatter; the pictures are also written as PNG.

    Parameters
    ----------
    folder
        Folder of the PNG files.
    series
        Series of all poses.
    modes
        Which modes are the same, for the most common ones.
    plane
        Where the poses lie.
    poses
        Number of poses in the campaign.
    """
    common = [mode for mode in sorted(modes.frequencies) if 2 * _poses_with(series, mode) >= poses]
    pictures = []
    for start in range(0, len(common), MOST_MODES):
        chosen = common[start : start + MOST_MODES]
        panels = [panel for mode in chosen for panel in _of_mode(series, mode, modes.frequencies[mode])]
        name = "map_modes.png" if not start else f"map_modes_{start // MOST_MODES + 1}.png"
        pictures.append(_picture(folder / name, panels, plane, _modes_caption(plane), "Maps of modes over poses"))
    depth = [one for one in series if one.quantity == DEPTH]
    if depth:
        panels = [
            MapPanel("lowest depth limit (mm)", {one.pose: 1e3 * float(np.exp(one.logs.mean())) for one in depth}),
            MapPanel("its scatter between sets (%)", _scatter(depth)),
        ]
        caption = f"Lowest depth limit over all spindle speeds that were asked for. {_places(plane)}"
        pictures.append(_picture(folder / "map_depth_limit.png", panels, plane, caption, "Map of depth limits"))
    if not pictures:
        return Section("Maps over poses", ("No set has a modal model: there is nothing to map.",))
    return Section("Maps over poses", (), pictures=tuple(pictures))


def _poses_with(series: Sequence[Series], mode: int) -> int:
    return sum(one.mode == mode and one.quantity == FREQUENCY for one in series)


def _of_mode(series: Sequence[Series], mode: int, frequency: float) -> list[MapPanel]:
    """Frequency, its scatter between sets, and damping of one mode."""
    own = [one for one in series if one.mode == mode]
    named = [one for one in own if one.quantity == FREQUENCY]
    damped = [one for one in own if one.quantity == DAMPING]
    return [
        MapPanel(f"mode {mode}: frequency (Hz)", {one.pose: float(np.exp(one.logs.mean())) for one in named}),
        MapPanel(f"mode {mode}: scatter between sets (%)", _scatter(named)),
        MapPanel(f"mode {mode}: damping ratio (%)", {one.pose: 100 * float(np.exp(one.logs.mean())) for one in damped}),
    ]


def _scatter(series: Sequence[Series]) -> Mapping[str, float]:
    """Standard deviation between the sets of each pose, in per cent; a pose of one set has none."""
    return {one.pose: 100 * float(np.std(one.logs, ddof=1)) for one in series if len(one.rows) > 1}


def _picture(path: Path, panels: Sequence[MapPanel], plane: MapPlane, caption: str, alternative: str) -> Picture:
    figure = draw_maps(panels, plane)
    save_figure(figure, path)
    return picture_of(figure, f"{caption} Also {path.name}.", alternative)


def _modes_caption(plane: MapPlane) -> str:
    return (
        "Natural frequency, its standard deviation between the sets of a pose (drift included), and damping ratio, a "
        f"row a mode, mean over the sets of each pose. {_places(plane)}"
    )


def _places(plane: MapPlane) -> str:
    if plane.names:
        return "No two coordinates of the poses are known, so they stand in a row."
    return "A mark a pose; lighter is larger. An empty ring has no value."


def trend_pictures(folder: Path, drifts: Drifts) -> tuple[Picture, ...]:
    """Draw the most certain drifts, also as ``drifts.png``; nothing where nothing drifts.

    Parameters
    ----------
    folder
        Folder of the PNG file.
    drifts
        Trends that were looked at and found.
    """
    if not drifts.drifts:
        return ()
    words = [
        (
            f"{one.trend.series.pose}: "
            f"{mode_words(one.trend.series.mode, one.trend.series.frequency, one.trend.series.quantity)}",
            label_words(one.trend.label),
        )
        for one in drifts.drifts
    ]
    figure = draw_trends(drifts.drifts, drifts.all_trends, words)
    save_figure(figure, folder / "drifts.png")
    caption = (
        "What drifts: marks are the sets with twice the fits' standard errors, the line is the trend with its 95 % "
        "band. Grey lines are the same mode in the other poses. Also drifts.png."
    )
    return (picture_of(figure, caption, "Trends of what drifts"),)
