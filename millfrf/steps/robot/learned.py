"""Predictions from learned postures: bands of receptance and of depth limits in postures without a measurement."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from millfrf.core import TIP, Real, write_csv
from millfrf.core.progress import progress
from millfrf.core.steps import File
from millfrf.core.terminal import Table
from millfrf.cutting import MillingProcess
from millfrf.robot_model import PredictedPosture, SpatialCase, predict_posture, read_learned_postures
from millfrf.stability import StabilityLobes, lowest_limits
from modal_fit import ModalModel

from ..settings import LOBES, RPM


def predicted_posture(case: SpatialCase, learned: File, driven: Real, axes: Real | None) -> PredictedPosture:
    """Predict the modes in a posture from the file of ``robot learn``; ``axes`` of the cut as columns, None: base."""
    postures = read_learned_postures(learned, case.robot)
    with progress("predicting"):
        return predict_posture(postures, driven, axes=axes)


def table_of_modes(predicted: PredictedPosture, posture: str) -> Table:
    """Predicted frequencies and damping ratios with their 95 % bands."""
    model = predicted.model
    frequency, damping = predicted.frequency_band(), 100 * predicted.damping_band()
    rows = tuple(
        (str(r + 1), f"{f:.3f}", _span(frequency[:, r], 3), f"{100 * z:.2f}", _span(damping[:, r], 2))
        for r, (f, z) in enumerate(zip(model.natural_frequencies, model.damping_ratios, strict=True))
    )
    columns = ("mode", "frequency (Hz)", "95 % band", "damping ratio (%)", "95 % band")
    return Table(f"Modes predicted in the posture {posture}", columns, rows)


def _span(ends: Real, digits: int) -> str:
    return f"{ends[0]:.{digits}f} - {ends[1]:.{digits}f}"


def write_receptance_band(
    path: Path, frequencies: Real, predicted: PredictedPosture, provenance: Mapping[str, Any]
) -> None:
    """Write a row for each line and entry: magnitude of the mean and both ends of its band, m/N."""
    mean, ends = np.abs(predicted.model.receptance(frequencies)), predicted.receptance_band(frequencies)
    columns = ("frequency_hz", "response", "excitation", "magnitude_m_per_n", "low_m_per_n", "high_m_per_n")
    rows = [
        (frequency, response, excitation, *(value[k, p, q] for value in (mean, ends[0], ends[1])))
        for k, frequency in enumerate(frequencies)
        for p, response in enumerate(TIP)
        for q, excitation in enumerate(TIP)
    ]
    write_csv(path, columns, rows, warnings=predicted.warnings, provenance=provenance)


@dataclass(frozen=True)
class DepthBand:
    """95 % band of the depth limit at each speed."""

    spindle_speeds: Real  # (n_speeds,), rad/s; spindle speeds of the limits
    # low, middle, high: (n_speeds,), m; ends of the band and median of the samples; ``max_depth`` where the limit
    # lies above it
    low: Real
    middle: Real  # (n_speeds,), m
    high: Real  # (n_speeds,), m
    max_depth: float  # m; largest depth that was searched


def depth_band(
    draws: Sequence[ModalModel],
    process: MillingProcess,
    spindle_speeds: Real,
    max_depth: float,
    samples: int = LOBES.samples,
    progress: Callable[[int], None] | None = None,
) -> DepthBand:
    """95 % band of the depth limits of ``samples`` of the drawn models, time-periodic; speeds in rad/s, depth in m.

    ``progress`` is called with the number of models that are done.
    """
    chosen = spread_draws(draws, samples)
    limits = np.empty((len(chosen), len(spindle_speeds)))
    for row, draw in enumerate(chosen):
        lowest = lowest_limits(draw, process, spindle_speeds, max_depth).lowest()
        unresolved = np.array([status == "unresolved" for status in lowest.status])
        limits[row] = np.where(unresolved, 0.0, np.minimum(lowest.depth_limits, max_depth))
        if progress is not None:
            progress(row + 1)
    ordered = np.sort(limits, axis=0)  # the band omits round(0.025 (n + 1)) - 1 limits at either end
    end = max(round(0.025 * (len(chosen) + 1)), 1)
    return DepthBand(np.asarray(spindle_speeds), ordered[end - 1], np.median(ordered, axis=0), ordered[-end], max_depth)


def spread_draws(draws: Sequence[ModalModel], samples: int = LOBES.samples) -> list[ModalModel]:
    """Return ``samples`` of the drawn models, evenly spread over those of all drawn hyperparameters."""
    return [draws[index] for index in np.linspace(0, len(draws) - 1, min(samples, len(draws))).astype(int)]


def write_depth_band(path: Path, band: DepthBand, warnings: Sequence[str], provenance: Mapping[str, Any]) -> None:
    """Write speeds (rpm), ends and median of the band (m)."""
    columns = ("spindle_speed_rpm", "depth_low_m", "depth_median_m", "depth_high_m")
    values = zip(band.spindle_speeds / RPM, band.low, band.middle, band.high, strict=True)
    write_csv(path, columns, values, warnings=warnings, provenance=provenance)


def depth_band_figure(band: DepthBand, lobes: StabilityLobes) -> Figure:
    """Draw the band, its median, and the lobes of the mean model."""
    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    axes = figure.add_subplot()
    speeds = band.spindle_speeds / RPM
    limits = np.minimum(lobes.depth_limits, band.max_depth)
    axes.fill_between(speeds, 1e3 * band.low, 1e3 * band.high, color="0.82", label="95 % band")
    axes.plot(speeds, 1e3 * band.middle, color="0.25", linestyle="--", label="median of the draws")
    axes.plot(lobes.spindle_speeds_rpm, 1e3 * limits, color="C0", label="model in the middle")
    axes.set(xlabel="spindle speed (rpm)", ylabel="depth limit (mm)", ylim=(0, 1.05e3 * float(band.high.max())))
    axes.set_xlim(float(speeds.min()), float(speeds.max()) if len(speeds) > 1 else float(speeds.max()) + 1)
    axes.legend(frameon=False)
    axes.grid(True, color="0.9")
    return figure
