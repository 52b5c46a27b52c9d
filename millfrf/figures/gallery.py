"""Pages of many FRFs as small panels, in a compact SVG; files of figures."""

import base64
import io
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Curve
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray
from PIL import Image

from millfrf.core import Complex, InputError, Real, writing_whole_file

from .style import FITTED, TRUE, WIDTH_MM, house_style

FONT = "DejaVu Sans,Verdana,Arial,sans-serif"


@dataclass
class SmallSvg:
    """An SVG page under construction, in tenths of a millimetre."""

    width: float  # mm
    height: float  # mm
    style: str  # CSS rules for classes of lines and texts
    parts: list[str] = field(default_factory=list)

    def curve(self, x: Real, y: Real, kind: str) -> None:
        """Add a line through points (mm, from the top left), interrupted where a value is not finite."""
        data = "".join(_moves(xs, ys) for xs, ys in _pieces(x, y))
        if data:
            self.parts.append(f'<path class="{kind}" d="{data}"/>')

    def lines(self, segments: list[tuple[float, float, float, float]], kind: str) -> None:
        """Add straight lines x1, y1, x2, y2 (mm)."""
        if segments:
            data = "".join(f"M{_tenths(a)} {_tenths(b)}l{_tenths(c - a)} {_tenths(d - b)}" for a, b, c, d in segments)
            self.parts.append(f'<path class="{kind}" d="{data}"/>')

    def text(self, x: float, y: float, words: str, kind: str) -> None:
        """Add a text; depending on its class, its base line starts or ends at the position (mm)."""
        self.parts.append(f'<text class="{kind}" x="{_tenths(x)}" y="{_tenths(y)}">{escape(words)}</text>')

    def svg(self) -> str:
        """Return the page as SVG text."""
        size = f'width="{self.width:g}mm" height="{self.height:g}mm"'
        box = f'viewBox="0 0 {10 * self.width:g} {10 * self.height:g}"'
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" {size} {box}><style>path{{fill:none}}text{{font:26px {FONT}}}'
            f"{self.style}</style>{''.join(self.parts)}</svg>"
        )

    def uri(self) -> str:
        """Return the page as ``data:`` address."""
        return "data:image/svg+xml;base64," + base64.b64encode(self.svg().encode()).decode("ascii")


def _tenths(value: float) -> str:
    return str(round(10 * value))


def _pieces(x: Real, y: Real) -> list[tuple[Real, Real]]:
    """Split a curve into runs of finite values."""
    finite = np.isfinite(y) & np.isfinite(x)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], finite, [False]]).astype(int)))
    return [(x[a:b], y[a:b]) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a > 1]


def _moves(x: Real, y: Real) -> str:
    """Return an SVG path of rounded relative moves; leave out points on a straight line between their neighbours."""
    path = Curve(10 * np.column_stack([x, y]))
    path.simplify_threshold = 0.7
    points = np.asarray(path.cleaned(simplify=True).vertices, dtype=float)[:-1]  # the last point is an end marker
    rounded = np.round(points).astype(int)
    steps = np.diff(rounded, axis=0)
    steps = steps[(steps != 0).any(axis=1)]
    start = f"M{rounded[0, 0]} {rounded[0, 1]}l"
    return start + " ".join(f"{dx} {dy}" for dx, dy in steps.tolist()) if len(steps) else ""


COLUMNS, ROWS = 4, 6
ENTRIES_PER_PAGE = COLUMNS * ROWS

_STYLE = (
    ".m{stroke:#000;stroke-width:3.2}"
    f".f{{stroke:{FITTED};stroke-width:3.2;stroke-dasharray:14 6}}"
    f".r{{stroke:{TRUE};stroke-width:4;stroke-dasharray:3 6}}"
    ".b{stroke:#000;stroke-width:2}.g{stroke:#dcdcdc;stroke-width:2}.e{text-anchor:end}.c{text-anchor:middle}"
)
_LEFT, _TOP, _FOOT = 10.0, 5.0, 7.0
_CELL_WIDTH, _CELL_HEIGHT = (WIDTH_MM - _LEFT) / COLUMNS, 37.0
# width of a panel, and top and height of both panels, mm
_WIDE, _MAGNITUDE, _PHASE = _CELL_WIDTH - 9.0, (4.5, 20.0), (25.5, 7.5)

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class GalleryEntry:
    """One FRF of a gallery.

    Parameters
    ----------
    title, misfit
        Texts above the panel, at its left and right.
    measured : (n_lines,), complex
        Measured values; NaN where the FRF is not valid.
    fitted, reference : (n_lines,), complex, or None
        Values of the fitted model and of a reference model.
    """

    title: str
    misfit: str
    measured: Complex
    fitted: Complex | None = None
    reference: Complex | None = None


def gallery_page(entries: Sequence[GalleryEntry], frequencies: Real) -> SmallSvg:
    """Draw a page with four entries per row; each entry has a separate scale of magnitude.

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
    tick_positions = [x + float(np.interp(tick, f, across)) for tick in ticks]
    page.lines([(x, height, x + _WIDE, height) for height in heights], "g")
    page.lines([(tick_x, above, tick_x, above + _MAGNITUDE[1]) for tick_x in tick_positions], "g")
    page.lines([(x, below + _PHASE[1] / 2, x + _WIDE, below + _PHASE[1] / 2)], "g")
    for decade, height in zip(decades, heights, strict=True):
        page.text(x - 0.6, height + 0.9, f"10{str(decade).translate(_RAISED)}", "e")
    if with_axis:
        for tick, tick_x in zip(ticks, tick_positions, strict=True):
            page.text(tick_x, below + _PHASE[1] + 3.2, f"{tick:g}", "c")
        page.text(x + _WIDE / 2, below + _PHASE[1] + 6.6, "Frequency (Hz)", "c")
    for values, kind in ((entry.measured, "m"), (entry.reference, "r"), (entry.fitted, "f")):
        if values is not None:
            _draw_curve(page, values, kind, x + across, (above, below), (top, bottom))
    for edge, tall in ((above, _MAGNITUDE[1]), (below, _PHASE[1])):
        right, foot = x + _WIDE, edge + tall
        page.lines([(x, edge, right, edge), (right, edge, right, foot), (right, foot, x, foot)], "b")
        page.lines([(x, foot, x, edge)], "b")


def _draw_curve(
    page: SmallSvg,
    values: Complex,
    kind: str,
    x: Real,
    tops: tuple[float, float],
    limits: tuple[float, float],
) -> None:
    """Draw the magnitude, clipped to its panel, and the phase, interrupted where it jumps."""
    top, bottom = limits
    size = np.abs(values)
    height = np.log10(np.where(size > 0, size, np.nan))
    page.curve(x, tops[0] + (top - np.clip(height, bottom, top)) / (top - bottom) * _MAGNITUDE[1], kind)
    angle = np.angle(values, deg=True)
    angle = np.where(np.isfinite(size), angle, np.nan)
    angle[1:][np.abs(np.diff(angle)) > 180] = np.nan
    page.curve(x, tops[1] + (180 - angle) / 360 * _PHASE[1], kind)


def _limits(entry: GalleryEntry) -> tuple[float, float]:
    """Return the decimal logarithms of the largest and smallest magnitude drawn, one to five decades apart."""
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


_POINTS = 72 / 254  # points (1/72 inch) in a tenth of a millimetre

_ALIGNED = {"end": "right", "middle": "center"}
_TEXT_SIZE = 26.0

Rules = dict[str, dict[str, str]]


def redrawn(page: SmallSvg) -> Figure:
    """Draw the lines and texts of a page as a matplotlib figure of the same printed size.

    Parameters
    ----------
    page
        Page of lines and texts, each with one class.
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
    """Parse the CSS properties of each class."""
    rules = re.findall(r"\.(\w+)\{([^}]*)\}", style)
    return {name: dict(item.split(":", 1) for item in body.split(";") if item) for name, body in rules}


def _draw_path(axes: Axes, element: ElementTree.Element, rules: Rules) -> None:
    rule = rules.get(element.get("class", ""), {})
    width = _POINTS * float(rule.get("stroke-width", 1.0))
    dashes = [float(dash) / float(rule["stroke-width"]) for dash in rule.get("stroke-dasharray", "").split()]
    line_style = (0, tuple(dashes)) if dashes else "-"
    path = _path(element.get("d", ""))
    colour = rule.get("stroke", "none")
    axes.add_patch(PathPatch(path, facecolor="none", edgecolor=colour, linewidth=width, linestyle=line_style))


def _path(data: str) -> Curve:
    """Parse an SVG path in which each ``M x y`` is followed by ``l`` and pairs of relative steps."""
    pieces: list[NDArray[np.float64]] = []
    codes: list[int] = []
    for start, steps in re.findall(r"M([^lM]+)(?:l([^M]*))?", data):
        corners = np.array([_numbers(start), *np.reshape(_numbers(steps), (-1, 2))]).cumsum(axis=0)
        pieces.append(corners)
        codes += [int(Curve.MOVETO)] + [int(Curve.LINETO)] * (len(corners) - 1)
    return Curve(np.concatenate(pieces), codes)


def _numbers(text: str) -> list[float]:
    return [float(number) for number in text.split()]


def _draw_text(axes: Axes, element: ElementTree.Element, rules: Rules) -> None:
    anchor = rules.get(element.get("class", ""), {}).get("text-anchor", "start")
    x, y = float(element.get("x", 0)), float(element.get("y", 0))
    size = _POINTS * _TEXT_SIZE
    axes.text(x, y, element.text or "", fontsize=size, ha=_ALIGNED.get(anchor, "left"), va="baseline", parse_math=False)


_SUFFIXES = {".svg": "svg", ".png": "png", ".pdf": "pdf"}


LARGEST_SVG = 40_000  # bytes of an SVG from which a page holds pixels instead: curves of many points become large

SHADES = 64  # colours of pixels within a page; a line drawing has few, and shades of its edges


def as_data_uri(figure: Figure) -> str:
    """Encode a figure as a ``data:`` address, so that a page contains it and needs no other file.

    A figure whose SVG would be large becomes a lossless WebP of 200 dpi.
    """
    buffer = io.BytesIO()
    with house_style():
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    if len(buffer.getvalue()) > LARGEST_SVG:
        return f"data:image/webp;base64,{_base64(_as_webp(as_png(figure)))}"
    return f"data:image/svg+xml;base64,{_base64(buffer.getvalue())}"


def _base64(content: bytes) -> str:
    return base64.b64encode(content).decode("ascii")


def _as_webp(png: bytes) -> bytes:
    """Convert a PNG with few colours to WebP, which takes a fifth of the bytes."""
    buffer = io.BytesIO()
    # an octree keeps the colours of thin lines, which a palette by frequency mixes with others
    few = Image.open(io.BytesIO(png)).convert("RGB").quantize(SHADES, Image.Quantize.FASTOCTREE)
    few.convert("RGB").save(buffer, "webp", lossless=True, quality=100)
    return buffer.getvalue()


def as_png(figure: Figure | SmallSvg) -> bytes:
    """Render a figure, or a page of small panels, as PNG of 200 dpi.

    Parameters
    ----------
    figure
        Figure of matplotlib, or page of small panels.
    """
    buffer = io.BytesIO()
    drawn = redrawn(figure) if isinstance(figure, SmallSvg) else figure
    with house_style():
        drawn.savefig(buffer, format="png", dpi=200)
    return buffer.getvalue()


def save_figure(figure: Figure | SmallSvg, path: str | os.PathLike[str]) -> None:
    """Write a figure, or a page of small panels, by suffix: ``.svg``, ``.png`` (200 dpi) or ``.pdf``.

    Raises
    ------
    InputError
        Another suffix, or the folder cannot be written to.
    """
    kind = _SUFFIXES.get(Path(path).suffix.lower())
    if kind is None:
        raise InputError(f"cannot write a figure to {path}; use one of {', '.join(_SUFFIXES)}")
    if isinstance(figure, SmallSvg) and kind == "svg":
        with writing_whole_file(path) as temporary:
            Path(temporary).write_text(figure.svg(), encoding="utf-8")
        return
    drawn = redrawn(figure) if isinstance(figure, SmallSvg) else figure
    metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)  # equal figures give equal files
    with writing_whole_file(path) as temporary, house_style():
        drawn.savefig(temporary, format=kind, dpi=200, metadata=metadata)
