"""Figures of the live page: each is made once, and updated from snapshots."""

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
_MOST_LINES = 4000
_LONGEST = 60


@dataclass(frozen=True)
class Choice:
    """What a page has chosen to see.

    Parameters
    ----------
    response, excitation
        Entry of the FRF.
    spectra
        Channels whose spectra are drawn, by their place among excitations and responses.
    n_responses, n_excitations
        How many there are to choose from.
    """

    response: int
    excitation: int
    spectra: tuple[int, ...]
    n_responses: int
    n_excitations: int

    MOST_SPECTRA: ClassVar[int] = 8

    @property
    def n_spectra(self) -> int:
        """Number of channels that have spectra."""
        return self.n_responses + self.n_excitations


Content = dict[str, Any]
"""``sources``: columns by the name of their source; ``title``, ``y_label``, ``ticks``: texts where they change."""


@dataclass(frozen=True)
class Drawing:
    """A figure, and how it takes a snapshot.

    Parameters
    ----------
    name
        Name of the figure and of its place on the page.
    figure
        Figure of bokeh; its sources have names.
    content
        Function that gives what is drawn of a snapshot for a choice, with the marks so far.
    """

    name: str
    figure: Any
    content: Callable[[Snapshot, Choice, Sequence[Mark]], Content]


def framed(name: str, title: str, x_label: str, y_label: str, **options: Any) -> Any:
    """An empty figure with its labels, without tools."""
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
    """Text of a file or a user as bokeh shall show it: no formula, no control characters, not longer than a label.

    Examples
    --------
    >>> plain("$$x$$").count("$"), "$$" in plain("$$x$$"), plain("acc x [g]")
    (4, False, 'acc x [g]')
    """
    seen = "".join(" " if unicodedata.category(c)[0] == "C" else c for c in text)
    for formula in ("$$", "\\(", "\\["):
        while formula in seen:  # a space of no width between the two
            seen = seen.replace(formula, f"{formula[0]}\N{ZERO WIDTH SPACE}{formula[1]}")
    return seen if len(seen) <= _LONGEST else seen[: _LONGEST - 1] + "…"


def unit_text(unit: str) -> str:
    """A unit as it is printed.

    Examples
    --------
    >>> unit_text("m/s^2")
    'm/s²'
    """
    return plain(unit).replace("^2", "²")


def thinned(n: int) -> slice:
    """Every how-manyeth of ``n`` lines is drawn."""
    return slice(None, None, max(1, n // _MOST_LINES))


def number(value: float) -> str:
    """Three digits, as people write them.

    Examples
    --------
    >>> number(1234.5), number(0.000123), number(0.0)
    ('1230', '0.000123', '0')
    """
    rounded = float(f"{value:.3g}")
    return f"{rounded:.0f}" if 100 <= abs(rounded) < 1e5 else f"{rounded:g}"


def as_json(value: object) -> object:
    """Give arrays and numpy's numbers as JSON: an array is base64 of single precision."""
    if isinstance(value, np.ndarray):
        return {"f4": base64.b64encode(value.astype("<f4").tobytes()).decode("ascii")}
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} has no form in JSON")


FLOOR_DB = -80.0
_TOP_DB = 3.0


def traces(channels: Sequence[Channel]) -> Drawing:
    """All channels above one another, each scaled to its own range in the window, which its label says; marks red."""
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
    """Peak of the last second against full scale, and whether a channel was ever overloaded."""
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
    """Peak in its unit, full scale, and how many samples were over."""
    whole = f" of {number(channel.full_scale)}" if channel.full_scale else ""
    over = f", {overloads} samples overloaded" if overloads else ""
    return f"{number(peak)}{whole} {unit_text(channel.unit)}{over}"
