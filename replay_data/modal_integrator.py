"""Exact integration of a modal model: exponentials, and force taken as linear between two instants."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation import DERIVATIVE_ORDERS
from millfrf.core import TIP, InputError
from millfrf.core.compilation import compiled
from modal_fit import ModalModel

from .robot_structure import select


class Dynamics(NamedTuple):
    """One step of ``q' = pole q + left F`` with F linear over the step h, at the tool tip.

    ``q(t+h) = growth q + before (left F(t)) + after (left F(t+h))``, ``X = 2 Re(right^T q)``.
    With z = pole h: growth = exp(z), phi1 = (exp(z) - 1)/z, phi2 = (phi1 - 1)/z, before = h (phi1 - phi2),
    after = h phi2 (Hochbruck & Ostermann, Exponential integrators, Acta Numerica 2010, section 2).
    """

    modes: NDArray[np.float64]
    """(n_modes, 20): growth, before left[0..2], after left[0..2], 2 right[0..2], each as real and imaginary part."""
    immediate: NDArray[np.float64]
    """(3, 3), m/N: what the force at the end of a step adds to the tip's displacement at that instant."""


def discretise(structure: ModalModel, step: float) -> Dynamics:
    """Coefficients of one step of length ``step`` (s) for forces and motion at the tool tip.

    Raises
    ------
    InputError
        Not a receptance, no tool tip, residuals, added physics, or a mode that grows without cutting.
    """
    require_simulable(structure)
    tip = select(structure, TIP, TIP)
    z = tip.poles * step
    growth = np.exp(z)
    first = np.expm1(z) / z
    second = (first - 1) / z
    after = step * second
    immediate = 2 * np.real(np.einsum("rp,r,rq->pq", tip.right, after, tip.left))
    before_left = (step * (first - second))[:, None] * tip.left
    columns = np.hstack([growth[:, None], before_left, after[:, None] * tip.left, 2 * tip.right])
    return Dynamics(np.ascontiguousarray(columns).view(np.float64), immediate)


def require_simulable(structure: ModalModel) -> None:
    """Refuse, in one line, what the integrator cannot represent.

    Raises
    ------
    InputError
        See :func:`discretise`.
    """
    if structure.quantity != "receptance":
        raise InputError(f"the structure gives {structure.quantity}; simulation needs a receptance model in m/N")
    if structure.physics:
        names = ", ".join(str(term.get("name", "?")) for term in structure.physics)
        raise InputError(f"the structure has added physics ({names}); the cell simulates linear modes only")
    if len(structure.poles) and structure.poles.real.max() >= 0:
        raise InputError(
            f"the structure's pole {structure.poles[structure.poles.real.argmax()]:.4g} is not damped; "
            "give every pole a negative real part"
        )


@compiled(
    "(float64[:,::1], float64[:,::1], float64[::1], float64[::1], float64[:,::1])",
    "(float64[:,:], float64[:,::1], float64[:], float64[::1], float64[:,::1])",
)
def respond(
    force: NDArray[np.float64],
    modes: NDArray[np.float64],
    last_force: NDArray[np.float64],
    modal: NDArray[np.float64],
    history: NDArray[np.float64],
) -> None:
    """March through a given force (n, 3); fill ``history`` (n, 2 n_modes), update ``last_force`` and ``modal``."""
    position = np.zeros(3)
    for i in range(force.shape[0]):
        coast(modes, last_force, modal, position)
        take_force(modes, force[i], last_force, modal, history[i])


@compiled
def coast(
    modes: NDArray[np.float64],
    last_force: NDArray[np.float64],
    modal: NDArray[np.float64],
    position: NDArray[np.float64],
) -> None:
    """Advance ``modal`` (2 n_modes,) by a step with the last force alone; ``position``: the tip's displacement then."""
    x, y, z = 0.0, 0.0, 0.0
    fx, fy, fz = last_force[0], last_force[1], last_force[2]
    for r in range(modes.shape[0]):
        c = modes[r]
        old_real, old_imag = modal[2 * r], modal[2 * r + 1]
        real = c[0] * old_real - c[1] * old_imag + c[2] * fx + c[4] * fy + c[6] * fz
        imag = c[0] * old_imag + c[1] * old_real + c[3] * fx + c[5] * fy + c[7] * fz
        x += c[14] * real - c[15] * imag
        y += c[16] * real - c[17] * imag
        z += c[18] * real - c[19] * imag
        modal[2 * r], modal[2 * r + 1] = real, imag
    position[0], position[1], position[2] = x, y, z


@compiled
def take_force(
    modes: NDArray[np.float64],
    force: NDArray[np.float64],
    last_force: NDArray[np.float64],
    modal: NDArray[np.float64],
    history: NDArray[np.float64],
) -> None:
    """Let the force at the end of the step act on ``modal``; note both."""
    fx, fy, fz = force[0], force[1], force[2]
    for r in range(modes.shape[0]):
        c = modes[r]
        modal[2 * r] += c[8] * fx + c[10] * fy + c[12] * fz
        modal[2 * r + 1] += c[9] * fx + c[11] * fy + c[13] * fz
        history[2 * r], history[2 * r + 1] = modal[2 * r], modal[2 * r + 1]
    last_force[0], last_force[1], last_force[2] = fx, fy, fz


class ResponseMap:
    """Motion and force channels from modal coordinates and force, one instant behind its input.

    Displacement ``2 Re(R q)``; velocity ``2 Re(R pole q) + D F``; acceleration ``2 Re(R pole^2 q) + 2 Re(R pole L) F
    + D F'`` with ``D = sum 2 Re(right left^T)``. In a mechanical structure D = 0; for a model in which it is not (one
    cut from a wider band) F' is the central difference, which is why the output lags one instant.

    Parameters
    ----------
    structure
        Modal model; its responses are looked up by degree of freedom.
    quantities
        Quantity of each channel: ``force``, ``displacement``, ``velocity`` or ``acceleration``.
    places
        Degree of freedom of each channel.
    step : s
        Time between two instants.

    Raises
    ------
    InputError
        A quantity or place that the structure does not have.
    """

    def __init__(self, structure: ModalModel, quantities: Sequence[str], places: Sequence[str], step: float) -> None:
        n_modes, n_channels = len(structure.poles), len(places)
        motion = np.zeros((n_channels, n_modes), dtype=complex)
        self._direct = np.zeros((n_channels, 3))
        self._rate = np.zeros((n_channels, 3))
        for row, (quantity, place) in enumerate(zip(quantities, places, strict=True)):
            if quantity == "force":
                self._direct[row] = _force_direction(place)
                continue
            if quantity not in DERIVATIVE_ORDERS:
                raise InputError(
                    f"a sensor of {quantity} cannot be simulated; use force, {', '.join(DERIVATIVE_ORDERS)}"
                )
            point = select(structure, (place,), TIP)
            order = DERIVATIVE_ORDERS[quantity]
            motion[row] = point.right[:, 0] * point.poles**order
            terms = [
                2 * np.real(np.einsum("r,r,rq->q", point.right[:, 0], point.poles**k, point.left)) for k in range(order)
            ]
            self._direct[row] += terms[-1] if order else 0.0
            if order == 2 and np.abs(terms[0]).max() > 1e-9 * np.abs(point.right).max() * np.abs(point.left).max():
                self._rate[row] = terms[0] / (2 * step)
        self._motion = np.ascontiguousarray(_as_real(motion).T)
        self._history = np.zeros((1, 2 * n_modes))
        self._force = np.zeros((2, 3))

    def __call__(self, history: NDArray[np.float64], force: NDArray[np.float64]) -> NDArray[np.float64]:
        """Channels (n, n_channels) at the instants one earlier than those given, (n, 2 n_modes) and (n, 3)."""
        modal = np.concatenate([self._history, history])
        forces = np.concatenate([self._force, force])
        self._history, self._force = modal[-1:].copy(), forces[-2:].copy()
        output = modal[:-1] @ self._motion + forces[1:-1] @ self._direct.T
        if self._rate.any():
            output += (forces[2:] - forces[:-2]) @ self._rate.T
        return np.asarray(output)


def _as_real(complex_rows: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Rows w such that ``2 Re(c . q) = w . [Re q_1, Im q_1, ...]``."""
    interleaved = np.stack([2 * complex_rows.real, -2 * complex_rows.imag], axis=-1)
    return np.asarray(interleaved.reshape(len(complex_rows), -1))


def _force_direction(place: str) -> NDArray[np.float64]:
    if place not in TIP:
        raise InputError(f"force at {place} cannot be simulated; forces act at {', '.join(TIP)}")
    return np.asarray(np.eye(3)[TIP.index(place)])
