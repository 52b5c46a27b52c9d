"""Hidden forces of a structure by their numbers, and the integration of a rig that has one."""

import math

import numba
import numpy as np


@numba.njit(cache=True, error_model="numpy")
def _law(code, a, z, v, z2, late, course, w, dw):  # type: ignore[no-untyped-def]  # noqa: C901
    """Hidden force, added mass and second force; ``a``: dial, stiffness, deflection, velocity, number, k2, mass."""
    d, k, z0, v0, u, k2 = a[0], a[1], a[2], a[3], a[4], a[5]
    if code == 1:  # stiffness on a course of its own
        return d * k * course * z, 0.0, 0.0
    if code == 2:  # mass on a course of its own
        return 0.0, d * a[6] * course, 0.0
    if code == 3:  # contact that opens beyond a load
        return -d * k * max(z - (0.3 + 0.9 * u) * z0, 0.0), 0.0, 0.0
    if code == 4:  # pendulum
        length = z0 / math.sqrt(d)
        return k * (length * math.sin(min(max(z / length, -2.0), 2.0)) - z), 0.0, 0.0
    if code == 5:  # magnets at both sides, beyond their linear part
        gap = (9.0 + 6.0 * u) * z0
        x = min(max(z / gap, -0.8), 0.8)
        return -0.25 * d * k * gap * (1 / (1 - x) ** 2 - 1 / (1 + x) ** 2 - 4 * x), 0.0, 0.0
    if code == 6:  # air spring, beyond its linear part
        height = (9.0 + 6.0 * u) * z0
        x = min(max(z / height, -2.0), 0.8)
        return d * k * height * (((1 - x) ** -1.4 - 1) / 1.4 - x), 0.0, 0.0
    if code == 7:  # relaxation over two decades
        force = 0.0
        for j in range(3):
            dw[j] = 2 * math.pi * (0.5 + u) * 5.0**j * (z - w[j])
            force += d * k / 3 * (z - w[j])
        return force, 0.0, 0.0
    if code == 8:  # stop on one side, with loss
        depth = z - (1.2 + 1.2 * u) * z0
        return (20 * d * k * max(depth + 0.3 * z0 / v0 * v, 0.0) if depth > 0 else 0.0), 0.0, 0.0
    if code == 9:  # friction that depends on the position
        normal = 1 + 0.8 * math.cos(2 * math.pi * z / (1 + 2 * u) / z0)
        return d * k * z0 * normal * math.tanh(v / v0 / 0.03), 0.0, 0.0
    if code == 10:  # stiffness that its own dissipation heats
        dw[0] = ((v / v0) ** 2 - w[0]) / (3 + 5 * u)
        return -d * k * z * w[0] / (1 + w[0]), 0.0, 0.0
    if code == 11:  # second structure in a loose coupling
        x, natural = w[0] - z, k2
        play = x - min(max(x, -0.5 * z0), 0.5 * z0)
        pull = natural**2 * (0.2 * x + 0.8 * play) + 0.06 * natural * (w[1] - v)
        dw[0], dw[1] = w[1], -pull
        return -d * a[6] * pull, 0.0, 0.0
    if code == 12:  # feedback with dead time
        return d * k * (z - late), 0.0, 0.0
    if code == 13:  # drag that falls at high speed
        return d * k * z0 / v0 * v / (1 + (v / v0 / (0.5 + u)) ** 2), 0.0, 0.0
    if code == 14:  # play beside the working point
        off, gap = (0.5 + u) * z0, 0.7 * z0
        return -d * k * (min(max(z + off, -gap), gap) - min(max(off, -gap), gap)), 0.0, 0.0
    if code == 15:  # geometric coupling of two directions
        alpha = d * k / z0
        return 2 * alpha * z * z2 + 2 * alpha**2 / k2 * z**3, 0.0, alpha * z * z
    if code == 16:  # friction whose normal force follows the deflection
        return d * k * abs(z) * math.tanh(v / v0 / 0.03), 0.0, 0.0
    return 0.0, 0.0, 0.0


@numba.njit(cache=True, error_model="numpy")
def _slope(code, a, omega, zeta, joint, y, dy, pushed, late, course):  # type: ignore[no-untyped-def]
    """Time derivative of the modal states and the internal states."""
    n = len(omega)
    z, v, z2 = 0.0, 0.0, 0.0
    for r in range(n):
        z += joint[0, r] * y[r]
        v += joint[0, r] * y[n + r]
        z2 += joint[1, r] * y[r]
    dy[2 * n :] = 0.0
    g, mass, g2 = _law(code, a, z, v, z2, late, course, y[2 * n :], dy[2 * n :])
    moved, own = 0.0, 0.0
    for r in range(n):
        dy[r] = y[n + r]
        dy[n + r] = pushed[r] - 2 * zeta[r] * omega[r] * y[n + r] - omega[r] ** 2 * y[r]
        dy[n + r] -= joint[0, r] * g + joint[1, r] * g2
        moved += joint[0, r] * dy[n + r]
        own += joint[0, r] ** 2
    for r in range(n):
        dy[n + r] -= joint[0, r] * mass * moved / (1 + mass * own)
    return z


@numba.njit(cache=True, error_model="numpy")
def integrated(code, a, omega, zeta, joint, pushed, course, fine, step, delay):  # type: ignore[no-untyped-def]
    """Modal deflections, velocities and accelerations at every sample by the classical Runge-Kutta method."""
    n, count = len(omega), (len(pushed) - 1) // (2 * fine)
    y, out, past = np.zeros(2 * n + 3), np.empty((count, 3, n)), np.zeros(count * fine + 1)
    slopes = np.zeros((4, 2 * n + 3))
    for i in range(count * fine):
        late = past[i - delay] if i >= delay else 0.0
        after = past[i - delay + 1] if i >= delay - 1 else 0.0
        past[i] = _slope(code, a, omega, zeta, joint, y, slopes[0], pushed[2 * i], late, course[2 * i])
        if i % fine == 0:
            out[i // fine, 0], out[i // fine, 1] = y[:n], y[n : 2 * n]
            out[i // fine, 2] = slopes[0, n : 2 * n]
        for stage in range(1, 4):
            j, share = 2 * i + (2 if stage == 3 else 1), 1.0 if stage == 3 else 0.5
            z = late + share * (after - late)
            at = y + share * step * slopes[stage - 1]
            _slope(code, a, omega, zeta, joint, at, slopes[stage], pushed[j], z, course[j])
        y = y + step / 6 * (slopes[0] + 2 * slopes[1] + 2 * slopes[2] + slopes[3])
    return out
