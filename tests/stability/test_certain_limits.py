"""Limits that are called verified hold for structures that the stated errors allow, to the accuracy that is promised.

Estimates are random structures with a covariance, truths are drawn from it. The coefficients are the stated ones.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from drawn_cuts import Case, random_case
from independent_floquet import Mill, spectral_radius
from scipy.stats import binom

from estimation import FrfCovariance
from millfrf.core import TIP, InputError
from millfrf.stability import (
    certified_cut,
    certified_lobes,
    depth_errors,
    limit_band,
    lowest_limits,
    read_lobes,
    write_lobes,
)
from millfrf.stability.drawn_structures import drawn
from millfrf.stability.limit_interval import sampled_limits
from modal_fit import ModalModel

PROMISED = 0.07


@dataclass(frozen=True)
class Compared:
    """Relative errors of limits by status, over cases, speeds and truths."""

    verified: np.ndarray
    others: np.ndarray


def case_of(seed: int) -> Case:
    """A random case whose errors are a tenth of the usual ones to all of them."""
    case = random_case(seed)
    assert case.model.covariance is not None
    size = float(np.random.default_rng(500 + seed).uniform(0.1, 1.0))
    return replace(case, model=replace(case.model, covariance=size**2 * case.model.covariance))


def compared(seeds: range, truths: int) -> Compared:
    """Errors of the limits of estimates in other structures that are drawn from the same covariance."""
    groups: tuple[list[np.ndarray], list[np.ndarray]] = ([], [])
    for seed in seeds:
        case = case_of(seed)
        speeds = np.linspace(case.speeds.min(), case.speeds.max(), 16)
        lobes = certified_lobes(case.model, case.cut, speeds, case.max_depth)
        said = np.minimum(lobes.depth_limits, case.max_depth)
        status = np.array(lobes.status)
        for truth in structures(case.model, truths, 1000 + seed):
            limits = lowest_limits(truth, case.cut, speeds, 1.2 * case.max_depth).lowest().depth_limits
            error = np.abs(said / np.minimum(limits, case.max_depth) - 1)
            for group, name in zip(groups, ("verified", "uncertain"), strict=True):
                group.append(error[status == name])
    return Compared(*(np.concatenate(group) for group in groups))


def structures(model: ModalModel, count: int, seed: int) -> list[ModalModel]:
    """Draw structures from a covariance, written for this test: its parameters are real and imaginary parts in turn."""
    assert model.covariance is not None
    rng = np.random.default_rng(seed)
    moves = rng.multivariate_normal(np.zeros(len(model.covariance)), model.covariance, count, method="eigh")
    sizes = np.cumsum([part.size for part in (model.poles, model.poles, model.right, model.right, model.left)])
    drawn = []
    for move in moves:
        parts = np.split(move, sizes)
        poles = model.poles + parts[0] + 1j * parts[1]
        right, left = (
            old + (real + 1j * imaginary).reshape(old.shape)
            for old, real, imaginary in ((model.right, *parts[2:4]), (model.left, *parts[4:6]))
        )
        drawn.append(replace(model, poles=poles, right=right, left=left, covariance=None))
    return drawn


def assert_promised(found: Compared) -> None:
    assert np.mean(found.verified < PROMISED) >= 0.99
    # numerics alone called all of them verified, and the ones called uncertain are often wrong
    assert np.mean(np.concatenate([found.verified, found.others]) < PROMISED) < 0.95
    assert np.mean(found.others < PROMISED) < 0.85
    assert len(found.verified) > 0.3 * len(found.others)


def test_verified_limits_hold_for_structures_within_the_errors() -> None:
    assert_promised(compared(range(12), 6))


@pytest.mark.slow
def test_verified_limits_hold_for_many_structures_within_the_errors() -> None:
    assert_promised(compared(range(12, 52), 20))


def test_the_bounds_of_a_certain_limit_are_those_of_independent_multipliers() -> None:
    """In other structures a cut is stable 7 % below a verified limit, and unstable above it, within 7 %."""
    right = []
    for seed in range(20, 36):
        case = case_of(seed)
        cut = case.cut
        mill = Mill(cut.teeth, cut.edge_angle, cut.ktc, cut.krc, cut.kac, cut.start_angle, cut.exit_angle)
        lobes = certified_lobes(case.model, cut, case.speeds[::6], case.max_depth)
        for speed, limit, status in zip(lobes.spindle_speeds, lobes.depth_limits, lobes.status, strict=True):
            if status == "verified" and np.isfinite(limit):
                for truth in structures(case.model, 4, seed):
                    parts = (truth.poles, truth.right, truth.left, mill, float(speed))
                    below, *above = (spectral_radius(*parts, ratio * float(limit)) for ratio in (0.93, 1.02, 1.07))
                    right.append(below < 1 < max(above))
    assert len(right) > 90
    assert len(right) - sum(right) <= binom.ppf(0.999, len(right), 0.01)


def two_modes(flexibility: float) -> ModalModel:
    """A mode along X that is exact, and one along Y whose flexibility, as a share of it, has an error of 10 %."""
    natural = 2 * np.pi * np.array([23.0, 58.5])
    poles = natural * (-0.02 + 1j * np.sqrt(1 - 0.02**2))
    right = np.diag([1.0, flexibility])[:, [0, 1, 1]] * [1, 1, 0] + 0j
    left = np.eye(2, 3) * 1e-6 * natural[:, None] / 2j
    errors = np.zeros(28)
    errors[4 + 4] = 0.1 * flexibility  # real part of the right vector of the second mode, along Y
    return ModalModel(poles, right, left, TIP, TIP, covariance=np.diag(errors**2))


@pytest.mark.parametrize("speed", [1400.0, 1500.0, 1560.0])
def test_a_second_lobe_just_above_the_limit_leaves_it_uncertain(speed: float) -> None:
    """The first order at the limit of one mode says nothing of the limit of another mode just above it."""
    cut, speeds = replace(random_case(3).cut, teeth=2, start_angle=0.0, exit_angle=1.07), np.array([speed * np.pi / 30])
    low, high = 0.01, 10.0  # share at which the second mode takes over the limit: its motion is above 40 Hz
    while high / low > 1.001:
        middle = float(np.sqrt(low * high))
        taken = lowest_limits(two_modes(middle), cut, speeds, 0.05).lowest().chatter_frequencies[0] > 40
        low, high = (low, middle) if taken else (middle, high)
    known = two_modes(0.99 * low)
    lobes = certified_lobes(known, cut, speeds, 0.05)
    limit = float(lobes.depth_limits[0])
    assert lobes.chatter_frequencies[0] < 40
    # the first order alone calls the limit certain
    assert 1.96 * depth_errors(known, replace(cut, ktc_std=0.0), lobes)[0] < PROMISED * limit
    mill = Mill(cut.teeth, cut.edge_angle, cut.ktc, cut.krc, cut.kac, cut.start_angle, cut.exit_angle)
    within = two_modes(1.2 * 0.99 * low)  # two standard errors
    assert spectral_radius(within.poles, within.right, within.left, mill, float(speeds[0]), 0.93 * limit) > 1
    assert lobes.status == ("uncertain",)


def one_mode(frequency_error: float) -> ModalModel:
    """A mode at 40 Hz whose natural frequency has a relative standard error, and nothing else."""
    natural = 2 * np.pi * 40.0
    poles = natural * np.array([-0.03 + 1j * np.sqrt(1 - 0.03**2)])
    right = np.array([[0.3, 1.0, 0.0]]) + 0j
    errors = np.zeros(2 * (1 + 3 + 3))
    errors[1] = frequency_error * natural  # imaginary part of the pole
    return ModalModel(poles, right, right * 1e-6 * natural / 2j, TIP, TIP, covariance=np.diag(errors**2))


def test_the_edge_of_a_lobe_just_beyond_a_speed_leaves_its_limit_uncertain() -> None:
    """A lobe of period doubling from 3.2 to 6 mm begins .1 % above the speed, and ends below the limit of 10 mm."""
    cut, speed = replace(random_case(3).cut, teeth=2, start_angle=0.0, exit_angle=0.6), 829.0 * np.pi / 30
    known = one_mode(0.003)
    lobes = certified_lobes(known, cut, np.array([speed]), 0.05)
    limit = float(lobes.depth_limits[0])
    assert (lobes.numerics, lobes.status) == (("verified",), ("uncertain",))
    mill = Mill(cut.teeth, cut.edge_angle, cut.ktc, cut.krc, cut.kac, cut.start_angle, cut.exit_angle)
    lower = known.poles * (1 - 0.003)  # one standard error
    radii = [spectral_radius(lower, known.right, known.left, mill, speed, share * limit) for share in (0.2, 0.4, 0.93)]
    assert radii[0] < 1 < radii[1]
    assert radii[2] < 1
    band = limit_band(known, cut, lobes, 0.05)
    assert band.basis == ("samples",)
    assert band.low[0] < 0.4 * limit
    assert certified_lobes(one_mode(1e-4), cut, np.array([speed]), 0.05).status == ("verified",)


def test_bands_are_those_of_drawn_structures_where_the_first_order_fails() -> None:
    """One of 40 draws lies on either side of 39 others; beyond the first order there are more than twice as many."""
    cut, speeds = replace(random_case(3).cut, ktc_std=0.0), np.linspace(700.0, 1400.0, 8) * np.pi / 30
    known = one_mode(0.04)
    lobes = certified_lobes(known, cut, speeds, 0.2)
    half = 1.96 * depth_errors(known, cut, lobes)
    band = limit_band(known, cut, lobes, 0.2)
    limits = sampled_limits(drawn(known, cut, 39, 1), speeds, 0.2)
    outside = (limits < band.low) | (limits > band.high)
    beyond = (limits < lobes.depth_limits - half) | (limits > lobes.depth_limits + half)
    assert outside.mean() < 2 * 2 / 40 < beyond.mean()


def test_errors_of_coefficients_are_not_those_of_the_structure() -> None:
    """A structure without errors is certain, whatever the errors of the coefficients; without a covariance nothing."""
    case = random_case(3)
    assert case.model.covariance is not None
    exact = replace(case.model, covariance=0 * case.model.covariance)
    lobes, unknown = (
        certified_lobes(model, case.cut, case.speeds, case.max_depth)
        for model in (exact, replace(exact, covariance=None))
    )
    assert set(lobes.model) == {"certain"}
    assert lobes.status == unknown.status == unknown.numerics
    assert set(unknown.model) == {"not-stated"}


def test_a_helical_cut_is_certain_with_small_errors_only() -> None:
    case = random_case(3)
    assert case.model.covariance is not None
    cut = replace(case.cut, helix_angle=np.radians(30.0))
    words = []
    for size in (1e-3, 3.0):
        model = replace(case.model, covariance=size**2 * case.model.covariance)
        lobes = certified_lobes(model, cut, case.speeds[[12]], 0.02)
        assert np.isfinite(lobes.depth_limits).all()
        words.append((lobes.model[0], lobes.status[0]))
    assert words == [("certain", "verified"), ("uncertain", "uncertain")]


def test_the_column_is_written_and_older_files_are_read(tmp_path: Path) -> None:
    case = random_case(3)
    lobes = certified_lobes(case.model, case.cut, case.speeds[:8], case.max_depth)
    write_lobes(tmp_path / "lobes.csv", lobes)
    assert read_lobes(tmp_path / "lobes.csv").model == lobes.model
    rows = [line.rsplit(",", 1)[0] for line in (tmp_path / "lobes.csv").read_text(encoding="utf-8").splitlines()]
    (tmp_path / "older.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    older = read_lobes(tmp_path / "older.csv")
    assert older.status == lobes.status
    assert set(older.model) == {"not-stated"}


@pytest.mark.parametrize(
    ("structure_error", "coefficient_error", "named"),
    [(0.8, 0.01, "the errors of the structure"), (0.01, 0.8, "the errors of the cutting coefficients")],
)
def test_the_reason_for_no_cut_names_the_larger_error(
    structure_error: float, coefficient_error: float, named: str
) -> None:
    """Of an FRF, whose limits have a first order only; the reason was to measure longer in any case."""
    case = random_case(3)
    frf = case.model.frf(np.arange(2.0, 400.0, 0.5))
    level = structure_error * np.abs(frf.values).max() * np.ones(len(frf.frequencies))
    variance = level[:, None, None] ** 2 * np.eye(3)
    frf = replace(frf, covariance=FrfCovariance(variance.astype(complex), np.ones_like(variance) * np.eye(3)))
    cut = replace(case.cut, ktc_std=coefficient_error * case.cut.ktc, krc_std=0.0, kac_std=0.0)
    lobes = certified_lobes(frf, cut, case.speeds[::6], case.max_depth)
    with pytest.raises(InputError, match=named):
        certified_cut(frf, cut, lobes, depth_errors(frf, cut, lobes), max_depth=case.max_depth)


def test_poles_that_may_not_decay_leave_limits_uncertain() -> None:
    case = random_case(3)
    assert case.model.covariance is not None
    model = replace(case.model, covariance=200.0**2 * case.model.covariance)
    lobes = certified_lobes(model, case.cut, case.speeds[::6], case.max_depth)
    assert "verified" not in lobes.status
