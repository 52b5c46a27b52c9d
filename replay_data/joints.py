"""Nonlinear joint laws, and a modal structure integrated with one of them; compiled."""

import math
from typing import NamedTuple

import numpy as np

from millfrf.core import TIP, Complex, Real
from millfrf.core.compilation import SIMULATION, compile_kernels, compiled
from modal_fit import ModalModel

from .modal_integrator import exponential_weights, require_simulable
from .robot_structure import select

# number of each law in joint_force; no library has the last law, so that a diagnosis should name no cause
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

_CORRECTIONS = 6  # fixed-point iterations of the joint's force at each instant


@compiled
def joint_force(law: int, p: Real, x: float, v: float, time: float, stretch: float) -> float:
    """Compute the force (N) with which the joint resists its deflection.

    Parameters
    ----------
    law
        Number of the law, from ``JOINT_LAWS``.
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
        Stretch of the hysteretic element.
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
def hysteretic_stretch(law: int, p: Real, stretch: float, moved: float) -> float:
    """Compute the stretch (m) of the hysteretic element after the joint has moved by ``moved`` (m).

    The law is ``dz = dx (1 - (beta sign(z dx) + gamma) |z|)`` with ``beta = p1``, ``gamma = p2`` in 1/m (Bouc 1967; Wen
    1976, with exponent 1), by Heun's method.
    """
    if law != 5:
        return 0.0
    first = moved * (1.0 - (p[1] * np.sign(stretch * moved) + p[2]) * abs(stretch))
    trial = stretch + first
    second = moved * (1.0 - (p[1] * np.sign(trial * moved) + p[2]) * abs(trial))
    return float(stretch + 0.5 * (first + second))


class JointLaw(NamedTuple):
    """A nonlinear law along a direction at the tip, and a coupling of velocities."""

    name: str  # key of JOINT_LAWS
    direction: Real  # (3,), unit length
    parameters: Real  # (3,), see joint_force
    coupling: Real  # (3, 3), N s/m: matrix of the force -coupling V on the tip


LINEAR = JointLaw("linear", np.array([1.0, 0.0, 0.0]), np.zeros(3), np.zeros((3, 3)))


def tip_motion(structure: ModalModel, force: Real, step: float, law: JointLaw = LINEAR) -> tuple[Real, Real, Real]:
    """Compute displacement (m), velocity (m/s) and acceleration (m/s^2) of the tip, each (n, 3), from rest.

    The modes obey ``q' = p q + L (F - d g(d.X, d.V) - G V)``, with the joint force g along d and the coupling G. The
    force in parentheses is taken as linear over a step; otherwise the integration is exact. The joint force at the end
    of the step is found by fixed-point iteration.

    Parameters
    ----------
    structure
        Modal model of receptances at ``TCP:+X +Y +Z``.
    force : (n, 3), N
        Force at the tip at each instant.
    step : s
        Time between two instants.
    law
        Law of the joint, in addition to the linear structure.

    Raises
    ------
    InputError
        A structure that cannot be simulated.
    """
    require_simulable(structure)
    compile_kernels(*SIMULATION)
    tip = select(structure, TIP, TIP)
    growth, before, after = exponential_weights(tip.poles, step)
    rates = tip.poles[:, None]
    modal = np.empty((len(force), len(growth)), dtype=complex)
    total = np.empty_like(force)
    _integrate(
        force,
        (growth, before[:, None] * tip.left, after[:, None] * tip.left, tip.right, rates * tip.right),
        step,
        JOINT_LAWS[law.name],
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
def _integrate(
    force: Real,
    dynamics: tuple[Complex, Complex, Complex, Complex, Complex],
    step: float,
    law: int,
    joint: tuple[Real, Real, Real],
    modal: Complex,
    total: Real,
) -> None:
    """Fill ``modal`` with the modal coordinates (n, n_modes) and ``total`` with the total force (n, 3), N."""
    growth, before, after, to_x, to_v = dynamics
    direction, parameters, coupling = joint
    # displacement and velocity at an instant for a unit force at the same instant
    own_x = 2.0 * (to_x.T @ after).real
    own_v = 2.0 * (to_v.T @ after).real
    last_force, joint_part = np.zeros(3), np.zeros(3)
    q = np.zeros(len(growth), dtype=np.complex128)
    stretch, last_x = 0.0, 0.0
    for i in range(len(force)):
        free = growth * q + before @ last_force.astype(np.complex128) + after @ force[i].astype(np.complex128)
        x_free, v_free = 2.0 * (to_x.T @ free).real, 2.0 * (to_v.T @ free).real
        x, new_stretch = 0.0, stretch
        for _ in range(_CORRECTIONS):
            velocity = v_free + own_v @ joint_part
            x = direction @ (x_free + own_x @ joint_part)
            new_stretch = hysteretic_stretch(law, parameters, stretch, x - last_x)
            joint_part = -direction * joint_force(law, parameters, x, direction @ velocity, i * step, new_stretch)
            joint_part -= coupling @ velocity
        stretch, last_x = new_stretch, x
        q = free + after @ joint_part.astype(np.complex128)
        last_force = force[i] + joint_part
        modal[i], total[i] = q, last_force
