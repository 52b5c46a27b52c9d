"""Sweep milling force excitation beside this project: `python -m benchmarks.sweep_excitation [--seconds 67]`.

Franco, Beudaert, Iglesias, Dombovari, Erkorkmaz and Munoa measure receptances by sweeps of the spindle speed in an up,
a central and a down cut of one radial depth, each milled twice (code and settings: github.com/OierFranco/SMFE,
.../Initial-Value-Time-Domain-Milling-Model; :func:`sweep_receptance` is written anew from its equations). Their machine
and their cutter are simulated here: 67 s at 10 kHz, 600 to 1560 rpm, noise of 1 % on every channel. The same recordings
go through both methods, for their layout and for the immersions that ``millfrf plan`` proposes.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse
import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy.signal
from numpy.typing import NDArray

from acquisition import Recording, record
from estimation import (
    Frf,
    SweepDemand,
    band_of_channels,
    choose_channels,
    cross_spectra,
    h1,
    plan_sweeps,
    settings_for,
    sum_tests,
    to_receptance,
)
from millfrf.core import TIP
from millfrf.cutting import MillingProcess, immersion_angles
from modal_fit import ModalModel, fit_subspace
from replay_data import LinearSweep, MillingCell, dynamometer, tip_accelerometers

RPM = math.pi / 30
RATE, DEPTH, SPEEDS = 10_000.0, 2e-3, (600 * RPM, 1560 * RPM)
RESOLUTION, OVERLAP = 0.25, 0.8  # Hz; share of a segment
FITTED = (22.0, 75.0)  # Hz, band of the fit, with the three modes
BAND = (22.0, 50.0)  # Hz; tooth passing sweeps 20 to 52 Hz, a segment's width is left out at both ends
RADIAL_DEPTHS = (0.012, 0.072)
CUTTER = MillingProcess(
    2, 0.08, math.pi / 4, 1889.2e6, 806.1 / 1889.2, 291.0 / 1889.2, 0.0, math.pi, 1e-4, kte=63.12e3, kre=113.7e3
)
Tests = Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]]  # forces and accelerations, (n_samples, 3) each


def machine() -> ModalModel:
    """Return the three modes of the published machine at the tip; the third moves along X, the first in Y and Z."""
    natural, zeta = 2 * math.pi * np.array([33.37, 57.44, 58.61]), np.array([0.061, 0.0822, 0.0287])
    masses = np.array([45.5e6, 32.1e6, 36.7e6]) / natural**2
    shapes = np.array([[-0.055, 0.6245, 0.7724], [0.0199, 0.9968, -0.0161], [0.999, 4.0028e-4, 0.0096]])
    shapes /= np.sqrt(masses)[:, None]
    damped = natural * np.sqrt(1 - zeta**2)
    return ModalModel(-zeta * natural + 1j * damped, shapes / (2j * damped[:, None]), shapes.astype(complex), TIP, TIP)


def layout(radial_depth: float) -> list[MillingProcess]:
    """Return the up, central and down cut of one radial depth (m)."""
    angles = (immersion_angles(kind, radial_depth, CUTTER.diameter) for kind in ("up", "central", "down"))
    return [replace(CUTTER, start_angle=start, exit_angle=stop) for start, stop in angles]


@dataclass(frozen=True)
class SweptReceptance:
    """Receptance of repeated sets of three sweeps."""

    frequencies: NDArray[np.float64]  # (n_lines,), Hz
    mean: NDArray[np.complex128]  # (n_lines, 3, 3), m/N, responses by forces, mean of the sets
    smallest: NDArray[np.float64]  # (n_lines, 3, 3), m/N, smallest magnitude of the sets
    largest: NDArray[np.float64]  # (n_lines, 3, 3), m/N, largest magnitude of the sets
    condition: NDArray[np.float64]  # (n_lines,), of the matrix of force spectra, mean of the sets
    rank: NDArray[np.int64]  # (n_lines,), of this matrix, smallest of the sets


def sweep_receptance(
    sets: Sequence[Tests], sample_rate: float, resolution: float = RESOLUTION, overlap: float = OVERLAP
) -> SweptReceptance:
    """Estimate receptances by the method of the authors.

    In the sweep i the force X is the reference: with ``g_i = S_{f, fx}`` (three forces) and ``b_i = S_{a, fx}`` (three
    accelerations), ``b_i = A g_i``. The three sweeps of a set give ``A = [b_1 b_2 b_3] [g_1 g_2 g_3]^-1`` on each line,
    and ``H = A / (i w)^2``. Sets are averaged; their largest and smallest magnitudes are the band.

    Parameters
    ----------
    sets
        Sets of three sweeps, each a pair of forces (N) and accelerations (m/s^2) of shape (n_samples, 3).
    sample_rate, resolution : Hz
        Segments have the length ``sample_rate / resolution`` and a Hann window.
    overlap
        Overlap of segments, as a share of their length.
    """
    result, conditions, ranks = [], [], []
    for tests in sets:
        columns = [_referred_to_x(test, sample_rate, resolution, overlap) for test in tests]
        frequencies = columns[0][0]
        forces = np.stack([column[1] for column in columns], axis=-1)
        accelerations = np.stack([column[2] for column in columns], axis=-1)
        transposed = np.linalg.solve(np.moveaxis(forces, 1, 2), np.moveaxis(accelerations, 1, 2))
        result.append(np.moveaxis(transposed, 1, 2) / (2j * math.pi * frequencies[:, None, None]) ** 2)
        conditions.append(np.linalg.cond(forces))
        ranks.append(np.linalg.matrix_rank(forces))
    size = np.abs(result)
    return SweptReceptance(
        frequencies,
        np.mean(result, axis=0),
        size.min(axis=0),
        size.max(axis=0),
        np.mean(conditions, axis=0),
        np.min(ranks, axis=0),
    )


def _referred_to_x(
    test: tuple[NDArray[np.float64], NDArray[np.float64]], sample_rate: float, resolution: float, overlap: float
) -> tuple[NDArray[np.float64], NDArray[np.complex128], NDArray[np.complex128]]:
    """Return the lines above 0 Hz, and the cross spectra of three forces and three accelerations with the force X."""
    force, acceleration = test
    length = round(sample_rate / resolution)
    segments = {"fs": sample_rate, "window": "hann", "nperseg": length, "noverlap": round(overlap * length)}
    # scipy conjugates its first argument: csd(fx, y) is the mean of conj(fx) y
    frequencies, spectra = scipy.signal.csd(
        force[:, :1], np.hstack([force, acceleration]), axis=0, detrend=False, **segments
    )
    return frequencies[1:], spectra[1:, :3], spectra[1:, 3:]


@dataclass(frozen=True)
class Row:
    """Results of one layout."""

    immersions: str
    spectra_condition: float  # of the summed force spectra, largest over smallest singular value, median over the band
    their_condition: float  # of the matrix of their method, median over the band
    their_error: tuple[float, float]  # relative error of the FRF matrix, median and largest over the band
    our_error: tuple[float, float]  # of H1
    fit_error: tuple[float, float]  # of the fit of the recordings
    their_cover: float  # share of entries with the true magnitude between smallest and largest of two sets
    our_cover: float  # share of entries with the true value in the 95 % interval


def compare(processes: Sequence[MillingProcess], seconds: float, seed: int, sets: int = 2) -> Row:
    """Mill the sweeps, estimate by both methods, and compare with the true FRF."""
    swept: list[list[tuple[NDArray[np.float64], NDArray[np.float64]]]] = []
    spectra, records = [], []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(sets):
            swept.append([])
            for place, process in enumerate(processes):
                path = Path(folder) / f"{number}-{place}.h5"
                record(_cell(process, seconds, 100 * seed + 10 * number + place), path)
                with Recording(path) as recording:
                    stream = recording.stream()
                    settings = settings_for(RATE, 1 / RESOLUTION, overlap=OVERLAP, window="hann")
                    spectra.append(cross_spectra(recording, settings))
                    records.append(band_of_channels(stream, *choose_channels(stream), FITTED[1]))
                    samples = stream.read()
                swept[-1].append((samples[:, :3], samples[:, 3:]))
                path.unlink()
    total = sum_tests(spectra)
    fitted = fit_subspace(records, FITTED).model
    return _row(processes, sweep_receptance(swept, RATE), to_receptance(h1(total)), fitted, total.input_spectra)


def _cell(process: MillingProcess, seconds: float, seed: int) -> MillingCell:
    sensors = dynamometer(full_scale=5000.0) + tip_accelerometers(high_pass_hz=None)
    sweep = LinearSweep(*SPEEDS, seconds)
    return MillingCell(machine(), process, DEPTH, sweep, seconds, sample_rate=RATE, sensors=sensors, seed=seed)


def _row(
    processes: Sequence[MillingProcess],
    theirs: SweptReceptance,
    ours: Frf,
    fitted: ModalModel,
    forces: NDArray[np.complex128],
) -> Row:
    inside = (theirs.frequencies >= BAND[0]) & (theirs.frequencies <= BAND[1])
    lines = np.searchsorted(ours.frequencies, theirs.frequencies[inside])
    truth = machine().receptance(theirs.frequencies[inside])
    values = np.linalg.svd(forces[lines], compute_uv=False)
    size = np.abs(truth)
    assert ours.covariance is not None
    # a circle of 95 % around a complex estimate: |error|^2 over its mean is exponentially distributed
    radius = np.sqrt(-math.log(0.05) * ours.covariance.variance()[lines])
    return Row(
        ", ".join(f"{math.degrees(p.start_angle):.0f}-{math.degrees(p.exit_angle):.0f}" for p in processes),
        float(np.median(values[:, 0] / values[:, -1])),
        float(np.median(theirs.condition[inside])),
        _error(theirs.mean[inside], truth),
        _error(ours.values[lines], truth),
        _error(fitted.receptance(theirs.frequencies[inside]), truth),
        float(np.mean((theirs.smallest[inside] <= size) & (size <= theirs.largest[inside]))),
        float(np.mean(np.abs(ours.values[lines] - truth) <= radius)),
    )


def _error(found: NDArray[np.complex128], truth: NDArray[np.complex128]) -> tuple[float, float]:
    """Return median and largest of the error's Frobenius norm over that of the true matrix."""
    error = np.linalg.norm(found - truth, axis=(1, 2)) / np.linalg.norm(truth, axis=(1, 2))
    return float(np.median(error)), float(error.max())


def main() -> None:
    """Print a row for each layout."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=67.0)
    options = parser.parse_args()
    band = (SPEEDS[0] * CUTTER.teeth / (2 * math.pi), SPEEDS[1] * CUTTER.teeth / (2 * math.pi))
    plan = plan_sweeps(CUTTER, SweepDemand(band, DEPTH, RESOLUTION, 1e-9, 1e-9))
    layouts = {f"theirs, {1e3 * depth:.0f} mm": layout(depth) for depth in RADIAL_DEPTHS} | {"plan": plan.processes}
    print(f"{BAND[0]:g} to {BAND[1]:g} Hz; errors of the FRF matrix in %, median (largest)")
    heads = ("S_ff", "of theirs", "their method", "our H1", "our fit", "in bands, %")
    print(f"{'layout':13s} {'immersions':25s} " + " ".join(f"{head:>12s}" for head in heads))
    for number, (name, processes) in enumerate(layouts.items()):
        row = compare(processes, options.seconds, number)
        errors = (f"{100 * e[0]:.2g} ({100 * e[1]:.2g})" for e in (row.their_error, row.our_error, row.fit_error))
        cells = (f"{row.spectra_condition:.3g}", f"{row.their_condition:.3g}", *errors)
        cover = f"{100 * row.their_cover:.0f}, {100 * row.our_cover:.0f}"
        print(f"{name:13s} {row.immersions:25s} " + " ".join(f"{cell:>12s}" for cell in (*cells, cover)), flush=True)


if __name__ == "__main__":
    main()
