"""Subspace and maximum-likelihood fit on stacked milling sweeps: accuracy, error bars, refusals."""

import numpy as np
import pytest

from acquisition import Channel
from estimation import BandRecording, Resampler, whole_ratio
from millfrf.core import InputError
from millfrf.cutting import MillingProcess
from modal_fit import SubspaceFit, fit_subspace
from replay_data import LinearSweep, MillingCell, default_structure, milling_sensors

RPM = 2 * np.pi / 60
IMMERSIONS = ((0.38, 0.61), (0.77, 1.0), (0.0, 0.23))  # central, down, up milling, in units of pi


def sweeps(noise: float, seed: int, duration: float = 60.0) -> list[BandRecording]:
    """Three simulated speed sweeps reduced to 0-40 Hz."""
    records = []
    for k, (start, stop) in enumerate(IMMERSIONS):
        process = MillingProcess(
            2, 0.0127, np.pi / 2, 119e6, 0.17, 0.33, start * np.pi, stop * np.pi, 0.1e-3, runout=5e-6
        )
        speed = LinearSweep(450 * RPM, 690 * RPM, duration)
        sensors = milling_sensors(noise, noise)
        cell = MillingCell(default_structure(), process, 2e-3, speed, duration, sensors=sensors, seed=10 * seed + k)
        resampler = Resampler(10240.0, whole_ratio(10240.0, 40.0))
        samples = resampler.add(cell.samples())
        channels = cell.streams[0].channels
        forces, motions = channels[:3], channels[3:]
        records.append(BandRecording(f"test {k + 1}", resampler.rate, samples[:, :3], samples[:, 3:], forces, motions))
    return records


@pytest.fixture(scope="module")
def fitted() -> SubspaceFit:
    return fit_subspace(sweeps(0.01, 1), (13.0, 25.0))


def test_the_close_pair_of_table_1(fitted: SubspaceFit) -> None:
    """16.99 Hz, 2.85 % and 18.48 Hz, 9.96 %: nobody picks poles."""
    truth = default_structure()
    assert len(fitted.model.poles) == 2
    np.testing.assert_allclose(fitted.model.natural_frequencies, truth.natural_frequencies[:2], rtol=5e-4)
    np.testing.assert_allclose(fitted.model.damping_ratios[0], truth.damping_ratios[0], rtol=0.005)
    np.testing.assert_allclose(fitted.model.damping_ratios[1], truth.damping_ratios[1], rtol=0.01)


def test_its_frf_and_its_error_bars(fitted: SubspaceFit) -> None:
    truth = default_structure()
    rows = [i for i, label in enumerate(truth.responses) if label.startswith("HOUSING")]
    f = np.linspace(15, 21, 61)
    expected = truth.receptance(f)[:, rows]
    error = np.abs(fitted.model.receptance(f) - expected).max(axis=0) / np.abs(expected).max(axis=0)
    assert error.max() < 0.02
    errors = fitted.model.standard_errors()
    assert errors is not None
    deviation = (fitted.model.damping_ratios - truth.damping_ratios[:2]) / errors[1]
    assert np.abs(deviation).max() < 4
    assert fitted.reduced_chi_square == pytest.approx(1.0, abs=0.1)


def record(rate: float, n: int, names: str = "xyz", quantity: str = "acceleration") -> BandRecording:
    rng = np.random.default_rng(n)
    forces = tuple(Channel(f"f{a}", "force", "N", "TCP", f"+{a.upper()}") for a in names)
    unit = {"acceleration": "m/s^2", "temperature": "K"}[quantity]
    motions = tuple(Channel(f"a{a}", quantity, unit, "TCP", f"+{a.upper()}") for a in names)
    shape = (n, len(names))
    return BandRecording("test", rate, rng.standard_normal(shape), rng.standard_normal(shape), forces, motions)


@pytest.mark.parametrize(
    ("records", "band", "message"),
    [
        ([], (10.0, 20.0), "no record"),
        ([record(100.0, 4000), record(120.0, 4000)], (10.0, 20.0), "120 Hz after decimation, test 1 has 100 Hz"),
        ([record(100.0, 4000), record(100.0, 4000, "xy")], (10.0, 20.0), "other channels"),
        ([record(100.0, 4000)], (10.0, 60.0), "flat only to 40 Hz"),
        ([record(100.0, 400)], (10.0, 20.0), "too few"),
        ([record(100.0, 4000)], (20.0, 10.0), "empty"),
    ],
)
def test_records_that_cannot_be_used_are_refused(
    records: list[BandRecording], band: tuple[float, float], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        fit_subspace(records, band)
