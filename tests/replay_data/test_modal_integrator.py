"""The integrator against the modal model's own FRF, and its order."""

import numpy as np
import pytest
from numpy.typing import NDArray

from millfrf.core import InputError
from modal_fit import ModalModel
from replay_data import default_structure, table_one_model
from replay_data.modal_integrator import ResponseMap, discretise, require_simulable, respond

PLACES = ("TCP:+X", "TCP:+Y", "TCP:+Z")


def steady_error(structure: ModalModel, quantity: str, frequency: float, steps_per_period: int) -> float:
    """Largest departure from ``Re(H F exp(i w t))`` in the steady state, relative to its amplitude."""
    step = 1 / (frequency * steps_per_period)
    n_periods = int(1.0 * frequency)
    times = np.arange(n_periods * steps_per_period) * step
    amplitude = np.array([1.0, -0.5 + 0.3j, 0.7j])
    s = 2j * np.pi * frequency
    factor = {"displacement": 1, "velocity": s, "acceleration": s**2}[quantity]
    expected = factor * structure.receptance(np.array([frequency]))[0, :3] @ amplitude
    # Start on the steady state, so that there is no transient to wait for.
    start = (structure.left @ amplitude) / (s - structure.poles)
    other = (structure.left @ amplitude.conj()) / (s.conjugate() - structure.poles)
    turn = np.exp(-s * step)
    modal = np.ascontiguousarray(0.5 * (start * turn + other * turn.conjugate())).view(float).copy()
    force = np.real(amplitude * np.exp(s * times)[:, None])
    history = np.empty((len(times), len(modal)))
    respond(force, discretise(structure, step).modes, np.real(amplitude * turn), modal, history)
    motion = ResponseMap(structure, [quantity] * 3, PLACES, step)(history, force)
    truth = np.real(expected * np.exp(s * (times - step))[:, None])
    settled = len(times) // 2
    return float((np.abs(motion - truth)[settled:] / np.abs(expected)).max())


@pytest.mark.parametrize("quantity", ["displacement", "velocity", "acceleration"])
@pytest.mark.parametrize("structure", [default_structure(), table_one_model()], ids=["mechanical", "feed-through"])
def test_the_response_is_that_of_the_frf_to_second_order(structure: ModalModel, quantity: str) -> None:
    """Also for Table 1 alone, in which acceleration depends on the rate of force."""
    coarse, fine = (steady_error(structure, quantity, 20.0, steps) for steps in (64, 128))
    assert fine < 2e-3
    assert np.log2(coarse / fine) == pytest.approx(2.0, abs=0.1)


def test_at_the_rate_of_the_simulated_cell_the_error_is_a_hundredth_of_one_percent_noise() -> None:
    """20 Hz in steps of 1/20480 s."""
    assert steady_error(default_structure(), "acceleration", 20.0, 1024) < 1e-4


def test_linear_force_is_integrated_exactly() -> None:
    """A ramp from rest: ``q(t) = L (exp(p t) - 1 - p t) / p^2``, whatever the step."""
    structure, rate = table_one_model(), np.array([100.0, -30.0, 50.0])
    times = np.arange(1, 6) * 0.05
    modal = np.zeros(4)
    history = np.empty((5, 4))
    respond(times[:, None] * rate, discretise(structure, 0.05).modes, np.zeros(3), modal, history)
    poles = structure.poles
    exact = (structure.left @ rate) * (np.exp(poles * times[:, None]) - 1 - poles * times[:, None]) / poles**2
    np.testing.assert_allclose(history.view(complex), exact, rtol=1e-12)


def changed(**changes: object) -> ModalModel:
    lone = table_one_model()
    fields: dict[str, object] = {"poles": lone.poles, "right": lone.right, "left": lone.left}
    fields |= {"responses": lone.responses, "excitations": lone.excitations} | changes
    return ModalModel(**fields)  # type: ignore[arg-type]


def undamped() -> NDArray[np.complex128]:
    return np.asarray(1j * table_one_model().poles.imag)


@pytest.mark.parametrize(
    ("structure", "message"),
    [
        (changed(quantity="transfer", unit="m/s^2/N"), "simulation needs a receptance model"),
        (changed(physics=({"name": "backlash"},)), r"added physics \(backlash\)"),
        (changed(poles=undamped()), "is not damped"),
    ],
)
def test_what_cannot_be_simulated_is_refused_by_name(structure: ModalModel, message: str) -> None:
    with pytest.raises(InputError, match=message):
        require_simulable(structure)
