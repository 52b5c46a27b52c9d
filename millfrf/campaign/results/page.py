"""Sections of the report of a campaign."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from millfrf.core import with_error
from millfrf.core.terminal import Table
from millfrf.figures import save_figure
from millfrf.reports.section import Fold, Picture, Section, picture_of

from .drift import Drift, Drifts
from .identity import IdentifiedModes
from .outliers import Deviation, Outliers
from .pictures import MapPanel, MapPlane, draw_maps, draw_trends
from .regression import TIME
from .sets import LowestLimit, SetResults, as_utc
from .trends import DAMPING, DEPTH, FREQUENCY, PooledTrend, Series, Trend

# units by suffix of a label
UNITS = {"_c": "°C", "_k": "K", "_n": "N", "_rpm": "rpm", "_hz": "Hz", "_m": "m", "_mm": "mm", "_kg": "kg", "_s": "s"}


def mode_words(mode: int, frequency: float, quantity: str) -> str:
    """Describe a quantity and its mode.

    Examples
    --------
    >>> mode_words(2, 24.12, "frequency"), mode_words(2, 24.12, "damping ratio"), mode_words(0, 0.0, "depth limit")
    ('mode 2 (24.1 Hz)', 'damping of mode 2 (24.1 Hz)', 'the lowest depth limit')
    """
    if quantity == DEPTH:
        return "the lowest depth limit"
    name = f"mode {mode} ({frequency:.1f} Hz)"
    return f"damping of {name}" if quantity == DAMPING else name


def percent(change: float, half_width: float, *, sign: bool = False) -> str:
    """Format a relative change with its half width in per cent.

    Examples
    --------
    >>> percent(0.0182, 0.0031), percent(-0.0003, 0.0004, sign=True)
    ('1.82 ± 0.31 %', '-0.030 ± 0.040 %')
    """
    return f"{with_error(100 * change, 100 * half_width, sign=sign)} %"


def label_words(label: str) -> str:
    """Format a label with its unit for an axis.

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
    """Describe the range of the label."""
    low, high = float(np.min(trend.values)), float(np.max(trend.values))
    if trend.label == TIME:
        times = [sets[row].measured.recorded_at for row in trend.rows]
        recorded = [time for time in times if time is not None]
        return f"from {as_utc(min(recorded))[:16]} to {as_utc(max(recorded))[:16]} (UTC)"
    name, unit = _name_and_unit(trend.label)
    return f"from {name} {low:.4g} to {high:.4g}{unit}"


def drift_words(drift: Drift, sets: Sequence[SetResults]) -> str:
    """Describe one drift and its possible confounders."""
    trend, series = drift.trend, drift.trend.series
    sentence = (
        f"pose {series.pose}: {mode_words(series.mode, series.frequency, series.quantity)} {_verb(trend.change)} by "
        f"{percent(abs(trend.change), trend.half_width)} {span_words(trend, sets)}{_others(drift)}."
    )
    if drift.rests_on is not None:
        sentence += (
            f" It depends on the set {sets[drift.rests_on].name} alone, which may be an outlier instead; measure this "
            "pose once more."
        )
    if drift.as_good:
        rivals = ", ".join(f"{label_words(name)} (correlation {value:+.2f})" for name, value in drift.as_good)
        verb = "varies" if len(drift.as_good) == 1 else "vary"
        sentence += f" In this pose {rivals} {verb} with {label_words(trend.label)}: the cause is ambiguous."
    return sentence


def _others(drift: Drift) -> str:
    if drift.others is None:
        return ""
    others, own_change = drift.others, drift.trend.slope * np.ptp(drift.trend.values)
    change = float(np.expm1(others.slope * np.ptp(drift.trend.values)))
    width = others.half_width * np.ptp(drift.trend.values) / others.span if others.span else float("nan")
    figure = f"({percent(change, float(width), sign=True)} over the same span, {others.poses} poses)"
    if abs(change) + width < 0.5 * abs(own_change):
        return f"; the other poses do not {figure}"
    return f"; the other poses on average {figure}"


def pooled_words(pooled: PooledTrend) -> str:
    """Describe a mean trend over poses."""
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
    """Return the name of a label, and its unit with a blank before it."""
    name, bracket, unit = label_words(label).partition(" (")
    return name, f" {unit.rstrip(')')}" if bracket else ""


def deviation_words(deviations: Sequence[Deviation], sets: Sequence[SetResults]) -> str:
    """Describe the deviations of one set."""
    parts = [
        f"{mode_words(deviation.series.mode, deviation.series.frequency, deviation.series.quantity)} lies "
        f"{percent(abs(deviation.change), deviation.half_width)} {'below' if deviation.change < 0 else 'above'}"
        for deviation in deviations
    ]
    row = deviations[0].row
    rivals = sorted({sets[rival].name for deviation in deviations for rival in deviation.rivals})
    recordings = sets[row].measured.recordings
    count = f" ({len(recordings)} recordings)" if len(recordings) > 1 else ""
    sentence = f"{sets[row].name}{count}: {'; '.join(parts)} the value expected from the other sets of its pose."
    if rivals:
        sentence += f" With so few sets {' or '.join(rivals)} may be the outlier instead."
    return sentence


MOST_ROWS = 40  # most rows of a table of trends, by p-value


def drift_section(drifts: Drifts, sets: Sequence[SetResults], pictures: Sequence[Picture]) -> Section:
    """Report drifts, their labels, and the smallest detectable changes."""
    if not drifts.count:
        reason = (
            "No trend could be tested: no numeric label and no time varies inside a pose, or no pose has enough sets. "
            "Measure poses again in another session."
        )
        return Section("Drift", (reason,))
    sentences = [
        f"{drifts.count} trends were tested: frequency and damping of each mode and the lowest depth limit, in each "
        "pose and over all poses, over each numeric label. Significant trends are listed (false discovery rate below 5 "
        "%): without any drift, at most one campaign in twenty lists one. ± is the 95 % interval with scatter between "
        "repeats."
    ]
    sentences += [drift_words(item, sets) for item in drifts.drifts] + [pooled_words(item) for item in drifts.pooled]
    if not drifts.drifts and not drifts.pooled:
        sentences.append("No drift was found.")
    tables = [_smallest(drifts)] if drifts.smallest else []
    if drifts.suspects:
        tables.append(
            _trend_table("Not significant among all trends, but beyond three standard errors: measure again", drifts)
        )
    folds = (Fold("Trends of all poses together", (_pooled_table(drifts.all_pooled),)),) if drifts.all_pooled else ()
    return Section("Drift", tuple(sentences), tuple(tables), tuple(pictures), folds)


def outlier_section(outliers: Outliers, sets: Sequence[SetResults], more: Sequence[str]) -> Section:
    """Report outlying sets and contradictory poses."""
    sentences = [deviation_words(group, sets) for group in deviations_by_set(outliers)]
    if outliers.count and not sentences:
        sentences.append(f"None of {outliers.count} values differs significantly from the other sets of its pose.")
    if not outliers.count:
        sentences.append("No pose has enough sets for a test of outliers.")
    return Section("Outlying sets and recordings", (*sentences, *more), tables=_scatter_tables(outliers))


def deviations_by_set(outliers: Outliers) -> list[list[Deviation]]:
    """Group the deviations by set, sorted by the smallest p-value of each set."""
    groups: dict[int, list[Deviation]] = {}
    for deviation in outliers.deviations:
        groups.setdefault(deviation.row, []).append(deviation)
    return list(groups.values())


def error_bar_sentences(outliers: Outliers) -> list[str]:
    """Report stated errors that are too small or too large compared with the repeats."""
    sentences = []
    for quantity, check in outliers.error_bars.items():
        if not np.isfinite(check.ratio) or check.p_value > 0.01 or 0.5 < check.ratio < 2.0:
            continue
        factor = float(np.sqrt(check.ratio))
        kind = "too small" if factor > 1 else "too large"
        sentences.append(
            f"The fits' error bars of the {quantity} are {kind}: repeats scatter {factor:.2g} times as much as "
            f"stated (reduced chi-square {check.ratio:.2g}, {check.freedom} degrees of freedom). Tests of drift and "
            "outliers use the scatter between repeats."
        )
    return sentences


def _smallest(drifts: Drifts) -> Table:
    rows = tuple((quantity, label_words(label), f"{100 * change:.2g}") for quantity, label, change in drifts.smallest)
    columns = ("quantity", "label", "smallest change (%)")
    return Table("Smallest change over the range of the label that the median pose detects (power 80 %)", columns, rows)


def _trend_table(title: str, drifts: Drifts) -> Table:
    rows = tuple(_trend_row(trend) for trend in drifts.suspects[:MOST_ROWS])
    return Table(title, ("pose", "quantity", "label", "change (%)", "probability"), rows)


def _trend_row(trend: Trend) -> tuple[str, ...]:
    quantity = mode_words(trend.series.mode, trend.series.frequency, trend.series.quantity)
    return trend.series.pose, quantity, label_words(trend.label), _change(trend), f"{trend.p_value:.2g}"


def _pooled_table(pooled: Sequence[PooledTrend]) -> Table:
    ordered = sorted(pooled, key=lambda trend: (trend.p_value, trend.mode, trend.quantity, trend.label))[:MOST_ROWS]
    rows = tuple(
        (
            mode_words(trend.mode, trend.frequency, trend.quantity),
            label_words(trend.label),
            str(trend.poses),
            _change(trend),
            f"{100 * trend.between * trend.span:.2g}",
            f"{trend.p_value:.2g}",
        )
        for trend in ordered
    )
    columns = ("quantity", "label", "poses", "mean change (%)", "between poses (%)", "probability")
    return Table("Mean change over the typical span of the label in a pose, ± 95 %", columns, rows)


def _change(trend: Trend | PooledTrend) -> str:
    """Format a change for a column in per cent."""
    return percent(trend.change, trend.half_width, sign=True).removesuffix(" %")


def _scatter_tables(outliers: Outliers) -> tuple[Table, ...]:
    rows = tuple(
        (quantity, "-" if mode == 0 else "several" if mode < 0 else str(mode), f"{100 * value:.2g}")
        for (quantity, mode), value in sorted(outliers.scatter.items())
    )
    if not rows:
        return ()
    title = "Scatter between sets of one pose beyond the fits' error bars, one standard deviation"
    return (Table(title, ("quantity", "mode", "scatter (%)"), rows),)


MOST = 8  # most sentences of each kind in the summary; the sections have all


def verdict_sentences(
    sets: Sequence[SetResults],
    drifts: Drifts,
    outliers: Outliers,
    more: Sequence[str],
    failed: Sequence[tuple[str, str]],
) -> list[str]:
    """Summarise the campaign in a few sentences."""
    usable = sum(results.model is not None for results in sets)
    sentences = [f"{usable} of {len(sets)} sets have a modal model."]
    sentences += _cut("Drift: ", _drift_sentences(drifts, sets)) or [
        "No drift was found." if drifts.count else "Drift could not be tested: no pose was measured twice."
    ]
    outlying = [deviation_words(group, sets) for group in deviations_by_set(outliers)]
    sentences += _cut("Outlier: ", [*outlying, *more]) or [
        "No set is an outlier." if outliers.count else "Outliers could not be tested: no pose has enough sets."
    ]
    sentences += _cut("Failed: ", [f"{name}: {line}" if name else line for name, line in failed]) or ["Nothing failed."]
    return sentences


def _drift_sentences(drifts: Drifts, sets: Sequence[SetResults]) -> list[str]:
    """Describe drifts of single poses, then drifts of all poses, and count the poses that follow the common drift.

    If all poses drift in a quantity, only poses that differ from the common drift are described.
    """
    common = {(item.mode, item.quantity) for item in drifts.pooled}
    shown = [
        item for item in drifts.drifts if item.own or (item.trend.series.mode, item.trend.series.quantity) not in common
    ]
    n_similar = len(drifts.drifts) - len(shown)
    sentences = [drift_words(item, sets) for item in shown] + [pooled_words(item) for item in drifts.pooled]
    words = "1 trend of a single pose is" if n_similar == 1 else f"{n_similar} trends of single poses are"
    return [
        *sentences,
        *([f"{words} not different from the drift of all poses; the section lists them."] if n_similar else []),
    ]


def _cut(start: str, sentences: Sequence[str]) -> list[str]:
    """Limit the number of sentences; state how many more there are."""
    shown = [f"{start}{sentence}" for sentence in sentences[:MOST]]
    n_hidden = len(sentences) - len(shown)
    return [*shown, *([f"... and {n_hidden} more below."] if n_hidden else [])]


def all_failures(sets: Sequence[SetResults], failures: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """Return each failure once with its set; failures of the campaign come first."""
    set_of_line: dict[str, str] = dict.fromkeys(failures, "")
    for results in sets:
        for line in results.failures:
            reason = line.partition(": ")[2] or line
            listed = next((line_listed for line_listed in set_of_line if line_listed.endswith(reason)), line)
            set_of_line[listed] = set_of_line.get(listed) or results.name
    return tuple((name, line) for line, name in set_of_line.items())


def failure_section(failed: Sequence[tuple[str, str]]) -> Section:
    """Report failures."""
    if not failed:
        return Section("Failures", ("Nothing failed.",))
    rows = tuple((name or "campaign", line) for name, line in failed)
    return Section("Failures", (), (Table("What failed, and why", ("set", "reason"), rows),))


MOST_OPEN = 30  # most sets with an open table


def set_section(sets: Sequence[SetResults]) -> Section:
    """Report frequencies, lowest limit and verdict of each set."""
    columns = ("set", "natural frequencies (Hz)", "recordings", "lowest depth limit (mm)", "verdict", "doubts")
    rows = tuple(
        (
            results.name,
            "none" if results.model is None else ", ".join(f"{f:.2f}" for f in results.model.natural_frequencies),
            str(len(results.measured.recordings)),
            _limit(results.limit),
            results.verdict or "-",
            str(len(results.doubts)),
        )
        for results in sets
    )
    table = Table("Sets and their results; modes.csv has all numbers and doubts", columns, rows)
    return Section("Sets", folds=(Fold(f"All {len(sets)} sets", (table,), opened=len(sets) <= MOST_OPEN),))


def _limit(limit: LowestLimit | None) -> str:
    if limit is None:
        return "-"
    if not np.isfinite(limit.depth):
        return "no limit"
    return f"{1e3 * limit.depth:.3g} at {limit.speed_rpm:.0f} rpm"


MOST_MODES = 4  # most modes in one picture, a row each


def map_section(folder: Path, series: Sequence[Series], modes: IdentifiedModes, plane: MapPlane, poses: int) -> Section:
    """Draw maps of frequency, damping and depth limit with their scatter; also write them as PNG."""
    common = [mode for mode in sorted(modes.frequencies) if 2 * _poses_with(series, mode) >= poses]
    pictures = []
    for start in range(0, len(common), MOST_MODES):
        chosen = common[start : start + MOST_MODES]
        panels = [panel for mode in chosen for panel in _of_mode(series, mode)]
        name = "map_modes.png" if not start else f"map_modes_{start // MOST_MODES + 1}.png"
        pictures.append(_picture(folder / name, panels, plane, _modes_caption(plane), "Maps of modes over poses"))
    depth = [item for item in series if item.quantity == DEPTH]
    if depth:
        panels = [
            MapPanel("lowest depth limit (mm)", {item.pose: 1e3 * float(np.exp(item.logs.mean())) for item in depth}),
            MapPanel("its scatter between sets (%)", _scatter(depth)),
        ]
        caption = f"Lowest depth limit over all spindle speeds. {_places(plane)}"
        pictures.append(_picture(folder / "map_depth_limit.png", panels, plane, caption, "Map of depth limits"))
    if not pictures:
        return Section("Maps over poses", ("No set has a modal model, so there is no map.",))
    return Section("Maps over poses", (), pictures=tuple(pictures))


def _poses_with(series: Sequence[Series], mode: int) -> int:
    return sum(item.mode == mode and item.quantity == FREQUENCY for item in series)


def _of_mode(series: Sequence[Series], mode: int) -> list[MapPanel]:
    of_mode = [item for item in series if item.mode == mode]
    frequencies = [item for item in of_mode if item.quantity == FREQUENCY]
    damping = [item for item in of_mode if item.quantity == DAMPING]
    return [
        MapPanel(f"mode {mode}: frequency (Hz)", {item.pose: float(np.exp(item.logs.mean())) for item in frequencies}),
        MapPanel(f"mode {mode}: scatter between sets (%)", _scatter(frequencies)),
        MapPanel(
            f"mode {mode}: damping ratio (%)", {item.pose: 100 * float(np.exp(item.logs.mean())) for item in damping}
        ),
    ]


def _scatter(series: Sequence[Series]) -> Mapping[str, float]:
    """Return the standard deviation between the sets of each pose in per cent."""
    return {item.pose: 100 * float(np.std(item.logs, ddof=1)) for item in series if len(item.rows) > 1}


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
        return "The coordinates of the poses are unknown, so the poses are shown in a row."
    return "One mark per pose; lighter is larger. An empty ring has no value."


def trend_pictures(folder: Path, drifts: Drifts) -> tuple[Picture, ...]:
    """Draw the most significant drifts, also as ``drifts.png``."""
    if not drifts.drifts:
        return ()
    words = [
        (
            f"{drift.trend.series.pose}: "
            f"{mode_words(drift.trend.series.mode, drift.trend.series.frequency, drift.trend.series.quantity)}",
            label_words(drift.trend.label),
        )
        for drift in drifts.drifts
    ]
    figure = draw_trends(drifts.drifts, drifts.all_trends, words)
    save_figure(figure, folder / "drifts.png")
    caption = (
        "Drifts: marks are the sets with twice the standard errors of the fits, the line is the trend with its 95 % "
        "band. Grey lines are the same mode in the other poses. Also drifts.png."
    )
    return (picture_of(figure, caption, "Drifts"),)
