"""Natural frequencies that move between or within recordings are found, constant ones are not, whatever the noise."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import scipy

from acquisition import Channel
from estimation import BandRecording
from millfrf.core import Real
from modal_fit import moving_modes

RATE, FINE, DURATION = 100.0, 20, 40.0  # Hz; steps per sample; s
FREQUENCIES, DAMPING = np.array([11.0, 14.0]), np.array([0.05, 0.04])
SHAPES = np.array([[1.0, 0.6], [-0.5, 1.2]])  # (n_modes, n_channels)
BAND = (6.0, 22.0)
CHANNELS = [
    tuple(Channel(f"{kind}{axis}", quantity, unit, "TCP", f"+{axis.upper()}") for axis in "xy")
    for kind, quantity, unit in (("f", "force", "N"), ("d", "displacement", "m"))
]


def recordings(
    seeds: Sequence[int], change: float = 0.0, shifts: Real | float = 0.0, *, sweep: bool = False
) -> list[BandRecording]:
    """Simulate modes whose frequencies lie ``shifts`` off and change by ``change`` until the end, both relative."""
    rng, n, count = np.random.default_rng(seeds), int(RATE * DURATION), len(seeds)
    forces = [swept(rng, n) if sweep else noise_below(rng, (n, 2), 40.0) for _ in seeds]
    pushes = np.array([scipy.signal.resample(force, n * FINE, axis=0) @ SHAPES.T for force in forces])
    omega = 2 * np.pi * FREQUENCIES * (1 + np.broadcast_to(shifts, count)[:, None])
    step, place, velocity = 1 / (RATE * FINE), np.zeros((count, 2)), np.zeros((count, 2))
    moved = np.empty((count, n, 2))
    for k in range(n * FINE):
        if k % FINE == 0:
            moved[:, k // FINE] = place @ SHAPES
        now = omega * (1 + change * (k / (n * FINE) - 0.5))
        # a symplectic step: the error of the frequency is of second order in the step
        velocity = velocity + step * (pushes[:, k] - now**2 * place - 2 * DAMPING * now * velocity)
        place = place + step * velocity
    noise = np.cumsum(rng.standard_normal(moved.shape), axis=1)
    noise -= scipy.ndimage.uniform_filter1d(noise, 20, axis=1)
    moved += 0.02 * noise * moved.std(axis=1, keepdims=True) / noise.std(axis=1, keepdims=True)
    return [
        BandRecording(f"test_{seed}", RATE, force, motion, *CHANNELS)
        for seed, force, motion in zip(seeds, forces, moved, strict=True)
    ]


def noise_below(rng: np.random.Generator, shape: tuple[int, int], highest: float) -> Real:
    """Return noise of unit size without power above a frequency (Hz)."""
    spectra = np.fft.rfft(rng.standard_normal(shape), axis=0)
    spectra[np.fft.rfftfreq(shape[0], 1 / RATE) > highest] = 0.0
    values = np.fft.irfft(spectra, shape[0], axis=0)
    return np.asarray(values / values.std())


def swept(rng: np.random.Generator, n: int) -> Real:
    """Return forces that sweep over the band, with another ratio of their sizes in each recording."""
    t = np.arange(n) / RATE
    sweep = scipy.signal.chirp(t, BAND[0] - 1, t[-1], BAND[1] + 1)
    return np.outer(sweep, rng.standard_normal(2)) + 0.01 * noise_below(rng, (n, 2), 40.0)


@pytest.mark.parametrize("sweep", [False, True])
def test_constant_modes_give_p_values_that_are_uniform(sweep: bool) -> None:
    records, p_values = recordings(range(45), sweep=sweep), []
    for first in range(0, len(records), 3):
        motion = moving_modes(records[first : first + 3], BAND)
        assert motion is not None
        p_values += motion.p_value.tolist()
    assert scipy.stats.kstest(p_values, "uniform").pvalue > 0.01
    assert min(p_values) > 1e-3


@pytest.mark.parametrize("sweep", [False, True])
def test_a_drift_within_each_recording_is_measured(sweep: bool) -> None:
    motion = moving_modes(recordings(range(3), change=-0.02, sweep=sweep), BAND)
    assert motion is not None
    assert motion.p_value.min() < 1e-5
    clearest = int(motion.p_value.argmin())
    assert np.abs((motion.change + 0.02) / motion.change_error)[:, clearest].max() < 4


def test_a_shift_between_recordings_is_measured() -> None:
    motion = moving_modes(recordings(range(3), shifts=0.005 * np.arange(-1, 2)), BAND)
    assert motion is not None
    clearest = int(motion.p_value.argmin())
    assert motion.p_value[clearest] < 1e-4
    np.testing.assert_allclose(motion.shift[2, clearest] - motion.shift[0, clearest], 0.01, rtol=0.2)
    assert "off its mean in " in motion.warning(["a", "b", "c"])


def test_one_recording_shows_its_own_drift_only() -> None:
    steady, drifting = (moving_modes(recordings([3], change=change), BAND) for change in (0.0, 0.04))
    assert steady is not None
    assert drifting is not None
    assert not steady.warning(["a"])
    assert drifting.warning(["a"]).startswith("natural frequencies move (near 1")
    assert "within a" in drifting.warning(["a"])


def test_a_structure_without_a_stable_pole_is_not_tested() -> None:
    rng = np.random.default_rng(1)
    force, noise = noise_below(rng, (4000, 2), 40.0), rng.standard_normal((4000, 2))
    assert moving_modes([BandRecording("noise", RATE, force, noise, *CHANNELS)], (19.0, 20.0)) is None


def test_channels_that_depend_on_each_other_stop_nothing() -> None:
    """Two equal responses, and a silent force."""
    (record,) = recordings([3])
    for alike in (
        replace(record, response=record.response[:, [0, 0]]),
        replace(record, force=record.force * [1.0, 0.0]),
        replace(record, force=record.force[:, [0, 0]]),
    ):
        motion = moving_modes([alike], BAND)
        assert motion is None or not motion.warning(["a"])
