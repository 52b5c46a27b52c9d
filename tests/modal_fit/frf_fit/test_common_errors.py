"""Errors that all lines of an FRF share: kept in files, converted, and carried to modes and limits."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimation import Frf, FrfCovariance, read_frf, to_receptance, write_frf
from millfrf.core import Complex, InputError
from millfrf.stability import certified_lobes, depth_errors
from modal_fit import calibrate_to_tip, fit_polyreference
from replay_data import ACETAL_CUTTER, table_one_model

AXIS = np.arange(20.0, 400.0, 0.5)
POLE, RESIDUE = -12 + 2j * np.pi * 170, -2e-4j


def values_at(pole: complex) -> Complex:
    """Receptance of two modes, the first with this pole."""
    s, other = 2j * np.pi * AXIS, -20 + 2j * np.pi * 290
    modes = ((pole, RESIDUE), (other, 0.4 * RESIDUE))
    total = sum(r / (s - p) + np.conj(r) / (s - np.conj(p)) for p, r in modes)
    return np.asarray(total)[:, None, None]


def frf_with(error: Complex | None, *, noisy_resonance: float = 1.0) -> Frf:
    """An FRF with small noise, larger near the first resonance by a factor, and one error that all lines share."""
    rng, place = np.random.default_rng(0), ("TCP:+X",)
    noise = 1e-10 * np.where(np.abs(AXIS - 170) < 40, noisy_resonance, 1.0)[:, None, None]
    parts = rng.standard_normal((2, len(AXIS), 1, 1)) * noise / np.sqrt(2)
    ones = np.ones((len(AXIS), 1, 1), dtype=complex)
    return Frf(
        AXIS, values_at(POLE) + parts[0] + 1j * parts[1], place, place, "receptance", "m/N", AXIS > 0,
        covariance=FrfCovariance(noise**2 * ones, ones), band=(20.0, 399.0), common_errors=error,
    )  # fmt: skip


# standard errors of natural frequency and damping: half a hertz, and with a shift that is wider than the resonance,
# also where the lines that show it weigh little
@pytest.mark.parametrize(("shift", "noisy"), [(-0.4 + 3j, 1.0), (-1 + 60j, 1.0), (-1 + 60j, 1e3)])
def test_a_common_error_of_a_pole_becomes_its_standard_error(shift: complex, noisy: float) -> None:
    step = 1e-6
    tangent = (values_at(POLE + step * shift) - values_at(POLE - step * shift)) / (2 * step)
    alone = fit_polyreference(frf_with(None, noisy_resonance=noisy), (25.0, 390.0)).model
    model = fit_polyreference(frf_with(tangent[None], noisy_resonance=noisy), (25.0, 390.0)).model
    assert model.covariance is not None
    assert alone.covariance is not None
    added = model.covariance - alone.covariance
    n = len(model.poles)
    first = int(np.argmin(np.abs(model.poles - POLE)))
    assert added[first, first] == pytest.approx(shift.real**2, rel=0.02, abs=1e-3 * abs(shift) ** 2)
    assert added[n + first, n + first] == pytest.approx(shift.imag**2, rel=0.02)
    errors = model.standard_errors()
    assert errors is not None
    assert errors[0][first] == pytest.approx(abs(shift.imag) / (2 * np.pi), rel=0.05)
    assert errors[0][1 - first] < 0.02 * errors[0][first]


def test_files_and_conversions_keep_common_errors(tmp_path: Path) -> None:
    error = 1e-3 * values_at(POLE)[None]
    write_frf(tmp_path / "frf.h5", frf_with(error))
    kept = read_frf(tmp_path / "frf.h5")
    assert kept.common_errors is not None
    assert np.array_equal(kept.common_errors, error)
    square = (-((2 * np.pi * AXIS) ** 2))[:, None, None]
    as_measured = replace(
        kept, values=kept.values * square, quantity="accelerance", unit="m/s^2/N", common_errors=error * square
    )
    assert np.allclose(to_receptance(as_measured).common_errors, error)
    variance, total = kept.entry_variance(), kept.total_variance()
    assert variance is not None
    assert total is not None
    assert np.allclose(total - variance, np.abs(error[0]) ** 2)
    with pytest.raises(InputError, match="common errors has shape"):
        replace(kept, common_errors=error[:, :-1])


def test_a_common_error_shifts_all_lines_of_a_limit_together() -> None:
    model = table_one_model()
    axis = np.arange(1.0, 400.0, 0.25)
    frf = model.frf(axis)
    shape = (len(axis), len(model.responses), len(model.excitations))
    none = FrfCovariance(
        np.zeros((shape[0], shape[1], shape[1]), complex), np.zeros((shape[0], shape[2], shape[2]), complex)
    )
    error = 0.01 * frf.values
    speeds = np.array([700.0, 1150.0]) * np.pi / 30
    stated = replace(frf, covariance=none, common_errors=error[None])
    lobes = certified_lobes(stated, ACETAL_CUTTER, speeds, 0.05)
    errors = depth_errors(stated, ACETAL_CUTTER, lobes)
    known = np.isfinite(errors)
    assert known.any()
    # a receptance that is larger by one per cent at all lines lowers the limits by one per cent
    assert errors[known] == pytest.approx(0.01 * lobes.depth_limits[known], rel=0.05)


def test_a_computed_frf_is_no_hammer_test() -> None:
    frf = frf_with(1e-3 * values_at(POLE)[None])
    with pytest.raises(InputError, match="computed, not tapped"):
        calibrate_to_tip(fit_polyreference(frf, (25.0, 390.0)).model, frf, frf)
