"""Matrices to modal models: the receptance of the model is the inverse of the dynamic stiffness."""

import numpy as np
import pytest

from millfrf.robot_model.finite_elements.structure import modal_damping_matrix, modal_model, rayleigh_constants

RNG = np.random.default_rng(3)
FREQUENCIES = np.array([0.0, 0.7, 3.0, 9.0, 30.0])
LABELS = ("TCP:+X", "TCP:+Y")


def _structure() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    root = RNG.normal(size=(5, 5))
    mass = np.eye(5) + 0.1 * root @ root.T
    root = RNG.normal(size=(5, 5))
    return mass, 100 * (root @ root.T + np.eye(5)), RNG.normal(size=(2, 5))


def _direct(mass: np.ndarray, damping: np.ndarray, stiffness: np.ndarray, observed: np.ndarray) -> np.ndarray:
    s = 2j * np.pi * FREQUENCIES[:, None, None]
    return np.asarray(observed @ np.linalg.solve(s**2 * mass + s * damping + stiffness, observed.T))


@pytest.mark.parametrize("kind", ["modal", "rayleigh", "dashpots"])
def test_model_is_the_inverse(kind: str) -> None:
    mass, stiffness, observed = _structure()
    root = RNG.normal(size=(5, 5))
    damping = {
        "modal": modal_damping_matrix(mass, stiffness, np.linspace(0.01, 0.3, 5)),
        "rayleigh": 0.3 * mass + 1e-3 * stiffness,
        "dashpots": root @ root.T,
    }[kind]
    model = modal_model(mass, damping, stiffness, observed, LABELS)
    assert model.receptance(FREQUENCIES) == pytest.approx(
        _direct(mass, damping, stiffness, observed), rel=1e-9, abs=1e-12
    )


def test_modal_damping_gives_the_ratios_back() -> None:
    mass, stiffness, observed = _structure()
    ratios = np.array([0.02, 0.01, 0.05, 0.1, 0.03])
    model = modal_model(mass, modal_damping_matrix(mass, stiffness, ratios), stiffness, observed, LABELS)
    assert model.damping_ratios == pytest.approx(ratios, rel=1e-9)


def test_overdamped_and_high_modes_stay_as_static_flexibility() -> None:
    mass, stiffness, observed = _structure()
    damping = 0.1 * mass + 0.1 * stiffness
    model = modal_model(mass, damping, stiffness, observed, LABELS)
    assert 0 < len(model.poles) < 5
    static = observed @ np.linalg.solve(stiffness, observed.T)
    assert model.receptance(np.zeros(1))[0] == pytest.approx(static, rel=1e-9)


def test_rayleigh_constants_of_mousavi() -> None:
    """6.5 % at 5.9 and 8.2 Hz; at 50 Hz the ratio has grown to 0.235."""
    a, b = rayleigh_constants((5.9, 8.2), (0.065, 0.065))
    assert (a, b) == (pytest.approx(2.8027, abs=5e-5), pytest.approx(1.4674e-3, abs=5e-8))
    omega = 2 * np.pi * 50
    assert (a / omega + b * omega) / 2 == pytest.approx(0.235, abs=5e-4)
