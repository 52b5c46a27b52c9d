"""Nonlinear joint laws, and a modal structure integrated with one of them; compiled."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from millfrf.core import TIP
from millfrf.core.compilation import SIMULATION, compile_kernels, compiled
from modal_fit import ModalModel

from .modal_integrator import require_simulable
from .robot_structure import select

JOINT_LAWS = {
    "linear": 0,
    "stiffness_hardening": 1,
    "stiffness_softening": 2,
    "backlash": 3,
    "coulomb_friction": 4,
    "hysteresis": 5,
    "pose_drift": 6,
    "stiffness_modulation": 7,
}
"""Number of each law in :func:`joint_force`. The last is in no library: nothing should be named."""


@compiled
def joint_force(law: int, p: NDArray[np.float64], x: float, v: float, time: float, stretch: float) -> float:
    """Compute the force of the joint, N, against its deflection.

    Parameters
    ----------
    law
        Number of the law, from :data:`JOINT_LAWS`.
    p : (3,)
        Parameters of the law. 1: cubic stiffness (N/m^3), ``p0 x^3``. 2: stiffness lost (N/m), knee (m), ``p0 (p1
        atan(x / p1) - x)``. 3: stiffness lost (N/m) within half a gap (m), ``-p0 x`` there. 4: friction (N), creep
        speed (m/s), ``p0 v / sqrt(v^2 + p1^2)``. 5: stiffness (N/m) of the stretch. 6: stiffness change (N/m) over a
        duration (s), ``p0 (t / p1 - 1/2) x``. 7: stiffness (N/m) at an angular frequency (rad/s), ``p0 cos(p1 t) x``.
    x, v
        Deflection (m) and velocity (m/s) of the joint.
    time : s
        Time since the beginning of the recording.
    stretch : m
        Stretch of the element with memory.
    """
    if law == 1:
        return float(p[0] * x * x * x)
    if law == 2:
        return float(p[0] * (p[1] * math.atan(x / p[1]) - x))
    if law == 3:
        return float(-p[0] * min(max(x, -p[1]), p[1]))
    if law == 4:
        return float(p[0] * v / math.sqrt(v * v + p[1] * p[1]))
    if law == 5:
        return float(p[0] * stretch)
    if law == 6:
        return float(p[0] * (time / p[1] - 0.5) * x)
    if law == 7:
        return float(p[0] * math.cos(p[1] * time) * x)
    return 0.0


@compiled
def stretched(law: int, p: NDArray[np.float64], stretch: float, moved: float) -> float:
    """Stretch (m) of the hysteretic element after the joint has moved by ``moved`` (m).

    ``dz = dx (1 - (beta sign(z dx) + gamma) |z|)`` with ``beta = p1``, ``gamma = p2`` in 1/m (Bouc 1967; Wen 1976, with
    exponent 1), by Heun's method.
    """
    if law != 5:
        return 0.0
    first = moved * (1.0 - (p[1] * np.sign(stretch * moved) + p[2]) * abs(stretch))
    trial = stretch + first
    second = moved * (1.0 - (p[1] * np.sign(trial * moved) + p[2]) * abs(trial))
    return float(stretch + 0.5 * (first + second))


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
    compile_kernels(*SIMULATION)
    tip = select(structure, TIP, TIP)
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


@compiled(
    "(float64[:,::1], "
    "Tuple((complex128[::1],complex128[::1,:],complex128[::1,:],complex128[::1,:],complex128[::1,:])), "
    "float64, int64, Tuple((float64[::1],float64[::1],float64[:,::1])), complex128[:,::1], "
    "float64[:,::1])",
)
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
