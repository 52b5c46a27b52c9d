"""A modal structure marched through given forces, with a joint law and a velocity coupling at the tip."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cutting.compilation import compiled
from modal_fit import ModalModel

from ..robot_structure import TOOL_TIP, select
from .joint_laws import JOINT_LAWS, joint_force, stretched
from .modal_integrator import require_simulable

ROUNDS = 6
"""Corrections of the joint's force at each instant."""


class JointLaw(NamedTuple):
    """A law of :data:`JOINT_LAWS` along a direction at the tip, and a coupling of velocities.

    Parameters
    ----------
    name
        Name of the law, a key of :data:`JOINT_LAWS`.
    direction : (3,)
        Direction of the joint, unit length.
    parameters : (3,)
        Parameters of the law, see :func:`joint_force`.
    coupling : (3, 3), N s/m
        Matrix of the force ``-coupling V`` on the tip.
    """

    name: str
    direction: NDArray[np.float64]
    parameters: NDArray[np.float64]
    coupling: NDArray[np.float64]


LINEAR = JointLaw("linear", np.array([1.0, 0.0, 0.0]), np.zeros(3), np.zeros((3, 3)))


def tip_motion(
    structure: ModalModel, force: NDArray[np.float64], step: float, law: JointLaw = LINEAR
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Compute displacement (m), velocity (m/s) and acceleration (m/s^2) of the tip, each (n, 3), from rest.

    ``q' = p q + L (F - d g(d.X, d.V) - G V)`` with the force in brackets linear over a step, exact but for that; g at
    the end of the step by fixed-point iteration.

    Parameters
    ----------
    structure
        Modal model of receptances at ``TCP:+X +Y +Z``.
    force : (n, 3), N
        Force at the tip at each instant.
    step : s
        Time between two instants.
    law
        Law of the joint, which the linear structure leaves out.

    Raises
    ------
    InputError
        A structure that cannot be simulated.
    """
    require_simulable(structure)
    tip = select(structure, TOOL_TIP, TOOL_TIP)
    z = tip.poles * step
    growth = np.exp(z)
    first = np.expm1(z) / z
    second = (first - 1) / z
    before, after = (step * part[:, None] * tip.left for part in (first - second, second))
    rates = tip.poles[:, None]
    modal = np.empty((len(force), len(growth)), dtype=complex)
    total = np.empty_like(force)
    number = JOINT_LAWS[law.name]
    _march(
        force,
        (growth, before, after, tip.right, rates * tip.right),
        step,
        number,
        (law.direction, law.parameters, law.coupling),
        modal,
        total,
    )
    displacement, velocity = (2 * np.real(modal @ (rates**k * tip.right)) for k in (0, 1))
    direct = 2 * np.real(np.einsum("rp,r,rq->pq", tip.right, tip.poles, tip.left))
    acceleration = 2 * np.real(modal @ (rates**2 * tip.right)) + total @ direct.T
    return displacement, velocity, np.asarray(acceleration)


@compiled
def _march(
    force: NDArray[np.float64],
    dynamics: tuple[
        NDArray[np.complex128],
        NDArray[np.complex128],
        NDArray[np.complex128],
        NDArray[np.complex128],
        NDArray[np.complex128],
    ],
    step: float,
    number: int,
    law: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    modal: NDArray[np.complex128],
    total: NDArray[np.float64],
) -> None:
    """Fill modal coordinates (n, n_modes) and the whole force (n, 3)."""
    growth, before, after, to_x, to_v = dynamics
    direction, values, coupling = law
    own_x = 2.0 * (to_x.T @ after).real
    own_v = 2.0 * (to_v.T @ after).real
    last, extra = np.zeros(3), np.zeros(3)
    q = np.zeros(len(growth), dtype=np.complex128)
    stretch, stood = 0.0, 0.0
    for i in range(len(force)):
        free = growth * q + before @ last.astype(np.complex128) + after @ force[i].astype(np.complex128)
        x_free, v_free = 2.0 * (to_x.T @ free).real, 2.0 * (to_v.T @ free).real
        x, grown = 0.0, stretch
        for _ in range(ROUNDS):
            velocity = v_free + own_v @ extra
            x = direction @ (x_free + own_x @ extra)
            grown = stretched(number, values, stretch, x - stood)
            extra = -direction * joint_force(number, values, x, direction @ velocity, i * step, grown)
            extra -= coupling @ velocity
        stretch, stood = grown, x
        q = free + after @ extra.astype(np.complex128)
        last = force[i] + extra
        modal[i], total[i] = q, last
