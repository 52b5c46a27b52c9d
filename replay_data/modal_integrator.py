"""Integration of a modal model by exponentials, exact for a force that is linear between two instants."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from estimation import DERIVATIVE_ORDERS
from millfrf.core import TIP, Complex, InputError, Real
from millfrf.core.compilation import compiled
from modal_fit import ModalModel

from .robot_structure import select


class Dynamics(NamedTuple):
    """Coefficients of one step of ``q' = pole q + left F`` at the tool tip, with F linear over the step h.

    ``q(t+h) = growth q + before (left F(t)) + after (left F(t+h))``, ``X = 2 Re(right^T q)``.
    """

    # (n_modes, 20): growth, before left[0..2], after left[0..2], 2 right[0..2], each as real and imaginary part
    modes: Real
    immediate: Real  # (3, 3), m/N: displacement of the tip at an instant due to the force at the same instant


def exponential_weights(poles: Complex, step: float) -> tuple[Complex, Complex, Complex]:
    """Return the factors growth, before and after of :class:`Dynamics`, (n_modes,) each.

    With z = pole h: growth = exp(z), phi1 = (exp(z) - 1)/z, phi2 = (phi1 - 1)/z, before = h (phi1 - phi2),
    after = h phi2 (Hochbruck & Ostermann, Exponential integrators, Acta Numerica 2010, section 2).
    """
    z = poles * step
    phi1 = np.expm1(z) / z
    phi2 = (phi1 - 1) / z
    return np.exp(z), step * (phi1 - phi2), step * phi2


def discretise(structure: ModalModel, step: float) -> Dynamics:
    """Compute the coefficients of one step of length ``step`` (s) for forces and motion at the tool tip.

    Raises
    ------
    InputError
        Not a receptance, no tool tip, residuals, added physics, or a mode that grows without cutting.
    """
    require_simulable(structure)
    tip = select(structure, TIP, TIP)
    growth, before, after = exponential_weights(tip.poles, step)
    immediate = 2 * np.real(np.einsum("rp,r,rq->pq", tip.right, after, tip.left))
    columns = [growth[:, None], before[:, None] * tip.left, after[:, None] * tip.left, 2 * tip.right]
    return Dynamics(np.ascontiguousarray(np.hstack(columns)).view(np.float64), immediate)


def require_simulable(structure: ModalModel) -> None:
    """Raise an InputError for a structure that the integrator cannot represent."""
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
def respond(force: Real, modes: Real, last_force: Real, modal: Real, history: Real) -> None:
    """Integrate the response to a given force (n, 3) and store it in ``history`` (n, 2 n_modes).

    ``last_force`` and ``modal`` are updated.
    """
    position = np.zeros(3)
    for i in range(force.shape[0]):
        step_without_new_force(modes, last_force, modal, position)
        add_new_force(modes, force[i], last_force, modal, history[i])


@compiled
def step_without_new_force(modes: Real, last_force: Real, modal: Real, position: Real) -> None:
    """Advance ``modal`` (2 n_modes,) by a step with the last force only; store the tip's displacement in ``position``.

    The force at the end of the step depends on this displacement, so that it is added afterwards.
    """
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
def add_new_force(modes: Real, force: Real, last_force: Real, modal: Real, history: Real) -> None:
    """Add the effect of the force at the end of the step to ``modal``; store the result in ``history``."""
    fx, fy, fz = force[0], force[1], force[2]
    for r in range(modes.shape[0]):
        c = modes[r]
        modal[2 * r] += c[8] * fx + c[10] * fy + c[12] * fz
        modal[2 * r + 1] += c[9] * fx + c[11] * fy + c[13] * fz
        history[2 * r], history[2 * r + 1] = modal[2 * r], modal[2 * r + 1]
    last_force[0], last_force[1], last_force[2] = fx, fy, fz


class ResponseMap:
    """Compute motion and force channels from modal coordinates and force, one instant behind the input.

    Displacement is ``2 Re(R q)``; velocity ``2 Re(R pole q) + D F``; acceleration
    ``2 Re(R pole^2 q) + 2 Re(R pole L) F + D F'`` with ``D = sum 2 Re(right left^T)``. In a mechanical structure D = 0.
    In a model of a limited band D is not 0; F' is then the central difference, and therefore the output lags one
    instant.

    ``quantities`` (``force``, ``displacement``, ``velocity`` or ``acceleration``) and ``places`` (degrees of freedom)
    have one entry per channel; ``step`` (s) is the time between two instants. An InputError names a quantity or place
    that the structure does not have.
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
            # D of a mechanical structure is zero up to rounding
            if order == 2 and np.abs(terms[0]).max() > 1e-9 * np.abs(point.right).max() * np.abs(point.left).max():
                self._rate[row] = terms[0] / (2 * step)
        # real rows w with 2 Re(c . q) = w . [Re q_1, Im q_1, ...]
        interleaved = np.stack([2 * motion.real, -2 * motion.imag], axis=-1).reshape(n_channels, -1)
        self._motion = np.ascontiguousarray(interleaved.T)
        self._history = np.zeros((1, 2 * n_modes))
        self._force = np.zeros((2, 3))

    def __call__(self, history: Real, force: Real) -> Real:
        """Return the channels (n, n_channels), each one instant before the inputs (n, 2 n_modes) and (n, 3)."""
        modal = np.concatenate([self._history, history])
        forces = np.concatenate([self._force, force])
        self._history, self._force = modal[-1:].copy(), forces[-2:].copy()
        output = modal[:-1] @ self._motion + forces[1:-1] @ self._direct.T
        if self._rate.any():
            output += (forces[2:] - forces[:-2]) @ self._rate.T
        return np.asarray(output)


def _force_direction(place: str) -> Real:
    if place not in TIP:
        raise InputError(f"force at {place} cannot be simulated; forces act at {', '.join(TIP)}")
    return np.asarray(np.eye(3)[TIP.index(place)])
