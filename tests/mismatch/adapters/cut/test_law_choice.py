"""Exponents of the chip thickness from forces of a simulator that shares no code: values, error bars, choice of law."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import scipy

from millfrf.cutting import ChipLaw, MillingProcess
from millfrf.mismatch import CutCoefficients, CutForces, identify_coefficients
from millfrf.mismatch.cut.identification.coefficient_fit import CoefficientFit, fit_cuts
from millfrf.mismatch.cut.identification.force_problem import EDGES, EDGES_AND_EXPONENTS, EXPONENTS
from millfrf.mismatch.cut.identification.identified_process import identified_process
from millfrf.mismatch.cut.identification.identify import EXPLAINED
from millfrf.mismatch.cut.identification.law_choice import LawChoice, choose_law
from millfrf.mismatch.cut.identification.turn_spectra import turn_spectra
from millfrf.mismatch.cut.motion import SpindleLaw

from .loop_forces import COEFFICIENTS, RATE, loop_forces

EDGE = 8e-6  # m
AT_1_MM = np.array([350e6, 150e6, 60e6, 0.0, 0.0, 0.0])
EDGED = np.array([350e6, 150e6, 60e6, 10e3, 12e3, 3e3])
POWERS = (0.28, 0.45, 0.35)
FEEDS = (25e-6, 75e-6, 125e-6)


def cuts_of(
    coefficients: np.ndarray, powers: tuple[float, float, float], *, seed: int = 0, axes: int = 3, **options: object
) -> list[CutForces]:
    """Slots of two teeth at three feeds; the simulator's noise differs from seed to seed."""
    cuts = []
    for number, feed in enumerate(FEEDS):
        force = loop_forces(
            feed, first_angle=2.0 * number, seed=10 * seed + number, coefficients=coefficients, powers=powers,
            round_edge=EDGE, **options,  # type: ignore[arg-type]
        )  # fmt: skip
        helix = float(options.get("helix", 0.5))  # type: ignore[arg-type]
        process = MillingProcess(
            2, 0.016, math.pi / 2, 1e9, 0.3, 0.0, 0.0, math.pi, feed, helix_angle=helix,
            chip_law=ChipLaw(edge_radius=EDGE),
        )  # fmt: skip
        turns = turn_spectra("cut", force[:, :axes], RATE, SpindleLaw(0.0, 0.0, 6000 * math.pi / 30), 2, 8)
        shown = tuple(range(axes))
        cuts.append(CutForces("cut", process, 0.003, turns.mean, turns.error, turns.drift, shown, turns.turning))
    return cuts


def truth_at(reference: float, coefficients: np.ndarray, powers: Sequence[float]) -> np.ndarray:
    """Return the true coefficients at a chip (m)."""
    true = np.array(coefficients)
    true[:3] *= (reference / 1e-3) ** -np.array(powers)
    return true


def assert_true(result: CutCoefficients, coefficients: np.ndarray, powers: Sequence[float]) -> None:
    law = result.process.chip_law
    true = truth_at(law.reference, coefficients, powers)
    seen = np.isfinite(result.coefficients)
    bent = np.isfinite(result.exponent_errors)
    assert (np.abs(result.coefficients - true)[seen] <= 4 * result.errors[seen]).all()
    assert (np.abs(result.exponents - powers)[bent] <= 4 * result.exponent_errors[bent]).all()
    assert result.process.ktc == pytest.approx(true[0], rel=0.01)
    assert law.exponents[:2] == pytest.approx(powers[:2], abs=0.02)


def test_exponents_without_edge_forces_are_found() -> None:
    result = identify_coefficients(cuts_of(AT_1_MM, POWERS), ("Fx", "Fy", "Fz"))
    assert result.law is not None
    assert result.law.law == EXPONENTS
    assert result.law.without_exponents < 1e-6 < result.law.without_edges
    assert "fall with the chip thickness (F-tests" in result.law.sentence
    assert_true(result, AT_1_MM, POWERS)
    assert result.process.kte == 0
    assert 25e-6 < result.process.chip_law.reference < 125e-6  # where the cuts know the force best
    means = np.abs(result.mean_coefficients - result.coefficients)[:3]
    assert (means < 3 * result.mean_errors[:3]).all()


def choice_of(coefficients: np.ndarray, powers: tuple[float, float, float]) -> LawChoice:
    cuts = cuts_of(coefficients, powers, helix=0.0)
    choice = choose_law(cuts, fit_cuts(cuts), (), EXPLAINED)
    assert choice is not None
    return choice


def test_edge_forces_without_exponents_are_found() -> None:
    choice = choice_of(COEFFICIENTS, (0.0, 0.0, 0.0))
    assert choice.law == EDGES
    assert choice.without_edges < 1e-6 < choice.without_exponents
    assert not choice.fit.exponents.any()
    errors = np.sqrt(np.diag(choice.fit.covariance))[:6]
    assert (np.abs(choice.fit.coefficients - COEFFICIENTS) < 4 * errors).all()


def test_both_are_found_where_both_act() -> None:
    choice = choice_of(EDGED, POWERS)
    assert choice.law == EDGES_AND_EXPONENTS
    assert "with edge forces (F-tests" in choice.sentence
    errors = np.sqrt(np.diag(choice.fit.covariance))
    off = np.append(choice.fit.coefficients - truth_at(choice.fit.reference, EDGED, POWERS), choice.fit.exponents)
    off[6:] -= POWERS
    assert (np.abs(off) < 4 * errors).all()


def test_a_force_in_proportion_to_the_chip_needs_neither() -> None:
    choice = choice_of(np.where(np.arange(6) < 3, COEFFICIENTS, 0.0), (0.0, 0.0, 0.0))
    assert choice.law == EDGES
    assert choice.sentence.startswith("these cuts do not tell exponents from edge forces")


def test_without_a_force_along_z() -> None:
    result = identify_coefficients(cuts_of(AT_1_MM, POWERS, axes=2, helix=0.0), ("Fx", "Fy"))
    assert result.law is not None
    assert result.law.law == EXPONENTS
    assert np.isnan(result.coefficients[2])
    assert_true(result, AT_1_MM, POWERS)
    assert result.process.chip_law.exponents[2] == result.process.chip_law.exponents[0]


def test_without_an_edge_radius_the_law_is_not_tried() -> None:
    exact = cuts_of(AT_1_MM, POWERS, helix=0.0)
    cuts = [replace(cut, process=replace(cut.process, chip_law=ChipLaw())) for cut in exact]
    result = identify_coefficients(cuts, ("Fx", "Fy", "Fz"))
    assert result.law is None
    assert not result.process.chip_law.varies


def test_the_covariance_is_that_of_the_files_numbers() -> None:
    """Drawn coefficients and exponents, as shares of the drawn Ktc, have the covariance of the cutting file."""
    cuts = cuts_of(EDGED, POWERS, helix=0.0)
    fit = fit_cuts(cuts, law=EDGES_AND_EXPONENTS)
    fitted = np.append(fit.coefficients, fit.exponents)
    drawn = np.random.default_rng(0).multivariate_normal(fitted, fit.covariance, 100_000)
    drawn[:, 1:3] /= drawn[:, :1]
    expected = np.cov(drawn.T)
    scale = np.outer(np.sqrt(np.diag(expected)), np.sqrt(np.diag(expected)))
    process = identified_process(cuts, fit.coefficients, fit.covariance, fit, 0.0)
    assert np.array(process.covariance) / scale == pytest.approx(expected / scale, abs=0.02)
    assert abs(expected[0, 6]) < 0.02 * scale[0, 6]  # the pivot


def fits(count: int) -> list[CoefficientFit]:
    result = []
    for seed in range(count):
        cuts = cuts_of(AT_1_MM, POWERS, seed=seed + 1, noise=0.2, seconds=0.6, helix=0.0)
        result.append(fit_cuts(cuts, law=EXPONENTS, near=None if not result else result[0]))
    return result


@pytest.mark.slow
def test_error_bars_cover_the_truth() -> None:
    """Of 100 fits, 95 % of intervals of 1.96 standard errors hold the truth, within what a binomial allows at 1e-3.

    Errors are no smaller than the scatter between cuts, so that they may be too wide, never too narrow.
    """
    deviations = []
    for fit in fits(100):
        true = truth_at(fit.reference, AT_1_MM, POWERS)
        errors = np.sqrt(np.diag(fit.covariance))
        off = np.concatenate([fit.coefficients[:3] - true[:3], fit.exponents - POWERS])
        deviations.append(np.abs(off) / errors[[0, 1, 2, 6, 7, 8]])
    covered = (np.array(deviations) < 1.96).mean(axis=0)
    lowest, highest = (scipy.stats.binom.ppf(p, 100, 0.95) / 100 for p in (1e-3, 1 - 1e-3))
    assert (covered >= lowest).all(), covered
    assert covered.mean() <= highest, covered
