"""Figures of a robot's diagnosis: response spectra before and after, and the evidence of every candidate."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mismatch import RobotDiagnosis, predicted_spectrum

from ..style import COLOURS, legend_above, new_figure

Real = NDArray[np.float64]

MOST_LINES = 250
"""Points of a drawn spectrum."""


def robot_spectra_figure(found: RobotDiagnosis) -> Figure:
    """Response over force, all channels together, a panel a posture: measured, as modelled, with the changes."""
    recordings = found.details.robot.recordings
    figure = new_figure(62.0 + 12.0 * (len(recordings) > 3))
    panels = figure.subplots(1, len(recordings), squeeze=False, sharey=True)[0]
    before, after = (found.details.robot.modes(one.changes) for one in (found.details.nominal, found.details.final))
    for number, (axes, recording) in enumerate(zip(panels, recordings, strict=True)):
        spectrum = recording.spectrum
        drawn: list[tuple[Any, dict[str, Any]]] = [
            (spectrum.measured, {"color": "0.65", "linewidth": 2.2, "label": "measured"}),
            (
                predicted_spectrum(before[number], spectrum),
                {"color": COLOURS[2], "linestyle": (0, (4, 1.5)), "label": "as modelled"},
            ),
        ]
        if found.physics:
            changed = predicted_spectrum(after[number], spectrum)
            drawn.append((changed, {"color": COLOURS[1], "label": "with the change"}))
        force = _averaged(np.sum(np.abs(spectrum.force_here) ** 2, axis=1))
        at = _averaged(spectrum.frequencies)
        shift = _averaged(np.abs(spectrum.kinematic[:, 0]))
        for values, look in drawn:
            power = _averaged(np.sum(np.abs(values) ** 2, axis=1))
            axes.semilogy(at, 1e6 * np.sqrt(power / force) / shift, **look)
        axes.set_title(recording.name)
        axes.set_xlabel("Frequency (Hz)")
    panels[0].set_ylabel("Receptance, all channels (µm/N)")
    legend_above(figure, panels[0])
    return figure


def _averaged(values: Real) -> Real:
    """Means of neighbouring lines."""
    size = max(1, len(values) // MOST_LINES)
    kept = len(values) // size * size
    return np.asarray(values[:kept].reshape(-1, size).mean(axis=1))


def robot_evidence_figure(found: RobotDiagnosis) -> Figure:
    """Evidence of every candidate, best on top; on a symmetric logarithmic scale."""
    causes = found.candidates[::-1]
    figure = new_figure(18.0 + 5.0 * len(causes))
    axes = figure.subplots()
    accepted = {cause.name for cause in found.physics} | set(found.equivalents)
    colours = [COLOURS[1] if cause.name in accepted else "0.7" for cause in causes]
    axes.barh([cause.name for cause in causes], [cause.evidence for cause in causes], color=colours, height=0.7)
    axes.set_xscale("symlog", linthresh=20.0, linscale=0.5)
    reach = max(20.0, causes[-1].evidence)
    ticks = [tick for tick in (-10, 0, 10, 20, 50, 100, 200, 500, 1e3, 1e4, 1e5, 1e6) if tick <= 1.2 * reach]
    axes.set_xticks(ticks, [f"{tick:g}".replace("-", "−") for tick in ticks], minor=False)
    axes.set_xticks([], minor=True)
    axes.axvline(20.0, color="k", linewidth=0.8, linestyle="--")
    axes.text(20.0, len(causes) - 0.35, " least that is accepted", va="bottom", ha="left")
    axes.set_xlim(left=min(-20.0, 1.2 * causes[0].evidence))
    axes.set_ylim(top=len(causes) + 0.6)
    axes.set_xlabel("Evidence: gain in score over the robot as modelled")
    axes.grid(axis="y", visible=False)
    return figure
