"""Bands around the limit: coverage by Monte Carlo, probabilities, recommended cuts."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from estimation import FrfCovariance
from millfrf.core import InputError
from millfrf.cutting import ChipLaw, MillingProcess
from millfrf.stability import StabilityLobes, certified_lobes, depth_errors, zero_order
from millfrf.stability.drawn_structures import drawn
from millfrf.stability.recommendation import recommended_cut
from millfrf.stability.sensitivity import speeds_within
from modal_fit import ModalModel
from replay_data import table_one_model

HALF_DOWN = MillingProcess(2, 0.0127, pi / 2, 119e6, 0.17, 0.33, pi / 2, pi, 0.15e-3)
HELICAL = replace(HALF_DOWN, helix_angle=np.radians(35.0))
SPEEDS = np.array([650, 800, 950, 1100, 1300, 1600, 2000, 2300]) * pi / 30


def with_errors(model: ModalModel, poles: float, vectors: float) -> ModalModel:
    """The model with independent errors: of poles as a share of their decay, of vectors as a share of the largest."""
    sizes = [np.tile(poles * -model.poles.real, 2)]
    sizes += [np.full(2 * part.size, vectors * np.abs(part).max()) for part in (model.right, model.left)]
    return replace(model, covariance=np.diag(np.concatenate(sizes) ** 2))


def run_of_bands(seeds: range) -> np.ndarray:
    """Normalised errors (limit - truth) / standard error, (n_seeds, n_speeds), of estimates that are off at random."""
    truth = with_errors(table_one_model(), 0.03, 0.01)
    cut = replace(HALF_DOWN, ktc_std=0.02 * HALF_DOWN.ktc, krc_std=0.02, kac_std=0.02)
    exact = certified_lobes(truth, HALF_DOWN, SPEEDS, 20e-3).depth_limits
    result = []
    for seed in seeds:
        [(model, process)] = drawn(truth, cut, 1, seed)
        model, process = replace(model, covariance=truth.covariance), replace(process, ktc_std=cut.ktc_std)
        lobes = certified_lobes(model, process, SPEEDS, 20e-3)
        result.append((lobes.depth_limits - exact) / depth_errors(model, process, lobes))
    return np.array(result)


def test_errors_are_of_the_right_size() -> None:
    deviation = run_of_bands(range(12))
    assert 0.6 < np.sqrt(np.mean(deviation**2)) < 1.5


@pytest.mark.parametrize("correlation", [-0.9, 0.9])
def test_the_correlation_of_the_coefficients_changes_the_band(correlation: float) -> None:
    """Drawn limits spread as the errors with the correlation say, and not as independent ones."""
    errors = np.array([0.03 * HALF_DOWN.ktc, 0.03, 0.0])
    matrix = np.zeros((6, 6))
    matrix[:3, :3] = np.diag(errors**2)
    matrix[0, 1] = matrix[1, 0] = correlation * errors[0] * errors[1]
    alone = replace(HALF_DOWN, ktc_std=float(errors[0]), krc_std=float(errors[1]))
    cut = replace(alone, covariance=tuple(map(tuple, matrix.tolist())))
    model, speeds = table_one_model(), SPEEDS[2:3]
    lobes = certified_lobes(model, HALF_DOWN, speeds, 20e-3)
    limits = []
    for _, process in drawn(model, cut, 60, 1):
        limits.append(certified_lobes(model, process, speeds, 20e-3).depth_limits[0])
    stated, independent = (depth_errors(model, process, lobes)[0] for process in (cut, alone))
    assert np.std(limits) == pytest.approx(stated, rel=0.25)
    assert abs(stated / independent - 1) > 0.1


@pytest.mark.slow
def test_bands_cover_the_true_limit() -> None:
    deviation = run_of_bands(range(150))
    covered = np.abs(deviation) < 1.96
    assert 0.92 <= covered.mean() <= 0.98, covered.mean(axis=0)


@pytest.mark.parametrize("cut", [HALF_DOWN, HELICAL], ids=["straight", "helix"])
def test_error_of_a_model_follows_its_parameters(cut: MillingProcess) -> None:
    """Only the first pole's frequency is uncertain: the error is the change that a shift makes."""
    model = table_one_model()
    size = 2 * (model.poles.size + model.right.size + model.left.size)
    covariance = np.zeros((size, size))
    shift = 1e-4 * abs(model.poles[0])
    covariance[len(model.poles), len(model.poles)] = shift**2  # imaginary part of pole 1
    known = replace(model, covariance=covariance)
    lobes = certified_lobes(known, cut, SPEEDS, 20e-3)
    moved = replace(model, poles=model.poles + np.array([1j * shift, 0]))
    change = certified_lobes(moved, cut, SPEEDS, 20e-3).depth_limits - lobes.depth_limits
    np.testing.assert_allclose(depth_errors(known, cut, lobes), np.abs(change), rtol=0.02, atol=1e-9)


@pytest.mark.parametrize(("name", "share"), [("ktc", 1e-4), ("krc", 1e-3), ("kac", 1e-3)])
def test_error_of_a_helical_cut_follows_its_coefficients(name: str, share: float) -> None:
    step = share * getattr(HELICAL, name)
    known = replace(HELICAL, **{f"{name}_std": step})
    lobes = certified_lobes(table_one_model(), HELICAL, SPEEDS, 20e-3)
    moved = replace(HELICAL, **{name: getattr(HELICAL, name) + step})
    change = certified_lobes(table_one_model(), moved, SPEEDS, 20e-3).depth_limits - lobes.depth_limits
    np.testing.assert_allclose(depth_errors(table_one_model(), known, lobes), np.abs(change), rtol=0.02, atol=1e-9)


@pytest.mark.parametrize("number", [0, 1, 2])
def test_error_of_an_exponent_is_the_change_of_the_limit(number: int) -> None:
    """Only one exponent of the chip thickness is uncertain; draws spread as the first order says."""
    law, step = ChipLaw((0.25, 0.4, 0.3), 1e-4, 1e-5), 1e-3
    rows = np.zeros((9, 9))
    rows[6 + number, 6 + number] = step**2
    known = replace(HELICAL, chip_law=law, ktc_std=1e-3, covariance=tuple(map(tuple, rows.tolist())))
    model = table_one_model()
    lobes = certified_lobes(model, known, SPEEDS, 20e-3)
    exponents = np.array(law.exponents) + step * np.eye(3)[number]
    moved = replace(known, chip_law=replace(law, exponents=tuple(exponents.tolist())))
    change = certified_lobes(model, moved, SPEEDS, 20e-3).depth_limits - lobes.depth_limits
    np.testing.assert_allclose(depth_errors(model, known, lobes), np.abs(change), rtol=0.02, atol=1e-9)
    spread = np.std([process.chip_law.exponents[number] for _, process in drawn(model, known, 400, 1)])
    assert spread == pytest.approx(step, rel=0.1)


@pytest.mark.long
def test_measured_frf_gives_errors_of_the_same_kind() -> None:
    """Noise on the lines themselves, no fit: spread of the limits over seeds against the error stated."""
    truth = table_one_model()
    axis = np.arange(10.0, 30.0, 0.02)
    clean = truth.frf(axis)
    level = 2e-3 * np.abs(clean.values).max()
    covariance = FrfCovariance(
        np.broadcast_to(level**2 * np.eye(3, dtype=complex), (len(axis), 3, 3)),
        np.broadcast_to(np.eye(3, dtype=complex), (len(axis), 3, 3)),
    )
    # errors that are smooth over a line's neighbours, and independent from one line of the motion to the next
    limits, stated = [], []
    for seed in range(40):
        generator = np.random.default_rng(seed)
        draw = generator.standard_normal((2, 3, 3, 16)) * level / np.sqrt(32)
        waves = np.exp(2j * pi * np.outer(axis, generator.uniform(-0.3, 0.3, 16)))
        error = np.einsum("pqm,km->kpq", draw[0] + 1j * draw[1], waves)
        noisy = replace(clean, values=clean.values + error, covariance=covariance)
        lobes = certified_lobes(noisy, HALF_DOWN, SPEEDS[1:6:2], 20e-3)
        limits.append(lobes.depth_limits)
        stated.append(depth_errors(noisy, HALF_DOWN, lobes))
    ratio = np.std(limits, axis=0) / np.mean(stated, axis=0)
    np.testing.assert_allclose(ratio, 1.0, atol=0.4)


def flat_lobes() -> StabilityLobes:
    """Limit 2 mm, with a pocket of 4 mm between 1400 and 1600 rpm."""
    rpm = np.arange(1000.0, 2001.0, 10)
    depth = np.where((rpm > 1400) & (rpm < 1600), 4e-3, 2e-3)
    return StabilityLobes(rpm * pi / 30, depth, np.full(len(rpm), 18.0), ("hopf",) * len(rpm), "collocation")


def test_recommendation_with_errors() -> None:
    lobes, errors = flat_lobes(), np.full(101, 0.1e-3)
    cut = recommended_cut(lobes, errors, confidence=0.95, drift=0.01)
    assert 1400 < cut.spindle_speed * 30 / pi < 1600
    assert cut.depth == pytest.approx(4e-3 - 1.645 * 0.1e-3, rel=1e-3)
    assert recommended_cut(lobes, errors, drift=0.1).spindle_speed * 30 / pi == pytest.approx(2000)


def test_requests_that_cannot_be_met_are_refused() -> None:
    lobes, errors = flat_lobes(), np.full(101, 0.1e-3)
    with pytest.raises(InputError, match="outside the lobes"):
        speeds_within(lobes.spindle_speeds, 500 * pi / 30, 0.0)
    with pytest.raises(InputError, match="confidence"):
        recommended_cut(lobes, errors, confidence=1.5)
    with pytest.raises(InputError, match="no cut"):
        recommended_cut(lobes, 100 * errors)
    with pytest.raises(InputError, match="no covariance"):
        depth_errors(table_one_model(), HALF_DOWN, lobes)
    model = table_one_model()
    size = 2 * (model.poles.size + model.right.size + model.left.size)
    with pytest.raises(InputError, match="averaged coefficients"):
        depth_errors(replace(model, covariance=np.eye(size)), HALF_DOWN, zero_order(model, HALF_DOWN, SPEEDS[:1], 5e-3))
