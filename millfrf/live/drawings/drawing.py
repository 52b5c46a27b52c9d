"""`Drawing`: a figure of the page that is made once, and what it shows of a snapshot."""

import base64
import unicodedata
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..control import Mark
from ..monitor import Snapshot

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
