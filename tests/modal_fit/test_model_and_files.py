"""Modal models: invariants, files, shape measures, uncertainty."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from millfrf.core import FileFormatError, InputError, write_json
from modal_fit import (
    BandSource,
    ModalModel,
    Residuals,
    derived_covariance,
    read_modal_model,
    write_modal_model,
)
from modal_fit.shapes import modal_assurance, phase_collinearity, phase_deviation, reciprocity_residual
from replay_data import table_one_model

ERRORS = dict.fromkeys(("noise", "points", "band", "terms"), [[0.1, None]] * 2)


def random_model(seed: int, n_modes: int, residuals: bool) -> ModalModel:
    rng = np.random.default_rng(seed)

    def complex_normal(*shape: int) -> np.ndarray:
        return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)

    poles = -rng.uniform(0.1, 5, n_modes) + 1j * rng.uniform(10, 500, n_modes)
    rest = Residuals(
        rng.standard_normal((2, 3)), rng.standard_normal((2, 3)), complex_normal(1) - 5 + 900j, complex_normal(1, 2, 3)
    )
    size = 2 * n_modes * 6
    root = rng.standard_normal((size, size))
    return ModalModel(
        poles,
        complex_normal(n_modes, 2),
        complex_normal(n_modes, 3),
        ("H:+X", "H:-Y"),
        ("T:+X", "T:+Y", "T:+Z"),
        residuals=rest if residuals else None,
        covariance=root @ root.T,
    )


@given(seed=st.integers(0, 1000), n_modes=st.integers(1, 4), residuals=st.booleans())
def test_a_model_survives_its_file(
    tmp_path_factory: pytest.TempPathFactory, seed: int, n_modes: int, residuals: bool
) -> None:
    path = tmp_path_factory.mktemp("m") / "model.json"
    model = random_model(seed, n_modes, residuals)
    write_modal_model(path, model)
    again = read_modal_model(path)
    f = np.linspace(1, 100, 30)
    np.testing.assert_array_equal(again.receptance(f), model.receptance(f))
    np.testing.assert_array_equal(again.covariance, model.covariance)
    assert (again.responses, again.excitations) == (model.responses, model.excitations)


def test_a_file_keeps_the_source_of_each_band_and_the_unmeasured_flexibility(tmp_path: Path) -> None:
    model = replace(
        table_one_model(),
        sources=(BandSource(5, 15, "in-process"), BandSource(15, 80, "tapped")),
        unmeasured_flexibility=2e-8,
    )
    write_modal_model(tmp_path / "model.json", model)
    again = read_modal_model(tmp_path / "model.json")
    assert (again.sources, again.unmeasured_flexibility) == (model.sources, 2e-8)
    expected = ["in-process" if f <= 15 else "tapped" for f in model.natural_frequencies]
    assert list(again.mode_sources) == expected
    with pytest.raises(InputError, match="overlap"):
        replace(model, sources=(BandSource(5, 15, "in-process"), BandSource(14, 80, "tapped")))


@given(seed=st.integers(0, 1000))
def test_receptance_is_the_transform_of_a_real_impulse_response(seed: int) -> None:
    model = random_model(seed, 3, residuals=True)
    f = np.array([3.0, 20.0, 77.0])
    np.testing.assert_allclose(model.receptance(-f), model.receptance(f).conj(), rtol=1e-12)


def test_table_1_peaks_as_evaluated_independently() -> None:
    f = np.linspace(10, 30, 4001)
    size = np.abs(table_one_model().receptance(f))
    published = [(4.28e-6, 17.8), (1.52e-5, 16.95), (1.59e-6, 17.0)]
    for index, (peak, at) in enumerate(published):
        last_digit = 10 ** (np.floor(np.log10(peak)) - 2)
        assert size[:, index, index].max() == pytest.approx(peak, abs=last_digit)
        assert f[size[:, index, index].argmax()] == pytest.approx(at, abs=0.06)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": "other"}, "'other'"),
        ({"format_version": 7}, "format_version 7"),
        ({"poles_rad_per_s": None}, "poles_rad_per_s"),
        ({"right": [[[1.0, 0.0]]]}, "a field does not have the shape"),
        ({"responses": [1e308, 0.0, 0.0]}, "degree of freedom 1e\\+308 is no text"),
        ({"left": "text"}, 'field left holds "text", which is no number'),
        ({"right": [[[True, 0.0], [0.0, 0.1], [1.0, 0.0]]] * 2}, "field right holds true, which is no number"),
        ({"poles_rad_per_s": [[-1.0, 100.0], [-1.0]]}, "field poles_rad_per_s must hold pairs"),
        ({"delay_s": "0.5"}, 'field delay_s holds "0.5", which is no number'),
        ({"band_hz": [True, 80.0]}, "field band_hz holds true, which is no number"),
        ({"covariance": [[1.0, 0.0], [0.0, 1.0]]}, r"covariance has shape \(2, 2\), expected \(28, 28\)"),
        (
            {"mode_errors": {**ERRORS, "terms": [[0.1, 0.001]]}},
            r"errors 'terms' have shape \(1, 2\), expected \(2, 2\)",
        ),
        ({"poles_rad_per_s": [[-1.0, -100.0], [-1.0, 100.0]]}, "negative imaginary part"),
    ],
)
def test_unusable_files_are_refused_in_one_line(tmp_path: Path, change: dict[str, object], message: str) -> None:
    path = tmp_path / "model.json"
    write_modal_model(path, table_one_model())
    write_json(path, {**json.loads(path.read_text()), **change})
    with pytest.raises(FileFormatError, match=message) as caught:
        read_modal_model(path)
    assert "\n" not in str(caught.value)


def test_a_missing_field_is_named(tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    write_modal_model(path, table_one_model())
    content = json.loads(path.read_text())
    del content["right"]
    write_json(path, content)
    with pytest.raises(FileFormatError, match="lacks the field right"):
        read_modal_model(path)


def test_a_lower_residual_is_infinite_at_zero() -> None:
    with pytest.raises(InputError, match="infinite at 0 Hz"):
        random_model(1, 1, residuals=True).receptance(np.array([0.0]))


@given(seed=st.integers(0, 500), factor=st.complex_numbers(min_magnitude=0.1, max_magnitude=10))
def test_shape_measures_do_not_depend_on_scaling(seed: int, factor: complex) -> None:
    vectors = random_model(seed, 3, residuals=False).left
    scaled = vectors * factor
    np.testing.assert_allclose(modal_assurance(vectors, scaled), modal_assurance(vectors, vectors), atol=1e-10)
    np.testing.assert_allclose(np.diag(modal_assurance(vectors, scaled)), 1.0)
    np.testing.assert_allclose(phase_collinearity(scaled), phase_collinearity(vectors), atol=1e-8)
    np.testing.assert_allclose(phase_deviation(scaled), phase_deviation(vectors), atol=1e-7)


def test_shape_measures_of_known_vectors() -> None:
    real, circular = np.array([[1.0, -2.0, 0.5]]) * np.exp(0.7j), np.array([[1.0, 1j]])
    assert phase_collinearity(real)[0] == pytest.approx(1.0)
    assert phase_deviation(real)[0] == pytest.approx(0.0, abs=1e-9)
    assert phase_collinearity(circular)[0] == pytest.approx(0.0, abs=1e-12)
    symmetric = ModalModel(np.array([-1 + 9j]), real[:, :2], real[:, :2], ("T:+X", "T:+Y"), ("T:+X", "T:+Y"))
    assert reciprocity_residual(symmetric)[0] == pytest.approx(0.0, abs=1e-12)
    assert reciprocity_residual(table_one_model()).max() > 0.05


def test_derived_covariance_is_the_delta_rule() -> None:
    """|p| / 2 pi of one pole: variance (a^2 var a + b^2 var b) / |p|^2 / 4 pi^2."""
    pole = -3.0 + 100j
    covariance = np.zeros((6, 6))
    covariance[0, 0], covariance[1, 1] = 0.04, 0.09
    unity = np.ones((1, 1), dtype=complex)
    model = ModalModel(np.array([pole]), unity, unity, ("T:+X",), ("T:+X",), covariance=covariance)
    errors = model.standard_errors()
    assert errors is not None
    expected = np.sqrt(9 * 0.04 + 1e4 * 0.09) / abs(pole) / (2 * np.pi)
    assert errors[0][0] == pytest.approx(expected, rel=1e-6)
    # zeta = -a / |p|: d/da = -b^2 / |p|^3, d/db = a b / |p|^3
    zeta = np.sqrt((1e4 * 0.2) ** 2 + (300 * 0.3) ** 2) / abs(pole) ** 3
    assert errors[1][0] == pytest.approx(zeta, rel=1e-6)
    assert derived_covariance(table_one_model(), np.ravel) is None


def test_derived_covariance_of_a_pole_with_an_error_above_itself_has_physical_steps() -> None:
    unity = np.ones((1, 1), dtype=complex)
    covariance = np.diag([200.0**2, 5000.0**2, 0, 0, 0, 0])
    model = ModalModel(np.array([-10.0 + 100j]), unity, unity, ("T:+X",), ("T:+X",), covariance=covariance)
    frequency = derived_covariance(model, lambda changed: changed.natural_frequencies)
    assert frequency is not None
    assert frequency[0, 0] == pytest.approx((100 * 5000 / abs(model.poles[0]) / 2 / np.pi) ** 2, rel=0.02)
