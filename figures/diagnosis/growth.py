"""How the residual grows with the level of excitation, on logarithmic axes."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from ..style import COLOURS, house_style, legend_above, new_figure

LABELS = {"residual": "Nominal model, refitted", "effect": "Final model without its joint law"}
REFERENCES = ((0, "dry friction"), (1, "linear"), (3, "cubic"))


def growth_figure(content: Mapping[str, Any]) -> Figure:
    """Residual above noise over force, with the slopes of typical omissions through the middle point.

    Parameters
    ----------
    content
        ``growth`` of a diagnosis' ``located``.
    """
    with house_style():
        figure = new_figure(95.0)
        axes = figure.subplots()
        shown = [key for key in LABELS if key in content]
        for number, key in enumerate(shown):
            _draw(axes, LABELS[key], content[key], number)
        _references(axes, content[shown[0]])
        noise = content[shown[0]]
        axes.plot(noise["force_rms_n"], noise["noise"], color="#777777", linestyle=":", marker="_", label="Noise")
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("Force, root mean square (N)")
        axes.set_ylabel("Residual less noise / response,\nroot mean square (%)")
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{100 * value:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
        forces = np.array(noise["force_rms_n"])
        axes.set_xticks(forces, [f"{force:.3g}" for force in forces])
        axes.set_xticks([], minor=True)
        axes.set_xlim(0.55 * forces.min(), 1.2 * forces.max())
        legend_above(figure, axes, columns=1)
    return figure


def _draw(axes: Axes, label: str, found: Mapping[str, Any], number: int) -> None:
    force, amplitude, error = (np.array(found[key]) for key in ("force_rms_n", "amplitude", "standard_error"))
    seen = amplitude > 0
    if found["exponent"] is not None:
        label += f": exponent {round(found['exponent'], 2) + 0.0:.2f} ± {found['exponent_standard_error']:.2f}"
    axes.errorbar(
        force[seen],
        amplitude[seen],
        yerr=2 * error[seen],
        color=COLOURS[2 * number],
        marker="os"[number],
        markersize=4.5,
        linestyle="-" if number == 0 else (0, (5, 1.5)),
        capsize=2,
        label=label,
    )


def _references(axes: Axes, found: Mapping[str, Any]) -> None:
    """Thin lines of the slopes 0, 1 and 3 through the point in the middle."""
    force, amplitude = np.array(found["force_rms_n"]), np.array(found["amplitude"])
    seen = amplitude > 0
    if not seen.any():
        return
    x0, y0 = (float(np.exp(np.log(values[seen]).mean())) for values in (force, amplitude))
    low, high = axes.get_ylim()
    ends = np.array([0.8 * force.min(), 1.12 * force.max()])
    for slope, name in REFERENCES:
        line = y0 * (ends / x0) ** slope
        axes.plot(ends, line, color="#aaaaaa", linewidth=0.7, zorder=1)
        axes.annotate(
            f"{name}, {slope}",
            (ends[0], line[0]),
            xytext=(-3, 0),
            textcoords="offset points",
            va="center",
            ha="right",
            color="#555555",
        )
    axes.set_ylim(min(low, 0.3 * float(np.min(found["noise"]))), max(high, 1.5 * y0))
