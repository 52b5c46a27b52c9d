"""The trial of random cells: its judges against a closed form and each other, its recordings, and one cell."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # benchmarks are no installed package

from acquisition import all_opened
from benchmarks.cell_trial.chain import advice_of
from benchmarks.cell_trial.in_time import ring
from benchmarks.cell_trial.judge import lowest_limit, radius, rpm, simulated
from benchmarks.cell_trial.recordings import immersions, write_cell
from benchmarks.cell_trial.robot_cell import Cut, Structure, assembled, draw_cell
from benchmarks.cell_trial.run_trial import run_cell
from benchmarks.cell_trial.scoring import table_of, unstable
from millfrf.gate import check_consistency

SEED = 2024


def _one_mode(frequency: float, damping: float, stiffness: float) -> Structure:
    """A mode that moves the tip along the feed alone."""
    omega = 2 * np.pi * frequency
    shape = np.array([[omega / np.sqrt(stiffness), 0.0, 0.0]])
    return assembled(np.array([omega]), np.array([damping]), shape, shape, [np.zeros((1, 1))] * 2, 0.0)


def _turning_limit(frequency: float, damping: float, stiffness: float, strength: float, delay: float) -> float:
    """Lowest depth at which ``1 + a strength (1 - exp(-i w tau)) H = 0``, from Tlusty's closed form.

    On the boundary ``a = -1 / (2 strength Re H)``, and the phase of H fixes the delay: w tau = 3 pi + 2 psi + 2 pi k.
    """
    omega = 2 * np.pi * frequency

    def receptance(w: float) -> complex:
        return 1 / (stiffness * (1 - (w / omega) ** 2 + 2j * damping * w / omega))

    limits = []
    for lobe in range(200):

        def mismatch(w: float, lobe: int = lobe) -> float:
            return w * delay - (3 * np.pi + 2 * np.angle(receptance(w)) + 2 * np.pi * lobe)

        # Re H is negative from the resonance on
        low, high = omega * (1 + 1e-9), 40 * omega
        if mismatch(low) * mismatch(high) < 0:
            limits.append(-1 / (2 * strength * receptance(brentq(mismatch, low, high)).real))
    return min(limit for limit in limits if limit > 0)


@pytest.mark.parametrize("passing", [7.0, 13.0, 19.0, 31.0, 60.0])
def test_limit_of_a_slot_with_four_teeth_is_that_of_turning(passing: float) -> None:
    """Two teeth a quarter turn apart make the directional matrix constant, so that Tlusty's closed form holds."""
    cut = Cut(4, 0.012, 0.0, np.pi, 6e8, 0.3, 0.1, 1e-4)
    expected = _turning_limit(17.0, 0.03, 1e6, cut.ktc * cut.krc, 1 / passing)
    limit = lowest_limit(_one_mode(17.0, 0.03, 1e6), cut, 2 * np.pi * passing / 4, 10 * expected)
    assert limit == pytest.approx(expected, rel=1e-3)


def test_limits_do_not_change_with_finer_elements() -> None:
    for number in range(3):
        cell = draw_cell(number, SEED)
        for speed in rpm(np.linspace(*cell.speeds_rpm, 3)):
            for depth in (0.1e-3, 1e-3):
                coarse, fine = (radius(cell.in_cut, cell.cut, float(speed), depth, finer=n) for n in (1, 2))
                assert coarse == pytest.approx(fine, rel=1e-6)


def test_multipliers_and_simulation_agree_on_both_sides_of_the_limit() -> None:
    tried = 0
    for number in range(4):
        cell = draw_cell(number, SEED)
        for speed in rpm(np.array(cell.speeds_rpm)):
            limit = lowest_limit(cell.in_cut, cell.cut, float(speed), 0.02)
            if np.isfinite(limit) and radius(cell.in_cut, cell.cut, float(speed), 1.25 * limit) > 1:
                tried += 1
                assert simulated(cell.in_cut, cell.cut, float(speed), 0.8 * limit).stable
                assert not simulated(cell.in_cut, cell.cut, float(speed), 1.25 * limit).stable
    assert tried >= 4


def test_response_to_a_force_is_that_of_the_receptance() -> None:
    structure = draw_cell(3, SEED).in_cut
    step, n = 1 / 8192, 2**18
    force = np.zeros((n, 3))
    force[:2000] = np.random.default_rng(5).standard_normal((2000, 3))
    tip, _ = ring(structure, force, step)
    frequencies = np.fft.rfftfreq(n, step)
    lines = (frequencies > 8) & (frequencies < 150)
    pushed, moved = (np.fft.rfft(signal, axis=0)[lines] for signal in (force, tip))
    omega = 2 * np.pi * frequencies[lines]
    expected = -(omega[:, None] ** 2) * np.einsum("fpq,fq->fp", structure.receptance(frequencies[lines]), pushed)
    assert np.linalg.norm(moved - expected) < 5e-3 * np.linalg.norm(expected)


def test_cells_are_robots_that_are_not_reciprocal_and_stiffer_at_rest() -> None:
    for number in range(20):
        cell = draw_cell(number, SEED)
        assert cell.in_cut.poles.real.max() < 0
        assert np.all(np.abs(cell.at_rest.poles) > np.abs(cell.in_cut.poles) * 1.005)
        receptance = cell.in_cut.receptance(np.linspace(11, 42, 200))
        apart = np.linalg.norm(receptance - receptance.transpose(0, 2, 1)) / np.linalg.norm(receptance)
        assert 1e-3 < apart < 0.6
        assert {cut.leave - cut.start for cut in immersions(cell).values()} != {0.0}


def test_a_report_without_a_recommendation_states_why() -> None:
    page = "<p>No recommended cut: no cut is stable with confidence 0.95; tap above 48 Hz.</p><p>Next.</p>"
    assert advice_of(page) == (None, "No recommended cut: no cut is stable with confidence 0.95; tap above 48 Hz.")
    advised = "<p>lobes.csv: largest removal rate at 95 % confidence of stability, drift 2 %: 1.25 mm at 3000 rpm</p>"
    assert advice_of(advised) == ((3000.0, 1.25e-3), "")


@pytest.mark.slow
def test_a_cell_from_its_recordings_to_a_stable_recommendation(tmp_path: Path) -> None:
    result = run_cell(2, SEED, tmp_path)
    assert not result["failed"]
    assert result["advice"] is not None or result["reason"]
    assert not unstable(result)
    assert "cells 1" in table_of([result])


def test_the_stated_coefficients_are_off_by_more_than_their_error() -> None:
    cell = draw_cell(5, SEED)
    assert abs(cell.stated.ktc / cell.cut.ktc - 1) == pytest.approx(0.07)
    assert replace(cell.stated, ktc=cell.cut.ktc, krc=cell.cut.krc, kac=cell.cut.kac) == cell.cut


@pytest.mark.parametrize("number", [0, 9, 29])
def test_right_recordings_accuse_no_channel(tmp_path: Path, number: int) -> None:
    """Of the recordings of 59 cells, 51 were told to hold a force of a thousand times its size, or the like."""
    cell = draw_cell(number, 46)
    write_cell(cell, tmp_path, 46 + 1000 * number)
    with all_opened([tmp_path / f"cut_{name}.h5" for name in immersions(cell)]) as recordings:
        assert check_consistency(recordings) == []
