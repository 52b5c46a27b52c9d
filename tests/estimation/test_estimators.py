"""H2, Hv, instruments, coherences and local polynomials against systems whose FRF is known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from acquisition import Channel
from estimation import (
    BandRecording,
    CrossSpectra,
    Frf,
    SpectralAccumulator,
    SpectralSettings,
    h1,
    h2,
    hv,
    input_independence,
    instrumental_variable,
    local_polynomial,
)
from estimation.spectra.coherence_functions import independent_lines
from millfrf.core import InputError
from modal_fit import ModalModel

RATE, LENGTH = 200.0, 256
FORCES = tuple(Channel(f"f{a}", "force", "N", "TCP", f"+{a.upper()}") for a in "xy")
MOTIONS = tuple(Channel(f"u{a}", "displacement", "m", "TCP", f"+{a.upper()}") for a in "xy")
B, A = signal.butter(2, 0.3)


def filtered(force: np.ndarray) -> np.ndarray:
    """Two responses of two forces through known filters."""
    low = signal.lfilter(B, A, force, axis=0)
    return np.column_stack([low[:, 0] + 0.5 * force[:, 1], 0.3 * force[:, 0] - low[:, 1]])


def truth(frequencies: np.ndarray) -> np.ndarray:
    low = signal.freqz(B, A, frequencies, fs=RATE)[1]
    unity = np.ones_like(low)
    return np.moveaxis(np.array([[low, 0.5 * unity], [0.3 * unity, -low]]), 2, 0)


def spectra(
    force: np.ndarray, motion: np.ndarray, forces: tuple[Channel, ...] = FORCES, motions: tuple[Channel, ...] = MOTIONS
) -> CrossSpectra:
    accumulator = SpectralAccumulator(forces, motions, RATE, SpectralSettings(LENGTH, 0.5, "hann"))
    accumulator.add(force, motion)
    return accumulator.result()


def gain(frf: Frf) -> float:
    """Mean ratio of the first entry to the truth over the passband."""
    inside = (frf.frequencies > 2) & (frf.frequencies < 25)
    return float(np.mean(np.real(frf.values[inside, 0, 0] / truth(frf.frequencies)[inside, 0, 0])))


@pytest.fixture(scope="module")
def samples() -> tuple[np.ndarray, np.ndarray, np.random.Generator]:
    rng = np.random.default_rng(5)
    force = rng.standard_normal((400_000, 2))
    return force, filtered(force), rng


def test_noise_on_the_force_biases_h1_down_and_leaves_h2(samples: tuple) -> None:
    force, motion, rng = samples
    noisy = spectra(force + 0.5 * rng.standard_normal(force.shape), motion)
    assert gain(h1(noisy)) == pytest.approx(1 / 1.25, abs=0.01)
    assert gain(h2(noisy)) == pytest.approx(1.0, abs=0.01)


def test_noise_on_both_in_known_ratio_leaves_hv_unbiased(samples: tuple) -> None:
    force, motion, rng = samples
    noisy = spectra(force + 0.4 * rng.standard_normal(force.shape), motion + 0.3 * rng.standard_normal(motion.shape))
    result = hv(noisy, np.full(2, 0.09), np.full(2, 0.16))
    assert gain(result) == pytest.approx(1.0, abs=0.01)
    assert gain(h1(noisy)) < 0.9
    # without noise on one side, Hv is H1 or H2
    np.testing.assert_allclose(hv(noisy, np.full(2, 1.0), np.full(2, 1e-9)).values, h1(noisy).values, atol=1e-6)


def test_estimators_agree_without_noise(samples: tuple) -> None:
    clean = spectra(samples[0], samples[1])
    for estimate in (h2(clean), hv(clean)):
        np.testing.assert_allclose(estimate.values[3:-3], h1(clean).values[3:-3], atol=2e-3)


def test_feedback_biases_h1_and_an_instrument_does_not() -> None:
    """f = r + K x + nothing else, x = G f + d: the disturbance d reaches the force through the feedback."""
    rng = np.random.default_rng(8)
    n = 400_000
    reference, disturbance = rng.standard_normal((2, n))
    b, a = np.array([0.0, 0.2]), np.array([1.0, -0.8])  # G, one sample late
    feedback = -0.8
    # closed loop: x = (G r + d) / (1 - K G)
    closed_b, closed_a = b, a - feedback * np.array([0.0, 0.2])
    x = signal.lfilter(closed_b, closed_a, reference) + signal.lfilter(a, closed_a, disturbance)
    f = reference + feedback * x
    forces = (FORCES[0], Channel("r", "force", "N", "REF", "+X"))
    both = spectra(np.column_stack([f, reference]), x[:, None], forces, MOTIONS[:1])
    expected = signal.freqz(b, a, both.frequencies, fs=RATE)[1]
    inside = (both.frequencies > 5) & (both.frequencies < 80)
    alone = spectra(f[:, None], x[:, None], FORCES[:1], MOTIONS[:1])
    biased = np.abs(h1(alone).values[inside, 0, 0] - expected[inside]) / np.abs(expected[inside])
    result = instrumental_variable(both, ["r"])
    assert np.median(biased) > 0.3
    assert abs(np.mean(result.values[inside, 0, 0] / expected[inside]) - 1) < 0.03
    assert result.covariance is not None
    normalised = (
        np.abs(result.values[inside, 0, 0] - expected[inside]) ** 2 / result.covariance.variance()[inside, 0, 0]
    )
    assert 0.6 < np.mean(normalised) < 1.5


def test_unusable_requests_are_refused(samples: tuple) -> None:
    force, motion, _ = samples
    with pytest.raises(InputError, match="H2 needs"):
        h2(spectra(force[:5000], motion[:5000, :1], FORCES, MOTIONS[:1]))
    clean = spectra(force[:5000], motion[:5000])
    with pytest.raises(InputError, match="noise powers"):
        hv(clean, np.array([1.0, -1.0]))
    with pytest.raises(InputError, match="'fz'"):
        instrumental_variable(clean, ["fz"])
    with pytest.raises(InputError, match="instruments for"):
        instrumental_variable(clean, [])


def modes() -> ModalModel:
    """A close, heavily damped pair."""
    omega = 2 * np.pi * np.array([17.0, 18.5])
    zeta = np.array([0.03, 0.1])
    return ModalModel(
        poles=omega * (-zeta + 1j * np.sqrt(1 - zeta**2)),
        right=np.array([[1.0, 0.3], [-0.4, 1.0]]) + 0j,
        left=np.array([[1.0, -0.2], [0.5, 1.0]]) * -1j,
        responses=("TCP:+X", "TCP:+Y"),
        excitations=("TCP:+X", "TCP:+Y"),
    )


def short_records(seed: int, noise: float, seconds: float = 8.0) -> list[BandRecording]:
    """Random forces through the modes, started long before the record: full leakage."""
    rng = np.random.default_rng(seed)
    rate, before = 100.0, 1000
    n = int(seconds * rate)
    lines = np.fft.rfftfreq(2 * (n + before), 1 / rate)
    response = modes().receptance(lines)
    records = []
    for _ in range(2):
        force = rng.standard_normal((2 * (n + before), 2))
        x = np.fft.irfft(np.einsum("kpq,kq->kp", response, np.fft.rfft(force, axis=0)), len(force), axis=0)
        x = x + noise * x.std(axis=0) * rng.standard_normal(x.shape)
        part = slice(before, before + n)
        records.append(BandRecording("test", rate, force[part], x[part], FORCES, MOTIONS))
    return records


def root_mean_square(frf: Frf, band: tuple[float, float]) -> float:
    inside = (frf.frequencies >= band[0]) & (frf.frequencies <= band[1]) & frf.valid
    error = frf.values[inside] - modes().receptance(frf.frequencies[inside])
    return float(np.sqrt(np.mean(np.abs(error) ** 2)))


def test_local_polynomial_beats_welch_of_any_segment_on_short_records() -> None:
    """16 s, no noise: what is left is leakage and curvature."""
    band, local, welch = (14.0, 23.0), [], []
    for seed in range(4):
        records = short_records(seed, 0.0, 16.0)
        local.append(root_mean_square(local_polynomial(records, band), band))
        row = []
        for length in (200, 400, 800):
            accumulated = SpectralAccumulator(FORCES, MOTIONS, 100.0, SpectralSettings(length, 0.5, "hann"))
            for record in records:
                accumulated.add(record.force, record.response)
            row.append(root_mean_square(h1(accumulated.result()), band))
        welch.append(row)
    assert np.mean(local) < 0.2 * np.mean(welch, axis=0).min()


def test_local_polynomial_error_bars() -> None:
    ratios = []
    for seed in range(30):
        result = local_polynomial(short_records(seed, 0.05), (15.0, 22.0))
        assert result.covariance is not None
        error = np.abs(result.values - modes().receptance(result.frequencies)) ** 2
        ratios.append(np.mean(error / result.covariance.variance(), axis=0))
    np.testing.assert_allclose(np.mean(ratios, axis=0), 1.1, atol=0.4)


def test_local_polynomial_of_dependent_forces_gives_no_frf() -> None:
    records = [replace(record, force=np.repeat(record.force[:, :1], 2, axis=1)) for record in short_records(0, 0.0)]
    assert not local_polynomial(records, (15.0, 22.0)).valid.any()
    with pytest.raises(InputError, match="equations"):
        local_polynomial(short_records(0, 0.0), (15.0, 22.0), half_width=1)


def test_quick_and_full_check_of_independence_agree() -> None:
    rng = np.random.default_rng(3)
    for share in (1.0, 0.1, 0.03, 0.012, 0.008, 0.001, 0.0):
        force = rng.standard_normal((40_000, 2)) @ np.array([[1.0, 1.0], [0.0, share]])
        s = spectra(force, filtered(force))
        np.testing.assert_array_equal(independent_lines(s), input_independence(s).independent)
