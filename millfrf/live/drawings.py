"""Figures of the live page; each is created once and updated from snapshots."""

import base64
import unicodedata
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from acquisition import Channel
from millfrf.figures import COLOURS

from .control import Mark
from .monitor import Snapshot

GREEN, RED, GREY = "#009E73", "#D55E00", "#999999"
_MOST_LINES = 4000  # drawn frequency lines of one curve
_LONGEST = 60  # characters of a label


@dataclass(frozen=True)
class Choice:
    """FRF entry and channels that a visitor has chosen on a page."""

    response: int  # of the FRF entry
    excitation: int
    spectra: tuple[int, ...]  # indices among excitations and responses
    n_responses: int
    n_excitations: int

    MOST_SPECTRA: ClassVar[int] = 8

    @property
    def n_spectra(self) -> int:
        return self.n_responses + self.n_excitations


# ``sources``: columns by the name of their source; ``title``, ``y_label``, ``ticks``: texts, if they change
Content = dict[str, Any]


@dataclass(frozen=True)
class Drawing:
    """A figure and the function that updates it."""

    name: str  # of the figure and of its element on the page
    figure: Any  # bokeh figure with named sources
    content: Callable[[Snapshot, Choice, Sequence[Mark]], Content]


def framed(name: str, title: str, x_label: str, y_label: str, **options: Any) -> Any:
    """Create an empty figure with labels, without tools."""
    from bokeh.plotting import figure

    chosen = {"height": 300, "tools": "", "sizing_mode": "stretch_width", **options}
    plot = figure(name=name, title=title, x_axis_label=x_label, y_axis_label=y_label, **chosen)
    plot.toolbar.logo = None
    plot.toolbar_location = None
    plot.axis.axis_label_text_font_style = "normal"
    plot.outline_line_color = None
    plot.title.text_font_size = "13px"
    return plot


def plain(text: str) -> str:
    """Convert a text for bokeh: no formulas, no control characters, limited length.

    Examples
    --------
    >>> plain("$$x$$").count("$"), "$$" in plain("$$x$$"), plain("acc x [g]")
    (4, False, 'acc x [g]')
    """
    shown = "".join(" " if unicodedata.category(c)[0] == "C" else c for c in text)
    for formula in ("$$", "\\(", "\\["):
        while formula in shown:  # a zero width space prevents the formula
            shown = shown.replace(formula, f"{formula[0]}\N{ZERO WIDTH SPACE}{formula[1]}")
    return shown if len(shown) <= _LONGEST else shown[: _LONGEST - 1] + "…"


def unit_text(unit: str) -> str:
    """Format a unit.

    Examples
    --------
    >>> unit_text("m/s^2")
    'm/s²'
    """
    return plain(unit).replace("^2", "²")


def thinned(n: int) -> slice:
    """Return a slice with a step that reduces ``n`` lines to the largest number of drawn lines."""
    return slice(None, None, max(1, n // _MOST_LINES))


def number(value: float) -> str:
    """Format a number with three digits.

    Examples
    --------
    >>> number(1234.5), number(0.000123), number(0.0)
    ('1230', '0.000123', '0')
    """
    rounded = float(f"{value:.3g}")
    return f"{rounded:.0f}" if 100 <= abs(rounded) < 1e5 else f"{rounded:g}"


def as_json(value: object) -> object:
    """Convert arrays (base64 of single precision) and numpy scalars for JSON."""
    if isinstance(value, np.ndarray):
        return {"f4": base64.b64encode(value.astype("<f4").tobytes()).decode("ascii")}
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} has no form in JSON")


FLOOR_DB = -80.0
_TOP_DB = 3.0


def traces(channels: Sequence[Channel]) -> Drawing:
    """Draw all channels above each other, each scaled to the range that its label states; draw marks in red."""
    from bokeh.models import ColumnDataSource

    n = len(channels)
    plot = framed("traces", "Last seconds, each channel over its own range", "Time since the start (s)", "")
    plot.height = max(420, 20 * n)
    data = ColumnDataSource({"xs": [], "ys": [], "colour": []}, name="traces.data")
    plot.multi_line("xs", "ys", color="colour", source=data, line_width=1)
    set_marks = ColumnDataSource({"x": [], "y": [], "label": []}, name="marks")
    plot.vspan(x="x", source=set_marks, line_color=RED, line_dash="dashed")
    plot.text("x", "y", text="label", source=set_marks, text_color=RED, text_font_size="12px", x_offset=3)
    plot.yaxis.ticker = list(range(n))
    plot.y_range.start, plot.y_range.end = -0.7, n - 0.5 + max(0.3, 0.055 * n)  # room for the marks' notes
    plot.ygrid.visible = False
    names = [plain(channel.name) for channel in channels]
    units = [unit_text(channel.unit) for channel in channels]

    def content(shown: Snapshot, _: Choice, marks: Sequence[Mark]) -> Content:
        if not len(shown.traces):
            empty: dict[str, Any] = {
                "traces": {"xs": [], "ys": [], "colour": []},
                "marks": {"x": [], "y": [], "label": []},
            }
            return {"sources": empty, "ticks": {n - 1 - k: name for k, name in enumerate(names)}}
        low, high = shown.traces.min(axis=0), shown.traces.max(axis=0)
        span = np.where(high > low, high - low, 1.0)
        scaled = 0.9 * (shown.traces - 0.5 * (low + high)) / span + np.arange(n - 1, -1, -1)
        inside = [mark for mark in marks if shown.times[0] <= mark.shown_at <= shown.times[-1]]
        lines = {"x_of_all": shown.times, "ys": list(scaled.T), "colour": [COLOURS[k % len(COLOURS)] for k in range(n)]}
        labels = {
            "x": [mark.shown_at for mark in inside],
            "y": [n - 0.5] * len(inside),
            "label": [plain(mark.label) for mark in inside],
        }
        ticks = {n - 1 - k: f"{name}  {number(low[k])} … {number(high[k])} {units[k]}" for k, name in enumerate(names)}
        return {"sources": {"traces.data": lines, "marks": labels}, "ticks": ticks}

    return Drawing("traces", plot, content)


def levels(channels: Sequence[Channel]) -> Drawing:
    """Draw the peak of the last second relative to full scale; overloaded channels are red."""
    from bokeh.models import ColumnDataSource

    n = len(channels)
    names = [plain(channel.name) for channel in channels]
    scales = np.array([channel.full_scale or np.nan for channel in channels])
    title = "Peak of the last second; red: overloaded since the start"
    plot = framed("levels", title, "Peak against full scale (dB)", "", x_range=(FLOOR_DB, _TOP_DB))
    plot.height = max(420, 20 * n)
    plot.y_range.start, plot.y_range.end = -0.7, n - 0.3
    plot.yaxis.ticker = list(range(n))
    plot.yaxis.major_label_overrides = {n - 1 - k: name for k, name in enumerate(names)}
    plot.ygrid.visible = False
    data = ColumnDataSource({"y": [], "level": [], "colour": [], "said": []}, name="levels.data")
    plot.hbar(y="y", left=FLOOR_DB, right="level", color="colour", height=0.8, alpha=0.75, source=data)
    plot.text(FLOOR_DB, "y", text="said", source=data, text_font_size="12px", text_baseline="middle", x_offset=6)

    def content(shown: Snapshot, _: Choice, __: Sequence[Mark]) -> Content:
        with np.errstate(divide="ignore", invalid="ignore"):
            decibels = 20 * np.log10(shown.peaks / scales)
        over = shown.overloads > 0
        columns = {
            "y": list(range(n - 1, -1, -1)),
            "level": np.clip(np.nan_to_num(decibels, nan=FLOOR_DB, neginf=FLOOR_DB), FLOOR_DB, _TOP_DB),
            "colour": np.where(over, RED, np.where(np.isnan(scales), GREY, GREEN)).tolist(),
            "said": [_said(c, shown.peaks[k], int(shown.overloads[k])) for k, c in enumerate(channels)],
        }
        return {"sources": {"levels.data": columns}}

    return Drawing("levels", plot, content)


def _said(channel: Channel, peak: float, overloads: int) -> str:
    """Describe peak, full scale and number of overloaded samples."""
    whole = f" of {number(channel.full_scale)}" if channel.full_scale else ""
    over = f", {overloads} samples overloaded" if overloads else ""
    return f"{number(peak)}{whole} {unit_text(channel.unit)}{over}"
