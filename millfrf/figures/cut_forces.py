"""Figure of identified force coefficients: forces over a revolution, and mean forces over the feed."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from millfrf.core import Complex, Real
from millfrf.mismatch import CutCoefficients

from .style import COLOURS, house_style, legend_above, new_figure, panel_letter

ANGLES = 361  # drawn angles of a revolution
SHOWN = 3  # cuts whose waveforms are drawn: the smallest, the middle and the largest feed
MARKS = "os^"


def cut_coefficients_figure(result: CutCoefficients) -> Figure:
    """Draw measured and computed forces over a revolution of up to three cuts, and all mean forces over the feed."""
    by_feed = sorted(range(len(result.cuts)), key=lambda number: result.cuts[number].process.feed_per_tooth)
    shown = [by_feed[k] for k in sorted({0, len(by_feed) // 2, len(by_feed) - 1})]
    with house_style():
        figure = new_figure(30.0 + 38.0 * (len(shown) + 1))
        panels = np.atleast_1d(figure.subplots(len(shown) + 1, 1))
        degrees = np.linspace(0.0, 360.0, ANGLES)
        for letter, number in enumerate(shown):
            cut, axes = result.cuts[number], panels[letter]
            angle = float(result.fit.angles[number])
            pairs = zip(
                cut.axes, _over_a_turn(cut.mean, angle), _over_a_turn(result.fit.fitted[number], angle), strict=True
            )
            for axis, measured, computed in pairs:
                axes.plot(degrees, measured, color=COLOURS[axis], alpha=0.35, linewidth=2.6)
                axes.plot(degrees, computed, color=COLOURS[axis], label=f"F{'xyz'[axis]}")
            axes.set_title(f"{1e6 * cut.process.feed_per_tooth:.3g} µm per tooth; pale: measured, thin: computed")
            axes.set_ylabel("Force (N)")
            axes.set_xlim(0, 360)
            axes.set_xticks([0, 90, 180, 270, 360])
            panel_letter(axes, letter)
        panels[len(shown) - 1].set_xlabel("Angle of tooth 0 (deg)")
        _draw_means(panels[-1], result)
        panel_letter(panels[-1], len(shown))
        legend_above(figure, panels[0])
    return figure


def _over_a_turn(orders: Complex, angle: float) -> Real:
    """Return the force over the angle of tooth 0, (n_axes, ANGLES), of Fourier coefficients that begin at ``angle``."""
    turn = np.linspace(0.0, 2 * np.pi, ANGLES) - angle
    waves = (
        np.exp(1j * np.outer(np.arange(len(orders)), turn)) * np.where(np.arange(len(orders)) > 0, 2.0, 1.0)[:, None]
    )
    return np.asarray((orders.T @ waves).real)


def _draw_means(axes: Axes, result: CutCoefficients) -> None:
    feeds = np.array([cut.process.feed_per_tooth for cut in result.cuts]) * 1e6
    order = np.argsort(feeds)
    for column, axis in enumerate(result.cuts[0].axes):
        measured = np.array([cut.mean[0, column].real for cut in result.cuts])
        computed = np.array([fitted[0, column].real for fitted in result.fit.fitted])
        axes.plot(feeds, measured, MARKS[axis], color=COLOURS[axis], markersize=4)
        axes.plot(feeds[order], computed[order], color=COLOURS[axis], label=f"F{'xyz'[axis]}")
    axes.set_xlabel("Feed per tooth (µm)")
    axes.set_ylabel("Mean force (N)")
    axes.set_title("Marks: measured, lines: computed as in the waveforms above")
