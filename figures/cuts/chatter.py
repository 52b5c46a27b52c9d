"""Spectra of judged cuts: spindle orders apart, what is left of them, the noise floor, lines with their names."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stability import ChatterVerdict, CutSpectrum

from ..style import COLOURS, house_style, legend_above, new_figure, panel_letter

EACH_MM = 62.0
_DECADES = 0.5  # below the floor that are drawn


@dataclass(frozen=True)
class ShownCut:
    """One panel of the figure: a cut with its spectrum.

    Parameters
    ----------
    title
        Text above the panel.
    quantity
        Quantity of the channel with its unit, for the axis.
    verdict, spectrum
        Verdict on the cut, and the spectrum it was found from.
    """

    title: str
    quantity: str
    verdict: ChatterVerdict
    spectrum: CutSpectrum


def chatter_figure(cuts: Sequence[ShownCut]) -> Figure:
    """One panel a cut: orders as grey lines, the rest in blue, its floor in black, arrows at named lines."""
    with house_style():
        figure = new_figure(12.0 + EACH_MM * len(cuts))
        panels = np.atleast_1d(figure.subplots(len(cuts), 1))
        for number, (axes, cut) in enumerate(zip(panels, cuts, strict=True)):
            _draw(axes, cut)
            panel_letter(axes, number)
        panels[-1].set_xlabel("Frequency (Hz)")
        legend_above(figure, panels[0], columns=3)
    return figure


def _draw(axes: Axes, cut: ShownCut) -> None:
    seen = cut.spectrum
    known = np.concatenate([seen.amplitude[np.isfinite(seen.amplitude)], seen.floor[np.isfinite(seen.floor)]])
    low = float(known[known > 0].min()) * 10**-_DECADES
    high = float(max(known.max(), seen.order_amplitudes.max(initial=0.0)))
    axes.set_yscale("log")
    axes.vlines(
        seen.order_frequencies, low, np.maximum(seen.order_amplitudes, low), color="0.6", lw=1.6, label="spindle orders"
    )
    axes.plot(seen.frequencies, seen.amplitude, color=COLOURS[1], lw=0.7, label="what does not repeat")
    axes.plot(seen.frequencies, seen.floor, color="black", lw=1.2, ls=(0, (5, 1.5)), label="floor of the noise")
    named = _named(cut.verdict)
    for row, (frequency, text) in enumerate(named):
        _point_at(axes, seen, frequency, text, high * 3.0 ** (row % 3 + 1))
    axes.set(xlim=(0.0, float(seen.frequencies[-1])), ylim=(low, high * 3.0 ** (min(len(named), 3) + 1)))
    axes.set_ylabel(cut.quantity)
    axes.set_title(cut.title, loc="center")


def _named(verdict: ChatterVerdict) -> list[tuple[float, str]]:
    """Frequency (Hz) and name of the lines that are told, in order of frequency."""
    named = [
        (tone.frequency, tone.name if "Hz" in tone.name else f"{tone.name}, {tone.frequency:.4g} Hz")
        for tone in verdict.foreign
    ]
    if math.isfinite(verdict.frequency):
        named.append((verdict.frequency, f"chatter, {verdict.frequency:.4g} Hz"))
    return sorted(named)


def _point_at(axes: Axes, seen: CutSpectrum, frequency: float, text: str, height: float) -> None:
    """An arrow from a name to its line."""
    near = np.abs(seen.frequencies - frequency) < 0.01 * seen.frequencies[-1]
    found = seen.amplitude[near & np.isfinite(seen.amplitude)]
    top = float(found.max()) if len(found) else height / 2
    right = frequency > 0.75 * seen.frequencies[-1]
    axes.annotate(
        text,
        (frequency, top),
        (frequency + (-1 if right else 1) * 0.015 * seen.frequencies[-1], height),
        ha="right" if right else "left",
        va="center",
        arrowprops={"arrowstyle": "-", "lw": 0.6},
        fontsize=8,
    )
