"""A page of small panels drawn once more by matplotlib, which writes it as PNG or PDF."""

import re
from xml.etree import ElementTree

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from numpy.typing import NDArray

from .small_svg import SmallSvg
from .style import house_style

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
