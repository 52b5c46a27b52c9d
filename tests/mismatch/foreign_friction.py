"""Friction laws of other families than the library's, marched by an own integrator (fixed steps, Runge-Kutta)."""

import numba
import numpy as np
from numpy.typing import NDArray

from modal_fit import ModalModel

Real = NDArray[np.float64]

FAMILIES = ("root", "arctangent", "lugre", "iwan")
"""Force over velocity ``v / sqrt(v^2 + v0^2)``; ``2 / pi arctan(v / v0)``; LuGre's bristles without Stribeck's effect;
twelve sliders in parallel whose yields spread over a decade (Iwan). All saturate at the same force."""

SLIDERS = 12
FINE = {"root": 16, "arctangent": 16, "lugre": 64, "iwan": 16}
"""Steps a sample. LuGre's bristles relax at the rate ``|v| / scale``: with 16 steps Runge-Kutta ran away where the
joint moved fastest, in 2 of 20 draws."""


def response_with_friction(
    model: ModalModel, force: Real, rate: float, direction: Real, family: str, saturation: float, scale: float
) -> Real:
    """Acceleration (n_samples, n_dof) at rest before; receptance with real modes and equal left and right vectors.

    Parameters
    ----------
    model
        Structure.
    force : (n_samples, n_dof), N
    rate
        Hz.
    direction : (n_dof,)
        Of the joint.
    family
        One of :data:`FAMILIES`.
    saturation
        Force at which the law saturates, N: its reference number.
    scale
        m/s for the first two families, presliding in m for the others.
    """
    omega, zeta = np.abs(model.poles), -model.poles.real / np.abs(model.poles)
    shapes = np.ascontiguousarray(model.left.real)
    masses = 1 / np.real(2j * model.poles.imag[:, None] * model.right / shapes).mean(axis=1)
    steps = FINE[family]
    fine = np.fft.irfft(np.fft.rfft(force, axis=0), n=2 * steps * len(force), axis=0) * 2 * steps
    kind = FAMILIES.index(family)
    yields = scale * np.geomspace(0.3, 3.0, SLIDERS)
    out = np.empty((len(force), shapes.shape[1]))
    step = 1 / (rate * steps)
    _march(
        fine @ shapes.T, omega, zeta, 1 / masses, shapes, direction, kind, saturation, scale, yields, step, steps, out
    )
    assert np.isfinite(out).all()
    return out


@numba.njit(cache=False)  # type: ignore[untyped-decorator]
def _law(kind, v, z, saturation, scale, yields, slope):  # type: ignore[no-untyped-def]
    """Force, and the rates of the inner states in ``slope``."""
    if kind == 0:
        return saturation * v / np.sqrt(v * v + scale * scale)
    if kind == 1:
        return saturation * 2 / np.pi * np.arctan(v / scale)
    if kind == 2:
        slope[0] = v - abs(v) * z[0] / scale
        return saturation / scale * z[0]
    total = 0.0
    for i in range(len(yields)):
        slope[i] = v if abs(z[i]) < yields[i] or z[i] * v < 0 else 0.0
        total += min(max(z[i], -yields[i]), yields[i]) / yields[i]
    return saturation * total / len(yields)


@numba.njit(cache=False)  # type: ignore[untyped-decorator]
def _march(push, omega, zeta, flexible, shapes, direction, kind, saturation, scale, yields, h, fine, out):  # type: ignore[no-untyped-def]
    modes = len(omega)
    along = shapes @ direction
    q, p, z = np.zeros(modes), np.zeros(modes), np.zeros(len(yields))
    kq, kp, kz = np.zeros((4, modes)), np.zeros((4, modes)), np.zeros((4, len(yields)))
    for k in range(len(out) * fine - 1):
        for stage in range(4):
            part = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
            row = 2 * k + (0 if stage == 0 else (2 if stage == 3 else 1))
            qa, pa, za = q.copy(), p.copy(), z.copy()
            if stage > 0:
                qa += part * h * kq[stage - 1]
                pa += part * h * kp[stage - 1]
                za += part * h * kz[stage - 1]
            g = _law(kind, along @ pa, za, saturation, scale, yields, kz[stage])
            kq[stage] = pa
            kp[stage] = flexible * (push[row] - along * g) - 2 * zeta * omega * pa - omega**2 * qa
        if k % fine == 0:
            out[k // fine] = kp[0] @ shapes
        q += h * (kq[0] + 2 * kq[1] + 2 * kq[2] + kq[3]) / 6
        p += h * (kp[0] + 2 * kp[1] + 2 * kp[2] + kp[3]) / 6
        z += h * (kz[0] + 2 * kz[1] + 2 * kz[2] + kz[3]) / 6
        if kind == 3:
            z = np.minimum(np.maximum(z, -yields), yields)
