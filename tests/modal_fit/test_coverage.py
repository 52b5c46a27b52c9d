"""Do the error bars hold? 95 % intervals of poles and residues over many noises, by Monte Carlo (slow)."""

from dataclasses import replace

import numpy as np
import pytest

from estimation import BandRecording, Frf, FrfCovariance, Resampler, whole_ratio
from millfrf.cutting import MillingProcess
from modal_fit import ModalModel, derived_covariance, fit_polyreference, fit_subspace
from replay_data import LinearSweep, MillingCell, default_structure, milling_sensors, tip_model

RPM = 2 * np.pi / 60
IMMERSIONS = ((0.38, 0.61), (0.77, 1.0), (0.0, 0.23))
pytestmark = pytest.mark.slow


def quantities(model: ModalModel) -> np.ndarray:
    """Natural frequencies, damping ratios and residues (real and imaginary parts) of the first two modes."""
    residues = np.einsum("rp,rq->rpq", model.right[:2], model.left[:2]).ravel()
    return np.concatenate([model.natural_frequencies[:2], model.damping_ratios[:2], residues.real, residues.imag])


def inside(model: ModalModel, truth: np.ndarray) -> np.ndarray:
    """Whether each 95 % interval holds the truth."""
    covariance = derived_covariance(model, quantities)
    assert covariance is not None
    return np.asarray(np.abs(quantities(model) - truth) < 1.96 * np.sqrt(np.diag(covariance)))


def check(held: list[np.ndarray]) -> None:
    """Poles (four numbers) and residues (the rest), each pooled over the runs."""
    table = np.array(held)
    assert 0.92 <= table[:, :4].mean() <= 0.98, f"poles: {table[:, :4].mean(axis=0)}"
    assert 0.92 <= table[:, 4:].mean() <= 0.98, f"residues: {table[:, 4:].mean()}"


def test_intervals_of_the_polyreference_fit() -> None:
    truth = tip_model(default_structure())
    axis = np.arange(8.0, 35.0, 0.0625)
    clean = truth.frf(axis)
    level = 0.01 * np.sqrt(np.mean(np.abs(clean.values) ** 2, axis=(0, 2)))
    covariance = FrfCovariance(
        np.broadcast_to(np.diag(level**2).astype(complex), (len(axis), 3, 3)),
        np.broadcast_to(np.eye(3, dtype=complex), (len(axis), 3, 3)),
    )
    held = []
    for seed in range(150):
        noise = np.random.default_rng(seed).standard_normal((2, *clean.values.shape)) * level[:, None] / np.sqrt(2)
        noisy: Frf = replace(clean, values=clean.values + noise[0] + 1j * noise[1], covariance=covariance)
        held.append(inside(fit_polyreference(noisy, (10.0, 30.0)).model, quantities(truth)))
    check(held)


def clean_sweeps() -> list[BandRecording]:
    """Three noise-free simulated sweeps reduced to 0-40 Hz."""
    records = []
    for k, (start, stop) in enumerate(IMMERSIONS):
        process = MillingProcess(
            2, 0.0127, np.pi / 2, 119e6, 0.17, 0.33, start * np.pi, stop * np.pi, 0.1e-3, runout=5e-6
        )
        sensors = milling_sensors(0.0, 0.0)
        speed = LinearSweep(450 * RPM, 690 * RPM, 60.0)
        cell = MillingCell(default_structure(), process, 2e-3, speed, 60.0, sensors=sensors, seed=k)
        resampler = Resampler(10240.0, whole_ratio(10240.0, 40.0))
        samples = resampler.add(cell.samples())
        channels = cell.streams[0].channels
        records.append(
            BandRecording(f"test {k + 1}", resampler.rate, samples[:, :3], samples[:, 3:], channels[:3], channels[3:])
        )
    return records


def with_noise(record: BandRecording, share: float, rng: np.random.Generator) -> BandRecording:
    """White noise on every channel, a share of its standard deviation in the band."""

    def add(samples: np.ndarray) -> np.ndarray:
        return np.asarray(samples + share * samples.std(axis=0) * rng.standard_normal(samples.shape))

    return replace(
        record,
        force=add(record.force),
        response=add(record.response),
    )


def test_intervals_of_the_subspace_fit() -> None:
    structure = default_structure()
    rows = [i for i, label in enumerate(structure.responses) if label.startswith("HOUSING")]
    truth = quantities(
        replace(structure, right=structure.right[:, rows], responses=tuple(structure.responses[i] for i in rows))
    )
    records = clean_sweeps()
    held = []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        noisy = [with_noise(record, 0.03, rng) for record in records]
        held.append(inside(fit_subspace(noisy, (13.0, 25.0)).model, truth))
    check(held)
