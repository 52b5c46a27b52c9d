"""Drifts in words that an engineer reads."""

from collections.abc import Sequence

import numpy as np

from ....tables import with_error
from ..drift import DAMPING, DEPTH, TIME, Deviation, Drift, PooledTrend, Trend
from ..read_set import SetResults
from ..table import as_utc

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
