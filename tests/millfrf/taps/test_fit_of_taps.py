"""Taps through the project's own fit: the windows' damping is out of the result, and the bars hold the truth."""

from pathlib import Path

import numpy as np
import pytest
from simulated_taps import Bench, Hits, plate, write_taps

from millfrf.steps.tap import tap
from modal_fit import fit_polyreference

PLACES = ("P1:+Z", "P2:+Z")
SEEDS = 4


@pytest.mark.long
@pytest.mark.parametrize(
    ("damping", "windowed"), [((0.02, 0.015, 0.01, 0.012), False), ((2e-3, 1.5e-3, 1e-3, 1.2e-3), True)]
)
def test_dampings_lie_within_the_bars_of_the_fit(tmp_path: Path, damping: tuple[float, ...], windowed: bool) -> None:
    """Three points hit three times each. An exponential window correlates lines, so that bars grow by 2.5."""
    structure, off = plate(damping=damping), []
    for seed in range(SEEDS):
        paths = []
        for number in range(9):
            paths.append(tmp_path / f"t{seed}_{number}.h5")
            bench = Bench(rate=2560.0, seconds=2.2, noise=1e-3, seed=100 * seed + number)
            write_taps(paths[-1], structure, Hits((0.6,), at=f"P{number % 3 + 1}:+Z"), PLACES, bench)
        frf = tap(*paths).frf
        assert (frf.exponential_time_constant is not None) == windowed
        band = (0.6 * structure.frequencies.min(), 1.2 * structure.frequencies.max())
        model = fit_polyreference(frf, band).model
        np.testing.assert_allclose(model.natural_frequencies, structure.frequencies, rtol=2e-5)
        np.testing.assert_allclose(model.damping_ratios, structure.damping, rtol=5e-3)
        assert model.errors is not None
        off += list(np.abs(model.damping_ratios - structure.damping) / model.errors.damping)
    assert np.mean(np.array(off) < 1.96) > 0.78  # 16 numbers: 95 % less three standard deviations
    assert np.median(off) > 0.1  # bars that hold everything would say nothing
