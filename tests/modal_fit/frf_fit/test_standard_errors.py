"""Standard errors of frequencies and damping ratios: linearised by hand and by differences, they agree."""

from dataclasses import replace

import numpy as np

from modal_fit import ModalModel, derived_covariance


def test_the_linearisation_agrees_with_differences_of_the_whole_model() -> None:
    rng = np.random.default_rng(3)
    poles = np.array([-3.0 + 105.0j, -10.0 + 330.0j])
    right, left = (rng.normal(size=(2, n)) + 1j * rng.normal(size=(2, n)) for n in (3, 2))
    labels = ("A:+X", "A:+Y", "A:+Z")
    size = 2 * (2 + 6 + 4)
    root = 1e-3 * rng.normal(size=(size, size))
    model = ModalModel(poles, right, left, labels, labels[:2], covariance=root @ root.T)
    by_differences = derived_covariance(
        model, lambda one: np.concatenate([one.natural_frequencies, one.damping_ratios])
    )
    assert by_differences is not None
    errors = model.standard_errors()
    assert errors is not None
    np.testing.assert_allclose(np.concatenate(errors), np.sqrt(np.diag(by_differences)), rtol=1e-5)
    assert replace(model, covariance=None).standard_errors() is None
