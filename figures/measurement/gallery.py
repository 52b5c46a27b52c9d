"""Small panels of many FRFs: magnitude and phase, measured and synthesised, with the misfit of each."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from ..small_svg import SmallSvg
from ..style import FITTED, TRUE, WIDTH_MM

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

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
