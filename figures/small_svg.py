"""Many small panels as one SVG of few bytes: curves as relative moves in tenths of a millimetre, simplified."""

import base64
from dataclasses import dataclass, field
from html import escape

import numpy as np
from matplotlib.path import Path
from numpy.typing import NDArray

Real = NDArray[np.float64]
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
