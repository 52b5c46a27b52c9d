"""Many FRFs as small panels, in an SVG of few bytes."""

import base64
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from xml.etree import ElementTree

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from millfrf.core import Complex, Real

from .style import FITTED, TRUE, WIDTH_MM, house_style

FONT = "DejaVu Sans,Verdana,Arial,sans-serif"


@dataclass
class SmallSvg:
    """An SVG page under construction, in tenths of a millimetre.

    Parameters
    ----------
    width, height : mm
        Size of the page.
    style
        CSS rules for classes of lines and texts.
    """

    width: float
    height: float
    style: str
    parts: list[str] = field(default_factory=list)

    def curve(self, x: Real, y: Real, kind: str) -> None:
        """A line through points (mm, from the top left), broken where a value is not finite."""
        data = "".join(_moves(xs, ys) for xs, ys in _pieces(x, y))
        if data:
            self.parts.append(f'<path class="{kind}" d="{data}"/>')

    def lines(self, segments: list[tuple[float, float, float, float]], kind: str) -> None:
        """Straight lines x1, y1, x2, y2 (mm)."""
        if segments:
            data = "".join(f"M{_tenths(a)} {_tenths(b)}l{_tenths(c - a)} {_tenths(d - b)}" for a, b, c, d in segments)
            self.parts.append(f'<path class="{kind}" d="{data}"/>')

    def text(self, x: float, y: float, words: str, kind: str) -> None:
        """A text whose base line starts at (or, by its class, ends at) a place, mm."""
        self.parts.append(f'<text class="{kind}" x="{_tenths(x)}" y="{_tenths(y)}">{escape(words)}</text>')

    def svg(self) -> str:
        """The page as text."""
        size = f'width="{self.width:g}mm" height="{self.height:g}mm"'
        box = f'viewBox="0 0 {10 * self.width:g} {10 * self.height:g}"'
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" {size} {box}><style>path{{fill:none}}text{{font:26px {FONT}}}'
            f"{self.style}</style>{''.join(self.parts)}</svg>"
        )

    def uri(self) -> str:
        """The page as ``data:`` address."""
        return "data:image/svg+xml;base64," + base64.b64encode(self.svg().encode()).decode("ascii")


def _tenths(value: float) -> str:
    return str(round(10 * value))


def _pieces(x: Real, y: Real) -> list[tuple[Real, Real]]:
    """Stretches of finite values."""
    good = np.isfinite(y) & np.isfinite(x)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
    return [(x[a:b], y[a:b]) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a > 1]


def _moves(x: Real, y: Real) -> str:
    """A path in rounded relative moves, without points that lie on the way."""
    path = Path(10 * np.column_stack([x, y]))
    path.simplify_threshold = 0.7
    points = np.asarray(path.cleaned(simplify=True).vertices, dtype=float)[:-1]  # its last one is the end mark
    rounded = np.round(points).astype(int)
    steps = np.diff(rounded, axis=0)
    steps = steps[(steps != 0).any(axis=1)]
    start = f"M{rounded[0, 0]} {rounded[0, 1]}l"
    return start + " ".join(f"{dx} {dy}" for dx, dy in steps.tolist()) if len(steps) else ""


COLUMNS, ROWS = 4, 6
ENTRIES_PER_PAGE = COLUMNS * ROWS
"""FRFs on one page."""

_STYLE = (
    ".m{stroke:#000;stroke-width:3.2}"
    f".f{{stroke:{FITTED};stroke-width:3.2;stroke-dasharray:14 6}}"
    f".r{{stroke:{TRUE};stroke-width:4;stroke-dasharray:3 6}}"
    ".b{stroke:#000;stroke-width:2}.g{stroke:#dcdcdc;stroke-width:2}.e{text-anchor:end}.c{text-anchor:middle}"
)
_LEFT, _TOP, _FOOT = 10.0, 5.0, 7.0
_CELL_WIDTH, _CELL_HEIGHT = (WIDTH_MM - _LEFT) / COLUMNS, 37.0
_WIDE, _MAGNITUDE, _PHASE = _CELL_WIDTH - 9.0, (4.5, 20.0), (25.5, 7.5)
"""Width of a panel, and top and height of both, mm."""

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class GalleryEntry:
    """One FRF of a gallery.

    Parameters
    ----------
    title, misfit
        Texts above the panel, at its left and right.
    measured : (n_lines,), complex
        Measured values; NaN where there is none.
    fitted, reference : (n_lines,), complex, or None
        Values of the fitted model and of a reference model.
    """

    title: str
    misfit: str
    measured: Complex
    fitted: Complex | None = None
    reference: Complex | None = None


def gallery_page(entries: Sequence[GalleryEntry], frequencies: Real) -> SmallSvg:
    """Draw one page: four entries a row, each with its own scale of magnitude.

    Parameters
    ----------
    entries
        FRFs to draw, at most ``ENTRIES_PER_PAGE``.
    frequencies : (n_lines,), Hz
        Frequencies of all entries.
    """
    rows = -(-len(entries) // COLUMNS)
    page = SmallSvg(WIDTH_MM, _TOP + rows * _CELL_HEIGHT + _FOOT, _STYLE)
    across = (frequencies - frequencies[0]) / max(frequencies[-1] - frequencies[0], 1e-12) * _WIDE
    for number, entry in enumerate(entries):
        row, column = divmod(number, COLUMNS)
        corner = (_LEFT + column * _CELL_WIDTH, _TOP + row * _CELL_HEIGHT)
        last = number + COLUMNS >= len(entries)
        _draw(page, entry, frequencies, across, corner, with_axis=last)
    return page


def _draw(
    page: SmallSvg, entry: GalleryEntry, f: Real, across: Real, corner: tuple[float, float], *, with_axis: bool
) -> None:
    x, y = corner
    page.text(x, y + 3.3, entry.title, "t")
    page.text(x + _WIDE, y + 3.3, entry.misfit, "e")
    top, bottom = _limits(entry)
    above, below = y + _MAGNITUDE[0], y + _PHASE[0]
    decades = range(int(np.ceil(bottom)), int(np.floor(top)) + 1)
    heights = [above + (top - decade) / (top - bottom) * _MAGNITUDE[1] for decade in decades]
    ticks = [tick for tick in MaxNLocator(4).tick_values(f[0], f[-1]) if f[0] <= tick <= f[-1]]
    places = [x + float(np.interp(tick, f, across)) for tick in ticks]
    page.lines([(x, height, x + _WIDE, height) for height in heights], "g")
    page.lines([(place, above, place, above + _MAGNITUDE[1]) for place in places], "g")
    page.lines([(x, below + _PHASE[1] / 2, x + _WIDE, below + _PHASE[1] / 2)], "g")
    for decade, height in zip(decades, heights, strict=True):
        page.text(x - 0.6, height + 0.9, f"10{str(decade).translate(_RAISED)}", "e")
    if with_axis:
        for tick, place in zip(ticks, places, strict=True):
            page.text(place, below + _PHASE[1] + 3.2, f"{tick:g}", "c")
        page.text(x + _WIDE / 2, below + _PHASE[1] + 6.6, "Frequency (Hz)", "c")
    for values, kind in ((entry.measured, "m"), (entry.reference, "r"), (entry.fitted, "f")):
        if values is not None:
            _draw_curve(page, values, kind, x + across, (above, below), (top, bottom))
    for place, tall in ((above, _MAGNITUDE[1]), (below, _PHASE[1])):
        right, foot = x + _WIDE, place + tall
        page.lines([(x, place, right, place), (right, place, right, foot), (right, foot, x, foot)], "b")
        page.lines([(x, foot, x, place)], "b")


def _draw_curve(
    page: SmallSvg,
    values: Complex,
    kind: str,
    x: Real,
    places: tuple[float, float],
    limits: tuple[float, float],
) -> None:
    """Magnitude, cut at the edges of its panel, and phase, broken where it jumps."""
    top, bottom = limits
    size = np.abs(values)
    height = np.log10(np.where(size > 0, size, np.nan))
    page.curve(x, places[0] + (top - np.clip(height, bottom, top)) / (top - bottom) * _MAGNITUDE[1], kind)
    angle = np.angle(values, deg=True)
    angle = np.where(np.isfinite(size), angle, np.nan)
    angle[1:][np.abs(np.diff(angle)) > 180] = np.nan
    page.curve(x, places[1] + (180 - angle) / 360 * _PHASE[1], kind)


def _limits(entry: GalleryEntry) -> tuple[float, float]:
    """Logarithms of the largest and smallest magnitude shown: at least one decade, at most five."""
    size = np.abs(entry.measured)
    size = size[np.isfinite(size) & (size > 0)]
    if not len(size):
        return 0.0, -1.0
    top = float(np.log10(size.max())) + 0.15
    bottom = float(np.log10(np.percentile(size, 0.5))) - 0.15
    middle = (top + bottom) / 2
    if top - bottom < 1.2:
        return middle + 0.6, middle - 0.6
    return top, max(bottom, top - 5)


_POINTS = 72 / 254
"""Points (1/72 inch) in a tenth of a millimetre."""

_ALIGNED = {"end": "right", "middle": "center"}
_TEXT_SIZE = 26.0

Rules = dict[str, dict[str, str]]


def redrawn(page: SmallSvg) -> Figure:
    """The same lines and texts as a figure of matplotlib, of the same printed size.

    Parameters
    ----------
    page
        Page of lines and texts, with one class each.
    """
    width, height = page.width, page.height
    figure = Figure(figsize=(width / 25.4, height / 25.4), layout=None)
    with house_style():
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        axes.set_xlim(0, 10 * width)
        axes.set_ylim(10 * height, 0)
        rules = _rules(page.style)
        for part in page.parts:
            element = ElementTree.fromstring(part)
            (_draw_path if element.tag == "path" else _draw_text)(axes, element, rules)
    return figure


def _rules(style: str) -> Rules:
    """Properties of each class."""
    found = re.findall(r"\.(\w+)\{([^}]*)\}", style)
    return {name: dict(one.split(":", 1) for one in body.split(";") if one) for name, body in found}


def _draw_path(axes: Axes, element: ElementTree.Element, rules: Rules) -> None:
    rule = rules.get(element.get("class", ""), {})
    width = _POINTS * float(rule.get("stroke-width", 1.0))
    dashes = [float(one) / float(rule["stroke-width"]) for one in rule.get("stroke-dasharray", "").split()]
    look = (0, tuple(dashes)) if dashes else "-"
    path = _path(element.get("d", ""))
    colour = rule.get("stroke", "none")
    axes.add_patch(PathPatch(path, facecolor="none", edgecolor=colour, linewidth=width, linestyle=look))


def _path(data: str) -> Path:
    """``M`` moves, and pairs of relative steps after each ``l``."""
    pieces: list[NDArray[np.float64]] = []
    codes: list[int] = []
    for start, steps in re.findall(r"M([^lM]+)(?:l([^M]*))?", data):
        corners = np.array([_numbers(start), *np.reshape(_numbers(steps), (-1, 2))]).cumsum(axis=0)
        pieces.append(corners)
        codes += [int(Path.MOVETO)] + [int(Path.LINETO)] * (len(corners) - 1)
    return Path(np.concatenate(pieces), codes)


def _numbers(text: str) -> list[float]:
    return [float(one) for one in text.split()]


def _draw_text(axes: Axes, element: ElementTree.Element, rules: Rules) -> None:
    anchor = rules.get(element.get("class", ""), {}).get("text-anchor", "start")
    x, y = float(element.get("x", 0)), float(element.get("y", 0))
    size = _POINTS * _TEXT_SIZE
    axes.text(x, y, element.text or "", fontsize=size, ha=_ALIGNED.get(anchor, "left"), va="baseline", parse_math=False)
