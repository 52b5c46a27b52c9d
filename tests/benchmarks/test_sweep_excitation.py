"""Sweep milling force excitation as written here: exact without noise, with the condition of its force spectra."""

import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # benchmarks are no installed package

from benchmarks.sweep_excitation import CUTTER, DEPTH, SPEEDS, Tests, layout, machine, sweep_receptance
from estimation import SweepDemand, plan_sweeps
from millfrf.cutting import MillingProcess, force_harmonics

RATE, SECONDS, TONES = 400.0, 16.0, np.arange(20.0, 50.0, 0.25)  # the tones lie on lines of segments of 4 s


def _steady(shares: NDArray[np.complex128], seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Forces with fixed shares of X, Y and Z on every tone, and the exact steady accelerations of the machine."""
    generator = np.random.default_rng(seed)
    amplitudes = np.exp(2j * np.pi * generator.uniform(size=len(TONES)))[:, None] * shares
    motion = np.einsum("kpq,kq->kp", machine().receptance(TONES), amplitudes) * -((2 * np.pi * TONES[:, None]) ** 2)
    waves = np.exp(2j * np.pi * np.outer(np.arange(round(SECONDS * RATE)) / RATE, TONES))
    return np.real(waves @ amplitudes), np.real(waves @ motion)


def _set(seed: int) -> Tests:
    """Forces of the published up, central and down cut on the first harmonic of the tooth passing."""
    return [_steady(force_harmonics(process, 1)[1] * DEPTH, seed + k) for k, process in enumerate(layout(0.012))]


def test_a_known_frf_comes_back_without_noise() -> None:
    receptance = sweep_receptance([_set(1), _set(10)], RATE)
    lines = np.isin(np.round(receptance.frequencies, 6), TONES)
    truth = machine().receptance(receptance.frequencies[lines])
    # neighbouring tones leak into each other through the Hann window: inside the sweep the FRF changes little there
    error = np.linalg.norm(receptance.mean[lines] - truth, axis=(1, 2)) / np.linalg.norm(truth, axis=(1, 2))
    assert np.median(error) < 0.01
    assert (receptance.smallest <= receptance.largest).all()


def test_one_tone_comes_back_exactly_with_the_published_condition_and_rank() -> None:
    shares = [force_harmonics(process, 1)[1] * DEPTH for process in layout(0.012)]
    time, line = np.arange(round(SECONDS * RATE)) / RATE, 30.0
    response = machine().receptance(np.array([line]))[0] * -((2 * np.pi * line) ** 2)
    wave = np.exp(2j * np.pi * line * time)[:, None]
    tests = [(np.real(wave * share), np.real(wave * (response @ share))) for share in shares]
    receptance = sweep_receptance([tests], RATE)
    at = int(np.argmin(np.abs(receptance.frequencies - line)))
    np.testing.assert_allclose(receptance.mean[at], machine().receptance(np.array([line]))[0], rtol=1e-6)
    columns = np.stack(
        [share * share[0].conj() for share in shares], axis=-1
    )  # S_{f, fx} of each sweep, up to a factor
    assert receptance.condition[at] == pytest.approx(np.linalg.cond(columns), rel=1e-6)
    assert receptance.rank[at] == 3


def test_three_equal_sweeps_have_rank_one() -> None:
    tests = [_steady(force_harmonics(layout(0.012)[0], 1)[1] * DEPTH, seed) for seed in range(3)]
    noisy = [(force + 1e-9 * np.random.default_rng(9).standard_normal(force.shape), motion) for force, motion in tests]
    receptance = sweep_receptance([noisy], RATE)
    lines = np.isin(np.round(receptance.frequencies, 6), TONES)
    assert np.median(receptance.condition[lines]) > 1e6


def test_plan_is_better_conditioned_than_the_published_layouts_in_the_measure_of_their_method() -> None:
    band = (SPEEDS[0] * CUTTER.teeth / (2 * np.pi), SPEEDS[1] * CUTTER.teeth / (2 * np.pi))
    plan = plan_sweeps(CUTTER, SweepDemand(band, DEPTH, 0.25, 1e-9, 1e-9))

    def condition(processes: list[MillingProcess]) -> float:
        shares = [force_harmonics(process, 1)[1] for process in processes]
        return float(np.linalg.cond(np.stack([share * share[0].conj() for share in shares], axis=-1)))

    for radial_depth in (0.012, 0.024, 0.04, 0.072):
        assert condition(list(plan.processes)) < condition(layout(radial_depth))
