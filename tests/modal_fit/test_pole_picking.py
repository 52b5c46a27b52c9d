"""Picked poles: exactly these, with the right vectors; files that name them; what cannot be picked."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimation import Frf
from millfrf.core import FileFormatError, InputError
from modal_fit import (
    ModalModel,
    candidate_groups,
    fit_picked_poles,
    fit_polyreference,
    read_picked_poles,
    write_pole_candidates,
)

AXIS = np.arange(5.0, 80.0, 0.1)
BAND = (8.0, 70.0)
DOFS = tuple(f"{k}:+Z" for k in range(6))


def truth(quantity: str = "receptance", unit: str = "m/N") -> ModalModel:
    omega, zeta = 2 * np.pi * np.array([14.0, 31.0, 31.6]), np.array([0.01, 0.008, 0.012])
    poles = omega * (-zeta + 1j * np.sqrt(1 - zeta**2))
    rng = np.random.default_rng(1)
    shapes = rng.uniform(0.3, 1, (3, 6)) * rng.choice([-1, 1], (3, 6)) * np.exp(1j * rng.uniform(-0.3, 0.3, (3, 6)))
    left = shapes[:, :2] / (2j * poles.imag[:, None])
    return ModalModel(poles, shapes, left, DOFS, DOFS[:2], quantity, unit)


def measured(noise: float = 0.0) -> Frf:
    frf = truth().frf(AXIS)
    draws = np.random.default_rng(4).standard_normal((2, *frf.values.shape))
    size = np.sqrt(np.mean(np.abs(frf.values) ** 2, axis=0))
    return replace(frf, values=frf.values + noise * size * (draws[0] + 1j * draws[1]), band=None)


def residues(model: ModalModel) -> np.ndarray:
    return np.einsum("rp,rq->rpq", model.right, model.left)


@pytest.mark.parametrize("turned", [False, True])
def test_kept_poles_stay_and_their_residues_are_the_truth(turned: bool) -> None:
    frf, known = measured(), truth()
    if turned:
        frf = Frf(AXIS, frf.values.transpose(0, 2, 1), DOFS[:2], DOFS, "receptance", "m/N", frf.valid)
    fit = fit_picked_poles(frf, BAND, known.poles[[2, 0, 1]])
    assert fit.status == "picked poles, kept"
    np.testing.assert_array_equal(fit.model.poles, known.poles)
    assert fit.model.covariance is None
    assert fit.model.errors is None
    expected = residues(known).transpose(0, 2, 1) if turned else residues(known)
    np.testing.assert_allclose(residues(fit.model), expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max())
    assert fit.relative_error.max() < 1e-6
    assert len(fit.chart.poles) > 20


def test_refinement_finds_the_truth_from_poles_picked_by_eye() -> None:
    known = truth()
    picked = known.poles * (1 + 0.004 * np.array([1, -1, 1j]))
    fit = fit_picked_poles(measured(0.01), BAND, picked, refine=True)
    assert fit.status == "picked poles, refined"
    np.testing.assert_allclose(fit.model.natural_frequencies, known.natural_frequencies, rtol=2e-4)
    np.testing.assert_allclose(fit.model.damping_ratios, known.damping_ratios, rtol=0.02)
    assert fit.model.errors is not None
    off = np.abs(fit.model.natural_frequencies - known.natural_frequencies) / fit.model.errors.frequency
    assert off.max() < 4
    kept = fit_picked_poles(measured(0.01), BAND, picked)
    assert kept.relative_error.max() > 3 * fit.relative_error.max()


def test_a_mode_that_was_not_picked_is_not_added() -> None:
    fit = fit_picked_poles(measured(), BAND, truth().poles[:2], refine=True)
    assert len(fit.model.poles) == 2
    assert fit.relative_error.max() > 0.1


def test_a_pole_that_no_mode_holds_is_told_when_it_wanders() -> None:
    astray = np.append(truth().poles[1:], 2 * np.pi * 50 * (-0.002 + 1j))
    fit = fit_picked_poles(measured(0.001), BAND, astray, refine=True)
    assert any("picked at 50 Hz away" in warning for warning in fit.warnings)


def test_the_delay_of_a_transfer_is_found_beside_the_poles() -> None:
    known = replace(truth("transfer", "m/V"), delay=2e-3)
    frf = replace(known.frf(AXIS), band=None)
    fit = fit_picked_poles(frf, BAND, known.poles)
    assert fit.model.delay == pytest.approx(2e-3, rel=0.02)
    assert fit.relative_error.max() < 0.02


def pole(f: float, zeta: float) -> complex:
    return 2 * np.pi * f * (-zeta + 1j * np.sqrt(1 - zeta**2))


@pytest.mark.parametrize(
    ("picked", "words"),
    [
        ([], "no pole was picked"),
        ([pole(20, 0.01), pole(75, 0.01)], "pole 2 at 75 Hz lies outside the band 8 to 70 Hz"),
        ([pole(20, 0.7)], "pole 1 at 20 Hz has a damping ratio of 0.7"),
        ([-pole(20, 0.01).conjugate()], "damping ratio of -0.01"),
        ([pole(20, 0.01), pole(40, 0.01), pole(20.001, 0.01)], "poles 1 and 3 are the same"),
        ([pole(f, 0.01) for f in np.linspace(9, 69, 400)], "400 poles are too many for 620 lines"),
    ],
)
def test_what_cannot_be_picked_is_refused(picked: list[complex], words: str) -> None:
    with pytest.raises(InputError, match=words):
        fit_picked_poles(measured(), BAND, np.array(picked, dtype=complex))


def test_candidates_are_a_choice_and_offer_what_was_dropped(tmp_path: Path) -> None:
    fit = fit_polyreference(measured(0.01), BAND)
    groups = candidate_groups(fit)
    assert [each.frequency for each in groups] == sorted(each.frequency for each in groups)
    assert [each.taken for each in groups].count(True) == 3
    assert all(bool(each.reason) is not each.taken for each in groups)
    assert min(each.n_orders for each in groups if each.taken) >= 3
    file = tmp_path / "candidates.json"
    write_pole_candidates(file, groups, BAND, {"orders": []}, {})
    np.testing.assert_allclose(read_picked_poles(file), fit.model.poles, rtol=1e-12)
    dropped = next(each for each in groups if not each.taken)
    text = f'candidates = "candidates.json"\n[[poles]]\ngroup = {dropped.number}\n'
    (tmp_path / "poles.toml").write_text(text + "[[poles]]\nfrequency_hz = 31\ndamping_ratio = 0.01\n")
    first, second = read_picked_poles(tmp_path / "poles.toml")
    assert first == pytest.approx(dropped.pole)
    assert (abs(second) / (2 * np.pi), -second.real / abs(second)) == pytest.approx((31.0, 0.01))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "[[poles]]\nfrequency_hz = 20\n",
            r"poles\[1\]: give frequency_hz and damping_ratio \(a ratio, not",
        ),
        ("[[poles]]\nfrequency_hz = 20\ndamping_ratio = 1.2\n", r"poles\[1\].damping_ratio must be below 0.5, not 1.2"),
        ("[[poles]]\nfrequency = 20\n", r"frequency is not a known key; did you mean frequency_hz\?"),
        ("[[poles]]\ngroup = 3\n", r"poles\[1\] names group 3, but no groups are offered"),
        ("[[poles]]\ngroup = 3\ndamping_ratio = 0.1\n", "names the pole already"),
        ("poles = []\n", "must have more entries"),
        ('candidates = "none.json"\n[[poles]]\ngroup = 3\n', "cannot read poles .*none.json"),
    ],
)
def test_files_that_name_no_pole_are_refused(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "poles.toml").write_text(text)
    with pytest.raises(InputError, match=words):
        read_picked_poles(tmp_path / "poles.toml")


def test_another_format_is_refused(tmp_path: Path) -> None:
    (tmp_path / "model.json").write_text(json.dumps({"format": "millfrf.modal_model"}))
    with pytest.raises(FileFormatError, match="holds no poles"):
        read_picked_poles(tmp_path / "model.json")
    (tmp_path / "poles.txt").write_text("18.8 0.3\n")
    with pytest.raises(FileFormatError, match="neither TOML nor JSON"):
        read_picked_poles(tmp_path / "poles.txt")
