"""Coherence, averages and the exponential window travel with an FRF; stated variances agree with the scatter seen."""

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from acquisition import Channel
from estimation import Frf, FrfCovariance, read_frf, to_receptance, write_frf
from estimation.frf.quantities import frf_quantity
from millfrf.core import InputError

AXIS = np.arange(0.0, 50.0)
ONES = np.ones((3, 1, 1), complex)


def frf_of(values: np.ndarray, **more: object) -> Frf:
    """An accelerance with two responses and one excitation."""
    ones = np.ones(len(values), dtype=bool)
    axis = np.arange(len(values), dtype=float)
    return Frf(axis, values, ("A:+X", "B:+X"), ("A:+X",), "accelerance", "m/s^2/N", ones, **more)  # type: ignore[arg-type]


def test_what_is_known_of_entries_is_stored_and_read(tmp_path: Path) -> None:
    generator = np.random.default_rng(1)
    values = generator.normal(size=(50, 2, 1)) + 1j * generator.normal(size=(50, 2, 1))
    coherence = generator.uniform(0, 1, (50, 2, 1))
    frf = frf_of(values, coherence=coherence, averages=np.array([[7], [5]]), exponential_time_constant=0.25)
    write_frf(tmp_path / "a.h5", frf)
    back = read_frf(tmp_path / "a.h5")
    assert back.coherence is not None
    assert back.averages is not None
    np.testing.assert_array_equal(back.coherence, coherence)
    np.testing.assert_array_equal(back.averages, [[7], [5]])
    assert back.exponential_time_constant == 0.25
    with h5py.File(tmp_path / "a.h5", "r+") as file:  # as files were before these fields
        del file["coherence"], file["averages"], file.attrs["exponential_time_constant_s"], file.attrs["content_sha256"]
    older = read_frf(tmp_path / "a.h5")
    assert older.coherence is None
    assert older.averages is None
    assert older.exponential_time_constant is None
    np.testing.assert_array_equal(older.laplace, 2j * np.pi * AXIS)


def test_variance_from_coherence_is_the_scatter_of_h1() -> None:
    """10 averages with noise on the response, 4000 times over: mean stated variance against the variance seen."""
    generator = np.random.default_rng(2)
    shape = (4000, 10)
    noise = 0.3 * (generator.normal(size=shape) + 1j * generator.normal(size=shape))
    force = generator.uniform(0.8, 1.2, shape)
    response = 2.0 * force + noise
    s_ff, s_xf, s_xx = (force**2).sum(1), (response * force).sum(1), (np.abs(response) ** 2).sum(1)
    values, coherence = s_xf / s_ff, np.abs(s_xf) ** 2 / (s_ff * s_xx)
    twice = [np.stack([each, each], axis=1)[:, :, None] for each in (values, coherence)]
    stated = frf_of(twice[0], coherence=twice[1], averages=np.full((2, 1), 10)).entry_variance()
    assert stated is not None
    seen = np.mean(np.abs(values - 2.0) ** 2)
    assert stated[:, 0, 0].mean() == pytest.approx(seen, rel=0.05)


def test_covariance_takes_precedence_over_coherence_and_single_averages_have_none() -> None:
    ones = np.ones((3, 2, 1))
    both = frf_of(
        ones + 0j,
        coherence=0.5 * ones,
        averages=np.array([[4], [4]]),
        covariance=FrfCovariance(np.tile(np.diag([4.0, 9.0]) + 0j, (3, 1, 1)), np.ones((3, 1, 1), complex)),
    )
    np.testing.assert_allclose(both.entry_variance()[:, :, 0], [[4, 9]] * 3)  # type: ignore[index]
    assert replace(both, covariance=None, averages=np.array([[1], [1]])).entry_variance() is None
    assert replace(both, covariance=None, coherence=None).entry_variance() is None
    mixed = replace(both, covariance=None, averages=np.array([[3], [1]])).entry_variance()
    assert mixed is not None
    np.testing.assert_allclose(mixed[0, :, 0], [0.5, np.nan])


def test_receptance_of_exponentially_windowed_data_is_divided_where_the_values_stand() -> None:
    """``h(t) exp(-t/tau)`` has the transform H(i w + 1/tau), and acceleration is s^2 times displacement there."""
    tau, pole = 0.4, -1 + 12j
    s = 2j * np.pi * AXIS + 1 / tau
    receptance = (1 / (s - pole) + 1 / (s - np.conj(pole)))[:, None, None] * np.ones((1, 2, 1))
    frf = frf_of(receptance * s[:, None, None] ** 2, exponential_time_constant=tau)
    result = to_receptance(frf)
    np.testing.assert_allclose(result.values[1:], receptance[1:], rtol=1e-12)
    assert result.exponential_time_constant == tau


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"coherence": np.full((3, 1, 1), 0.5)}, "shape"),
        ({"coherence": np.full((3, 2, 1), 1.5)}, "outside 0 to 1"),
        ({"multiple_coherence": np.zeros((0, 2))}, r"multiple coherence has shape \(0, 2\), expected \(3, 2\)"),
        ({"covariance": FrfCovariance(ONES, ONES)}, r"response covariance has shape \(3, 1, 1\), expected \(3, 2, 2\)"),
        ({"averages": np.full((2, 2), 3)}, "shape"),
        ({"averages": np.full((2, 1), -3)}, "-3 averages"),
        ({"exponential_time_constant": 0.0}, "must be positive"),
    ],
)
def test_quality_that_cannot_be_is_refused(more: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        frf_of(np.ones((3, 2, 1), complex), **more)


def test_channels_of_several_quantities_are_refused_with_the_options_that_choose_one() -> None:
    accelerations = [Channel(name, "acceleration", "m/s^2", name, "+X") for name in ("a1", "a2")]
    laser, force = Channel("laser", "velocity", "m/s", "TIP", "+X"), Channel("f", "force", "N", "TIP", "+X")
    with pytest.raises(InputError, match=r"acceleration: a1, a2; velocity: laser.* --response a1 --response a2"):
        frf_quantity([*accelerations, laser], [force])
    assert frf_quantity(accelerations, [force]) == ("accelerance", "m/s^2/N")
