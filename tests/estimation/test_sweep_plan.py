"""Planned sweeps against the simulated cell: predicted spectra and FRF errors are those that come."""

from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest

from acquisition import Recording, record
from estimation import SweepDemand, cross_spectra, input_independence, plan_sweeps, settings_for, sum_tests
from estimation.sweep_plan import predicted_spectra
from millfrf.core import InputError
from millfrf.cutting import MillingProcess, immersion_angles
from replay_data import LinearSweep, MillingCell, dynamometer, table_one_model, tip_accelerometers

CUTTER = MillingProcess(2, 12.7e-3, pi / 2, 119e6, 0.17, 0.33, 0.0, pi, 0.15e-3)
DEMAND = SweepDemand((14.0, 24.0), 1e-3, 0.25, 2e-8, 2e-8)


def test_predicted_spectra_are_those_of_the_simulated_sweeps(tmp_path: Path) -> None:
    plan = plan_sweeps(CUTTER, DEMAND)
    stiff = table_one_model()
    stiff = replace(stiff, left=1e-3 * stiff.left)  # hardly moves: the forces are those of the cutter alone
    sweep, tests = LinearSweep(*plan.spindle_speeds, 40.0), []
    for number, process in enumerate(plan.processes):
        sensors = dynamometer(1e-4) + tip_accelerometers(1e-4)
        cell = MillingCell(stiff, process, DEMAND.depth, sweep, 40.0, sensors=sensors, seed=number)
        record(cell, tmp_path / f"{number}.h5")
        with Recording(tmp_path / f"{number}.h5") as recording:
            tests.append(cross_spectra(recording, settings_for(10240.0, 4.0)))
    total = sum_tests(tests)
    inside = (total.frequencies > 15.5) & (total.frequencies < 22.5)
    measured = total.input_spectra[inside]
    expected = predicted_spectra(plan.processes, DEMAND.depth, DEMAND.band, total.frequencies[inside])
    ratio = np.real(np.einsum("kqq->q", measured)) / np.real(np.einsum("kqq->q", expected))
    np.testing.assert_allclose(ratio, 1.0, atol=0.1)
    result = np.median(np.linalg.svd(measured, compute_uv=False), axis=0)
    np.testing.assert_allclose(result, np.median(np.linalg.svd(expected, compute_uv=False), axis=0), rtol=0.15)
    assert input_independence(total, (15.5, 22.5)).independent[inside].all()


def test_duration_meets_the_demand_and_scales_with_noise() -> None:
    plan = plan_sweeps(CUTTER, DEMAND)
    assert plan.frf_errors.max() <= DEMAND.frf_error * (1 + 1e-9)
    noisy = plan_sweeps(CUTTER, replace(DEMAND, response_noise=100 * DEMAND.response_noise))
    strict = plan_sweeps(CUTTER, replace(DEMAND, response_noise=1000 * DEMAND.response_noise))
    assert strict.duration == pytest.approx(100 * noisy.duration, rel=1e-6)
    assert strict.frf_errors.max() == pytest.approx(DEMAND.frf_error, rel=1e-6)


def test_chosen_immersions_are_better_conditioned_than_neighbours() -> None:
    plan = plan_sweeps(CUTTER, DEMAND)
    alike = [replace(CUTTER, start_angle=a, exit_angle=a + pi / 6) for a in (0.2, 0.3, 0.4)]
    spectra = predicted_spectra(alike, DEMAND.depth, DEMAND.band, np.array([19.0]))
    values = np.linalg.svd(spectra, compute_uv=False)[0]
    assert plan.condition < 0.2 * values[0] / values[-1]


def _layout(cutter: MillingProcess, radial_depth: float) -> list[MillingProcess]:
    """Cuts of sweep milling force excitation (Franco et al.): up, central and down at one radial depth."""
    kinds = [immersion_angles(kind, radial_depth, cutter.diameter) for kind in ("up", "central", "down")]
    return [replace(cutter, start_angle=start, exit_angle=stop) for start, stop in kinds]


def _no_worse(cutter: MillingProcess, radial_depth: float, demand: SweepDemand) -> None:
    plan = plan_sweeps(cutter, demand)
    spectra = predicted_spectra(_layout(cutter, radial_depth), demand.depth, demand.band, plan.frequencies)
    values = np.linalg.svd(spectra, compute_uv=False)
    assert plan.condition <= (values[:, 0] / values[:, -1]).max() * (1 + 1e-9)
    assert plan.singular_values[:, -1].min() >= values[:, -1].min() * (1 - 1e-9)


@pytest.mark.parametrize("seed", [4, 5, 6])
def test_plan_excites_no_worse_than_up_central_and_down_cuts_of_the_same_radial_depth(seed: int) -> None:
    generator = np.random.default_rng(seed)
    cutter = replace(
        CUTTER,
        teeth=int(generator.integers(2, 5)),
        diameter=generator.uniform(0.01, 0.08),
        edge_angle=generator.choice([pi / 4, pi / 2]),
        ktc=generator.uniform(1e8, 2e9),
        krc=generator.uniform(0.15, 0.6),
        kac=generator.uniform(0.1, 0.4),
        kte=generator.uniform(0, 6e4),
        kre=generator.uniform(0, 1e5),
    )
    radial_depth = generator.uniform(0.1, 0.9) * cutter.diameter
    width = immersion_angles("up", radial_depth, cutter.diameter)[1]
    for band in ((14.0, 24.0), (15.0, 50.0)):  # within an octave, and with further harmonics
        _no_worse(cutter, radial_depth, replace(DEMAND, band=band, widths=(width,)))


@pytest.mark.parametrize("radial_depth", [0.012, 0.024, 0.04, 0.072])
def test_default_widths_excite_better_than_the_published_layout(radial_depth: float) -> None:
    """Cutter of 80 mm with two edges at 45 degrees in steel, 20 to 52 Hz (Franco et al.)."""
    cutter = MillingProcess(
        2, 0.08, pi / 4, 1889.2e6, 806.1 / 1889.2, 291 / 1889.2, 0.0, pi, 1e-4, kte=63.12e3, kre=113.7e3
    )
    _no_worse(cutter, radial_depth, SweepDemand((20.0, 52.0), 2e-3, 0.25, 1e-9, 1e-9))


def test_demands_that_cannot_be_met_are_refused() -> None:
    with pytest.raises(InputError, match="axial"):
        plan_sweeps(replace(CUTTER, kac=0.0), DEMAND)
    with pytest.raises(InputError, match="narrower widths"):
        plan_sweeps(CUTTER, replace(DEMAND, widths=(pi,)))
    with pytest.raises(InputError, match="empty"):
        replace(DEMAND, band=(20.0, 10.0))
    with pytest.raises(InputError, match="depth"):
        replace(DEMAND, depth=-1.0)
