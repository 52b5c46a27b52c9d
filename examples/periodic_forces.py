"""Noise, distortion and softening of a wing, from forces that repeat and without a model.

The wing of an F-16 with a payload on bolts was shaken by the same periodic multisine of 2 to 15 Hz at two levels (Noel
& Schoukens, F-16 aircraft benchmark based on ground vibration test data, 2017, 4TU.ResearchData 12954911).

Run it: `python examples/periodic_forces.py FOLDER [PICTURES]`; FOLDER holds `level_1.h5` and `level_3.h5`.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from estimation import (
    Distortion,
    Homogeneity,
    MeasuredNoise,
    SteadyPeriods,
    distortion,
    excited_lines,
    homogeneity,
    linear_approximation,
    noise_of_periods,
    read_band_recording,
    steady_periods,
)
from millfrf.figures import COLOURS, LINE_STYLES, house_style, new_figure, panel_letter
from modal_fit import AmplitudeDependence, amplitude_dependence

EXCITED, SENSORS = ["EXC:+Z"], ["EXC:+Z", "WING:+Z", "PAYLOAD:+Z"]
BAND, FITTED = (2.0, 15.0), (3.0, 11.0)
WING = 1


@dataclass(frozen=True)
class Findings:
    """Findings at two levels.

    Parameters
    ----------
    periods, noises, distortions
        Steady periods, noise in the excited band and distortion of each level.
    comparison
        FRFs of both levels beside each other.
    dependence
        Modes at both levels.
    """

    periods: tuple[SteadyPeriods, ...]
    noises: tuple[MeasuredNoise, ...]
    distortions: tuple[Distortion, ...]
    comparison: Homogeneity
    dependence: AmplitudeDependence


def study(folder: Path) -> Findings:
    """All that the two recordings tell without a model of the structure."""
    files = [folder / "level_1.h5", folder / "level_3.h5"]
    periods = tuple(steady_periods([read_band_recording(path, EXCITED, SENSORS, 400.0)]) for path in files)
    return Findings(
        periods,
        tuple(noise_of_periods(each.within(BAND)) for each in periods),
        tuple(distortion(each) for each in periods),
        homogeneity(*periods),
        amplitude_dependence(periods, FITTED),
    )


def spectra_picture(found: Findings) -> Figure:
    """Response of the wing at the lines that were excited and at the others, beside the noise, for both levels."""
    figure = new_figure(75)
    panels = figure.subplots(1, 2, sharey=True)
    for number, (axes, periods) in enumerate(zip(panels, found.periods, strict=True)):
        f, size = periods.frequencies, np.sqrt(2 / round(periods.period * periods.rate))
        mean = np.abs(periods.realisations[0].responses.mean(axis=0)[:, WING]) * size
        noise = noise_of_periods(periods).responses[:, WING, WING].real / periods.realisations[0].n_periods
        excited, shown = excited_lines(periods), f < 45
        axes.semilogy(f[excited], mean[excited], "o", color=COLOURS[0], markersize=2.2, label="Excited lines")
        others = shown & ~excited & (f > BAND[1])
        axes.semilogy(f[others], mean[others], "x", color=COLOURS[2], markersize=2.6, label="Lines not excited")
        axes.semilogy(
            f[shown],
            np.sqrt(noise[shown]) * size,
            color=COLOURS[1],
            linestyle=LINE_STYLES[1],
            label="Noise of the mean of eight periods",
        )
        axes.set(xlabel="Frequency (Hz)", xlim=(0, 45), ylim=(2e-6, 1.0))
        panel_letter(axes, number)
        axes.set_title(f"{periods.level:.3g} N rms")
    panels[0].set_ylabel("WING, rms of a line (m/s²)")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure


def levels_picture(found: Findings) -> Figure:
    """FRF of the payload near its mode at 7.3 Hz, and how all modes change from the lower to the higher level."""
    figure = new_figure(70)
    panels = figure.subplots(1, 3, width_ratios=[1.5, 1, 1])
    for number, periods in enumerate(found.periods):
        linear = linear_approximation(periods)
        f, values = linear.frf.frequencies, np.abs(linear.frf.values[:, 2, 0])
        error = 2 * np.sqrt(linear.frf.covariance.variance()[:, 2, 0]) if linear.frf.covariance else 0 * values
        panels[0].errorbar(
            f,
            values,
            error,
            color=COLOURS[2 * number],
            linestyle=LINE_STYLES[number],
            marker="os"[number],
            markersize=3,
            label=f"{periods.level:.3g} N rms",
        )
    panels[0].set(xlabel="Frequency (Hz)", ylabel="PAYLOAD over force (m/s²/N)", xlim=(6.9, 7.7), ylim=(0, 0.31))
    panels[0].legend(loc="upper right", ncols=2)
    changes = found.dependence.changes()
    shifts = [(each.frequency, each.frequency_change, each.frequency_error) for each in changes]
    gains = [(each.frequency, each.damping_change, each.damping_error) for each in changes]
    _changes(panels[1], shifts, "natural frequency (%)")
    _changes(panels[2], gains, "damping ratio (%)")
    for number, axes in enumerate(panels):
        panel_letter(axes, number)
    return figure


def _changes(axes: Axes, rows: list[tuple[float, float, float]], what: str) -> None:
    at, change, error = np.array(rows).T
    axes.axhline(0, color="#808080", linewidth=0.8)
    axes.errorbar(at, 100 * change, 200 * error, fmt="o", color=COLOURS[0], markersize=3.5, capsize=2)
    axes.set(xlabel="Mode at (Hz)", ylabel=f"Change of {what}")


def main(folder: Path, pictures: Path | None) -> None:
    """Print what was found, and draw it."""
    result = study(folder)
    for periods, noise, distorted in zip(result.periods, result.noises, result.distortions, strict=True):
        shares = ", ".join(
            f"{channel.name} {100 * share:.2g} %"
            for channel, share in zip(periods.responses, noise.response_share, strict=True)
        )
        print(f"{periods.level:.3g} N rms: noise {shares}, force {100 * noise.force_share[0]:.2g} %. {noise.statement}")
        print(*(f"  {each}" for each in distorted.sentences()), sep="\n")
    other = result.comparison
    print(f"homogeneity: {other.differing.sum(axis=0)} of {len(other.frequencies)} lines differ, {other.statement}")
    print(*result.dependence.sentences(), sep="\n")
    if pictures is not None:
        with house_style():
            spectra_picture(result).savefig(pictures / "repeats_spectra.png", dpi=150)
            levels_picture(result).savefig(pictures / "repeats_levels.png", dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)
