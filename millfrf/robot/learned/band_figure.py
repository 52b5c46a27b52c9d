"""Picture of the depth limit over spindle speed with its band."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from millfrf.figures import save_figure
from millfrf.stability import StabilityLobes

from .depth_band import DepthBand

RPM = np.pi / 30


def draw_depth_band(path: Path, band: DepthBand, lobes: StabilityLobes) -> None:
    """Draw the band, its median, and the lobes of the model in the middle; readable in grey."""
    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    axes = figure.add_subplot()
    speeds = band.spindle_speeds / RPM
    axes.fill_between(speeds, 1e3 * band.low, 1e3 * band.high, color="0.82", label="95 % band")
    axes.plot(speeds, 1e3 * band.middle, color="0.25", linestyle="--", label="median of the draws")
    axes.plot(
        lobes.spindle_speeds_rpm,
        1e3 * np.minimum(lobes.depth_limits, band.max_depth),
        color="C0",
        label="model in the middle",
    )
    axes.set(xlabel="spindle speed (rpm)", ylabel="depth limit (mm)", ylim=(0, 1.05e3 * float(band.high.max())))
    axes.set_xlim(float(speeds.min()), float(speeds.max()) if len(speeds) > 1 else float(speeds.max()) + 1)
    axes.legend(frameon=False)
    axes.grid(True, color="0.9")
    save_figure(figure, path)
