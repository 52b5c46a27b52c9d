"""What `millfrf tap` does to a tap, and what a Hann window makes of the same recording.

Run it: `python examples/hammer_test.py [PICTURE.png]`. Five recordings of the simulated robot cell, one tap each on the
tool tip, ended after a second while the lowest mode still rings with 5 % of its amplitude.
"""

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from acquisition import Recording, record
from estimation import exponential_window, force_window
from millfrf.core import TIP
from millfrf.steps.tap import TapResult, tap
from replay_data import HammerCell, default_structure, dynamometer, select, tip_accelerometers

RATE, SECONDS = 2048.0, 1.0
SHOWN = (8.0, 150.0)


@dataclass(frozen=True)
class Compared:
    """FRFs of one entry, accelerance in m/s^2/N.

    Parameters
    ----------
    result
        Merged taps of the hammer test.
    samples : (n_samples, 2)
        Force and answer of the first recording.
    frequencies : (n_lines,), Hz
        Frequencies of the lines that are compared.
    tapped, truth, shifted : (n_lines,)
        As measured; of the structure; of the structure at ``i w + 1/tau``, where the measured values stand.
    hann_frequencies, hann : (n_hann,)
        The first recording under one Hann window.
    """

    result: TapResult
    samples: NDArray[np.float64]
    frequencies: NDArray[np.float64]
    tapped: NDArray[np.complex128]
    truth: NDArray[np.complex128]
    shifted: NDArray[np.complex128]
    hann_frequencies: NDArray[np.float64]
    hann: NDArray[np.complex128]


def recordings(folder: Path) -> list[Path]:
    """Five of one tap each."""
    sensors = (dynamometer(0.001, 2000.0)[0], tip_accelerometers(0.001)[0])
    paths = []
    for seed in range(5):
        cell = HammerCell(
            default_structure(),
            directions=["TCP:+X"],
            taps=1,
            spacing=SECONDS,
            sample_rate=RATE,
            sensors=sensors,
            seed=seed,
        )
        paths.append(folder / f"tap_{seed + 1}.h5")
        record(cell, paths[-1])
    return paths


def compare() -> Compared:
    """Tap the simulated robot, and evaluate its FRF where it was measured."""
    with tempfile.TemporaryDirectory() as folder:
        paths = recordings(Path(folder))
        result = tap(*paths, band=SHOWN)
        with Recording(paths[0]) as recording:
            samples = recording.stream().read()
    frf = result.merged.frf
    hann = np.fft.rfft(samples * np.hanning(len(samples))[:, None], axis=0)
    axis = np.fft.rfftfreq(len(samples), 1 / RATE)
    inside = (axis >= SHOWN[0]) & (axis <= SHOWN[1])
    return Compared(
        result,
        samples,
        frf.frequencies,
        frf.values[:, 0, 0],
        accelerance(2j * np.pi * frf.frequencies),
        accelerance(frf.laplace),
        axis[inside],
        (hann[:, 1] / hann[:, 0])[inside],
    )


def accelerance(s: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Give the FRF of the simulated tool tip along X, at points of the Laplace plane."""
    tip = select(default_structure(), TIP[:1], TIP[:1])
    residues = tip.right[:, 0] * tip.left[:, 0]
    terms = residues / (s[:, None] - tip.poles) + residues.conj() / (s[:, None] - tip.poles.conj())
    return np.asarray(s**2 * terms.sum(axis=1))


def draw_windows(axes: Axes, compared: Compared) -> None:
    """Force and answer of the first tap with their windows."""
    settings, samples = compared.result.settings, compared.samples
    start = compared.result.found[0].used[0].place - settings.before
    part = samples[start : start + settings.length]
    time = np.arange(len(part)) / settings.sample_rate
    for column, (name, colour) in enumerate((("force", "C3"), ("answer", "C0"))):
        axes.plot(time, part[:, column] / np.abs(part[:, column]).max(), color=colour, lw=0.8, label=name)
    assert settings.time_constant is not None
    assert settings.force_samples is not None
    cut = force_window(len(part), settings.sample_rate, settings.force_samples / settings.sample_rate)
    falling = exponential_window(len(part), settings.sample_rate, settings.time_constant)
    axes.plot(time, cut, color="C3", ls="--", lw=1, label="force window")
    axes.plot(time, falling, color="k", ls="--", lw=1, label=f"exp(-t / {settings.time_constant:.2f} s)")
    axes.set(xlabel="time (s)", ylabel="over the largest value", ylim=(-1.1, 1.1))
    axes.legend(frameon=False, fontsize=8)


def draw_frfs(axes: Axes, compared: Compared) -> None:
    """Truth, taps and Hann window."""
    f = compared.frequencies
    axes.semilogy(compared.hann_frequencies, np.abs(compared.hann), color="0.6", lw=1, label="one Hann window")
    axes.semilogy(f, np.abs(compared.truth), color="k", lw=1, label="truth")
    axes.semilogy(f, np.abs(compared.shifted), color="C0", ls="--", lw=1, label="truth at i w + 1/tau")
    axes.semilogy(f, np.abs(compared.tapped), ".", color="C0", ms=3, label="millfrf tap")
    axes.set(xlabel="frequency (Hz)", ylabel="accelerance (m/s²/N)", xlim=SHOWN)
    axes.legend(frameon=False, fontsize=8)


def main(picture: Path) -> None:
    """Draw, and print how far each is from the truth at its resonances."""
    compared = compare()
    figure = Figure(figsize=(9, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    draw_windows(left, compared)
    draw_frfs(right, compared)
    figure.savefig(picture, dpi=150)
    wrong = np.abs(compared.tapped - compared.shifted).max() / np.abs(compared.shifted).max()
    truth = accelerance(2j * np.pi * compared.hann_frequencies)
    times = np.abs(compared.hann / truth)
    print(f"{len(compared.result.found)} taps, {100 * compared.result.decay.left:.1f} % of the answer left at the end")
    print(f"millfrf tap: off by {100 * wrong:.2f} % of the largest value")
    print(f"one Hann window: {times.min():.1f} to {times.max():.1f} times the truth")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "hammer_test.png"))
