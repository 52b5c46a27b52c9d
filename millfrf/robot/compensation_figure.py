"""The picture of a compensated path: deviation along the way, without correction and with it."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from millfrf.figures import COLOURS, LINE_STYLES, house_style, new_figure, panel_letter, save_figure
from millfrf.robot_model import CompensatedPath, ToolPath


def draw_compensation(path: Path, nominal: ToolPath, result: CompensatedPath) -> None:
    """Write :func:`compensation_figure` as ``.png``, ``.pdf`` or ``.svg``."""
    with house_style():
        figure = compensation_figure(nominal, result)
    save_figure(figure, path)


def compensation_figure(nominal: ToolPath, result: CompensatedPath) -> Figure:
    """Draw the predicted deviation in the base's x, y and z, its size, and what the correction leaves.

    Parameters
    ----------
    nominal
        The path as it was given.
    result
        The corrected path with its deviations.
    """
    steps = np.linalg.norm(np.diff(nominal.positions, axis=0), axis=1)
    way = 1e3 * np.concatenate([[0.0], np.cumsum(steps)])
    figure = new_figure(95.0)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    for i, name in enumerate("xyz"):
        style = {"color": COLOURS[i + 1], "linestyle": LINE_STYLES[i + 1]}
        upper.plot(way, 1e3 * result.deviations[:, i], **style, label=f"in {name}")
    upper.plot(way, 1e3 * np.linalg.norm(result.deviations[:, :3], axis=1), color=COLOURS[0], label="size")
    upper.set_ylabel("Deviation without\ncorrection (mm)")
    left = 1e6 * np.linalg.norm(result.left[:, :3], axis=1)
    lower.plot(way, left, color=COLOURS[0])
    lower.set_ylabel("Left by the\nsame model (µm)")
    lower.set_ylim(bottom=0)
    lower.yaxis.set_major_formatter("{x:g}")  # a factor above the axis would stand on the panel's letter
    lower.set_xlabel("Way along the path (mm)")
    lower.set_xlim(0, max(float(way[-1]), 1e-9))
    for number, axes in enumerate((upper, lower)):
        panel_letter(axes, number)
    handles, labels = upper.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=4)
    return figure
