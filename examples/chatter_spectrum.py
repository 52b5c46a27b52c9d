"""What `millfrf chatter` sees: spectra of a stable and of a chattering cut without their orders, floor and names.

Run it: `python examples/chatter_spectrum.py [PICTURE.png]`. Two cuts of the simulated cell of Table 1 with 10 % noise,
20 um runout and hum of the mains; the spindle is stated 0.5 % too fast.
"""

import sys
from math import pi
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from millfrf.cutting import MillingProcess
from millfrf.stability import ChatterVerdict, classify_cut, gather_evidence
from replay_data import MillingCell, dynamometer, table_one_model, tip_accelerometers

RPM = pi / 30
SPEED = 800 * RPM
RATE = 2048.0
CUT = MillingProcess(2, 12.7e-3, pi / 2, 119e6, 0.17, 0.33, pi / 2, pi, 0.15e-3, runout=20e-6)
DEPTHS = (1.4e-3, 2.1e-3)


def recorded(depth: float) -> NDArray[np.float64]:
    """Accelerations of the tip in X and Y over 25 s, with noise and hum."""
    sensors = dynamometer(0.1) + tip_accelerometers(0.1)
    cell = MillingCell(table_one_model(), CUT, depth, SPEED, 25.0, sample_rate=RATE, sensors=sensors)
    samples = cell.samples()[:, 3:5]
    hum = np.cos(2 * pi * 50 * np.arange(len(samples)) / RATE)
    return np.asarray(samples + 0.1 * samples.std(axis=0) * hum[:, None])


def draw(axes: Axes, samples: NDArray[np.float64], title: str) -> ChatterVerdict:
    """Spectrum of the second half in Y: orders, what is left of them, its floor, and lines with their names."""
    stated = 1.005 * SPEED
    modes = tuple(float(f) for f in table_one_model().natural_frequencies)
    verdict = classify_cut(samples, RATE, stated, CUT.teeth, derivatives=(2, 2), natural_frequencies=modes)
    evidence = gather_evidence(samples, RATE, stated, CUT.teeth)
    spectrum, spindle = evidence.spectrum, evidence.track.mean_frequency
    turn = evidence.late.mean_turn[:, 1]
    orders = np.sqrt(2) * np.abs(np.fft.rfft(turn))[1:8] / len(turn)
    frequencies = spectrum.orders * spindle
    shown = (frequencies < 90) & (frequencies > 2)
    left = np.where(spectrum.searched, spectrum.power[:, 1], np.nan)
    axes.vlines(np.arange(1, 8) * spindle, 1e-5, orders, color="0.6", lw=1.5, label="spindle orders, taken away")
    axes.semilogy(frequencies[shown], np.sqrt(left[shown]), color="C0", lw=0.6, label="what does not repeat")
    axes.semilogy(frequencies[shown], np.sqrt(spectrum.floor[shown, 1]), color="k", lw=1.2, label="floor of the noise")
    for tone in verdict.foreign:
        axes.annotate(tone.name, (tone.frequency, 0.06), (tone.frequency + 4.5, 0.35), arrowprops={"arrowstyle": "-"})
    if np.isfinite(verdict.frequency):
        text = f"chatter\n{verdict.frequency:.2f} Hz"
        axes.annotate(text, (verdict.frequency, 0.8), (verdict.frequency + 2.5, 1.5), arrowprops={"arrowstyle": "-"})
    axes.set(xlim=(0, 90), ylim=(2e-4, 6), ylabel="share of the motion (rms)", title=f"{title}: {verdict.kind}")
    return verdict


def main(picture: Path) -> None:
    """Draw both cuts and print what was found."""
    figure = Figure(figsize=(8, 6), layout="constrained")
    for axes, depth in zip(figure.subplots(2, 1, sharex=True), DEPTHS, strict=True):
        result = draw(axes, recorded(depth), f"{1e3 * depth:g} mm deep")
        line = "" if np.isnan(result.frequency) else f" at {result.frequency:.2f} Hz"
        print(f"{1e3 * depth:g} mm: {result.kind}{line}, spindle {result.spindle_speed / RPM:.2f} rpm; {result.reason}")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
    figure.axes[1].set_xlabel("frequency (Hz)")
    figure.savefig(picture, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "chatter_spectrum.png"))
