"""How the residual grows with the level of excitation, on logarithmic axes."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator
from numpy.typing import NDArray

from ..log_axes import decade_axis
from ..style import COLOURS, house_style, legend_above, legend_height, new_figure, place_panels

LABELS = {"residual": "Nominal model, refitted", "effect": "Final model without its joint law"}
LEAST_GAP = 0.06
"""Between two labels of forces, as a share of the axis."""
REFERENCES = ((0, "dry friction"), (1, "linear"), (3, "cubic"))


def growth_figure(content: Mapping[str, Any]) -> Figure:
    """Residual above noise over force, with the slopes of typical omissions through the middle point.

    Parameters
    ----------
    content
        ``growth`` of a diagnosis' ``located``.
    """
    with house_style():
        figure = new_figure(95.0, None)
        axes = figure.subplots()
        shown = [key for key in LABELS if key in content]
        for number, key in enumerate(shown):
            _draw(axes, LABELS[key], content[key], number)
        found = content[shown[0]]
        forces, noise = _forces(found), 100 * np.array(found["noise"])
        axes.plot(forces, noise, color="#777777", linestyle=":", marker="_", label="Noise")
        low, high = _references(axes, found)
        tops = [100 * np.max(np.add(content[key]["amplitude"], content[key]["standard_error"])) for key in shown]
        decade_axis(axes, "y", min(low, 0.3 * noise.min()), max(high, 1.5 * max(tops)), label=_plain)
        _force_axis(axes, forces)
        unit = found.get("drive_unit", "N")
        axes.set_xlabel(f"{'Force' if unit == 'N' else 'Drive'}, root mean square ({unit})")
        axes.set_ylabel("Residual less noise / response,\nroot mean square (%)")
        place_panels(figure, left=20.0, top=legend_height(axes, 1))
        legend_above(figure, axes, columns=1)
    return figure


def _forces(found: Mapping[str, Any]) -> NDArray[np.float64]:
    """Levels of what drives the rig, in newtons or in the unit that the file names."""
    return np.array(found["drive_rms"] if "drive_rms" in found else found["force_rms_n"], dtype=float)


def _plain(power: int) -> str:
    return f"{10.0**power:g}"


def _draw(axes: Axes, label: str, found: Mapping[str, Any], number: int) -> None:
    force, amplitude, error = _forces(found), *(np.array(found[key]) for key in ("amplitude", "standard_error"))
    seen = amplitude > 0
    if found["exponent"] is not None:
        label += f": exponent {round(found['exponent'], 2) + 0.0:.2f} ± {found['exponent_standard_error']:.2f}"
    axes.errorbar(
        force[seen],
        100 * amplitude[seen],
        yerr=200 * error[seen],
        color=COLOURS[2 * number],
        marker="os"[number],
        markersize=4.5,
        linestyle="-" if number == 0 else (0, (5, 1.5)),
        capsize=2,
        label=label,
    )


def _references(axes: Axes, found: Mapping[str, Any]) -> tuple[float, float]:
    """Thin lines of the slopes 0, 1 and 3 through the point in the middle; the range that shows them, in percent."""
    force, amplitude = _forces(found), 100 * np.array(found["amplitude"])
    seen = amplitude > 0
    if not seen.any():
        return np.inf, 0.0
    x0, y0 = (float(np.exp(np.log(values[seen]).mean())) for values in (force, amplitude))
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
    return 0.7 * float(amplitude[seen].min()), 1.5 * y0


def _force_axis(axes: Axes, forces: NDArray[np.float64]) -> None:
    """The force of each recording as a tick; labels that would touch are left out."""
    ends = (0.55 * forces.min(), 1.2 * forces.max())
    axes.set_xscale("log")
    axes.set_xlim(ends)
    labels, last = [], -np.inf
    for force in np.sort(forces):
        place = np.log(force / ends[0]) / np.log(ends[1] / ends[0])
        labels.append(f"{force:.3g}" if place - last > LEAST_GAP else "")
        last = place if labels[-1] else last
    axes.set_xticks(np.sort(forces), labels)
    axes.xaxis.set_minor_locator(NullLocator())
