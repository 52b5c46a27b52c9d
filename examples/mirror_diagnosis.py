"""What does a linear model of the fine steering mirror leave out? Measured without a model, then asked of the library.

CubeSpec fine steering mirror (Merijn Floren, KU Leuven, 2025, CC BY 4.0; github.com/merijnfloren/fsm-benchmark-data):
three piezo voltages in, three displacements out, orthogonal random-phase multisines at three amplitudes.

Run it: `python examples/mirror_diagnosis.py FOLDER [MODEL.json]`; MODEL.json is fitted to the 100 mV part as in
`docs/real_rig.md`, with `--band 300 2250`; without it only the table is printed.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from estimation import BandRecording, WindowedSpectrum, channels_of, windowed_spectrum
from millfrf.mismatch import (
    Hypothesis,
    JointPhysics,
    LabError,
    ModelShape,
    behaviour_of,
    find_direction,
    fit,
    library,
    linear_floor,
    predict_lines,
    screen_joints,
)
from modal_fit import ModalModel, read_modal_model

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

RATE, PERIOD = 6400.0, 8192
LEVELS = (100, 200, 300)
"""mV; root mean square 0.099, 0.198 and 0.297 V."""

BAND = (500.0, 2900.0)
MODEL_BAND = (320.0, 2230.0)
"""Hz: of the table, and of the comparison with a modal model of 300-2250 Hz."""


def spectra(folder: Path, level: int, part: str) -> tuple[Complex, Complex]:
    """Lines of BAND, input and output, (n_periods, n_realisations, n_lines, 3 channels, 3 experiments)."""
    f = np.fft.rfftfreq(PERIOD, 1 / RATE)
    inside = (f >= BAND[0]) & (f <= BAND[1])
    both = []
    for kind in ("u", "y"):
        samples = np.load(folder / f"{kind}_{level}mV_{part}.npy")  # samples, channels, experiments, periods
        lines = np.fft.rfft(samples, axis=0)[inside]
        both.append(lines.reshape(*lines.shape[:2], -1, 3, 2).transpose(4, 2, 0, 1, 3))
    return both[0], both[1]


def linear_frf(folder: Path, level: int) -> tuple[Complex, float, float]:
    """Best linear approximation (n_lines, 3, 3) of the train part, and shares of the response's power that stay out.

    The first share is noise, from the difference of the two periods; the second is what differs between the two
    realisations beyond noise: distortion that no linear model can hold (Pintelon & Schoukens, System Identification,
    2nd ed., section 4.3).
    """
    u, y = spectra(folder, level, "train")
    single = y.mean(axis=0) @ np.linalg.inv(u.mean(axis=0))
    frf = single.mean(axis=0)
    power = np.sum(np.abs(y.mean(axis=0)) ** 2)
    noise = np.sum(np.abs(y[0] - y[1]) ** 2) / 4 / power
    total = 2 * np.sum(np.abs(y.mean(axis=0) - frf @ u.mean(axis=0)) ** 2) / power
    return frf, float(noise), float(total - noise)


def left_over(folder: Path, frf: Complex, level: int) -> float:
    """Share of the test responses' power that an FRF does not explain."""
    u, y = (each.mean(axis=0) for each in spectra(folder, level, "test"))
    return float(np.sum(np.abs(y - frf @ u) ** 2) / np.sum(np.abs(y) ** 2))


def growth(frequencies: list[Real]) -> tuple[float, float, float]:
    """Median relative fall of the modes' frequencies to levels two and three, and n of a fall that goes as level^n.

    A force that goes as ``x^(n + 1)`` does so: n = 1 for Rayleigh's hysteresis, 2 for a cubic law.
    """
    second, third = (float(np.median(1 - other / frequencies[0])) for other in frequencies[1:])
    return second, third, float(brentq(lambda n: (3**n - 1) / (2**n - 1) - third / second, 0.05, 6))


def trial(folder: Path, level: int, delay: float) -> BandRecording:
    """First experiment of the train part, voltages delayed as the model's chain does (exact for periods)."""
    u, y = (np.load(folder / f"{kind}_{level}mV_train.npy")[:, :, 0, :] for kind in ("u", "y"))
    u, y = (np.concatenate([each[..., 0], each[..., 1]]) for each in (u, y))
    turn = np.exp(-2j * np.pi * np.fft.rfftfreq(len(u), 1 / RATE) * delay)[:, None]
    late = np.fft.irfft(np.fft.rfft(u, axis=0) * turn, n=len(u), axis=0)
    places = [f"MIRROR:+{axis}" for axis in "XYZ"]
    channels = (
        channels_of("voltage", places, ["ux", "uy", "uz"]),
        channels_of("displacement", places, ["yx", "yy", "yz"]),
    )
    return BandRecording(f"{level} mV", RATE, late, y, *channels)


def error(hypothesis: Hypothesis, lines: WindowedSpectrum) -> float:
    """Of all responses together, relative."""
    rest = lines.measured - predict_lines(hypothesis, lines).response
    return float(np.linalg.norm(rest) / np.linalg.norm(lines.measured))


def ask_library(folder: Path, fitted: ModalModel) -> None:
    """One refit for all levels; direction of a joint; laws screened along it, the best three simulated freely."""
    model = replace(fitted, delay=0.0, quantity="receptance", covariance=None)
    decay = float((-model.poles.real).min())
    lines = [windowed_spectrum(trial(folder, level, fitted.delay), MODEL_BAND, decay) for level in LEVELS]
    shape = ModelShape(model, LabError())
    nominal = Hypothesis(shape, np.zeros(shape.size))
    own = [fit([each], nominal, iterations=5).hypothesis for each in lines]
    print("refit for each level: " + ", ".join(f"{error(*pair):.3f}" for pair in zip(own, lines, strict=True)))
    second, third, exponent = growth([item.model.natural_frequencies for item in own])
    print(f"modes fall by {100 * second:.2f} % to 200 mV and {100 * third:.2f} % to 300 mV: level^{exponent:.2f}")
    base = fit(lines, nominal, iterations=5)
    for name, item in (("100 mV's model", nominal), ("one refit for all", base.hypothesis)):
        print(f"{name}: " + ", ".join(f"{error(item, each):.3f} at {each.recording.name}" for each in lines))
    print(f"without any law: {behaviour_of(base.hypothesis, lines).sentence}")
    floor = linear_floor(base, lines)
    seen = find_direction(floor, base.hypothesis)
    print(f"one direction {np.round(seen.axis.entries, 2)} holds {seen.share:.2f} of what any force would explain")
    laws = [physics for physics in library().values() if isinstance(physics, JointPhysics)]
    for screened in screen_joints(floor, base.hypothesis, seen.axis, laws)[:3]:
        start = replace(base.hypothesis, causes=(screened.causes[0],))
        near = fit(lines, start, base.noises, iterations=3)
        last = replace(near.hypothesis.causes[-1], seen=None)
        free = fit(lines, replace(near.hypothesis, causes=(last,)), near.noises, iterations=5)
        errors = ", ".join(f"{error(free.hypothesis, each):.3f}" for each in lines)
        print(f"{last.physics.name}: screened {screened.gain:.0f}, simulated {base.score - free.score:.0f}; {errors}")


def main(folder: Path, model: Path | None) -> None:
    result = {level: linear_frf(folder, level) for level in LEVELS}
    for level, (frf, noise, distortion) in result.items():
        print(f"{level} mV: noise {100 * noise:.4f} %, distortion {100 * distortion:.4f} % of the power; test ", end="")
        print(", ".join(f"{100 * left_over(folder, frf, other):.2f} % at {other} mV" for other in LEVELS))
    if model is not None:
        ask_library(folder, read_modal_model(model))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)
