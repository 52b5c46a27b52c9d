"""Force laws of joint elements, compiled: ``force = g(u, v, schedule, memory)`` along a direction at the tip.

p[0] is an amplitude in N (or N/m, N s/m), the others scale deflection and speed. The families are chosen apart from any
library; each function names its source.
"""

from math import exp, sqrt, tanh

import numpy as np
from numpy.typing import NDArray

from .compiled import compiled

CUBIC, POWER, SATURATING, RATIONAL, ROOT, BUMPER = 1, 2, 3, 4, 5, 6
GAP_SHARP, GAP_SMOOTH, SCHEDULED, VISCOUS = 7, 8, 9, 10
COULOMB, STRIBECK, DAHL, LUGRE = 11, 12, 13, 14
BOUC_WEN, BOUC_WEN_SQUARE, IWAN = 15, 16, 17
ROOT_SPEED, SQUARE_SPEED = 18, 19

N_PARAMETERS = 6
N_MEMORY = 8


@compiled
def elastic(code: int, p: NDArray[np.float64], u: float) -> float:
    """Laws of deflection alone.

    CUBIC ``A (u/u0)^3``; POWER ``A |u/u0|^2.5``; SATURATING ``k (u - u0 tanh(u/u0))``; RATIONAL
    ``k u^3/(u^2 + u0^2)``; ROOT ``k (u - u/sqrt(1 + (u/u0)^2))``; BUMPER ``k (|u| - u0)+`` (Kerschen et al., MSSP 20,
    2006, section 2); GAP_SHARP ``k clip(u, -u0, u0)``; GAP_SMOOTH ``k u0 tanh(u/u0)``.
    """
    a, w = float(p[0]), float(p[1])
    x = u / w
    if code == CUBIC:
        return a * x * x * x
    if code == POWER:
        return a * x * abs(x) * sqrt(abs(x))
    if code == SATURATING:
        return a * w * (x - tanh(x))
    if code == RATIONAL:
        return a * w * x * x * x / (1 + x * x)
    if code == ROOT:
        return a * w * (x - x / sqrt(1 + x * x))
    if code == BUMPER:
        return a * w * (max(x - 1, 0.0) - max(-x - 1, 0.0))
    if code == GAP_SHARP:
        return a * w * min(max(x, -1.0), 1.0)
    return a * w * tanh(x)


@compiled
def resisting(code: int, p: NDArray[np.float64], v: float) -> float:
    """Laws of speed alone.

    VISCOUS ``c v``; COULOMB ``A v/sqrt(v^2 + v0^2)``; STRIBECK ``A (1 + 0.5 exp(-(v/vs)^2)) tanh(v/v0)`` (Armstrong-
    Helouvry et al., Automatica 30, 1994, Eq. 6); ROOT_SPEED ``A v/v1 (v0^2 + (v/v1)^2)^(-1/4)``; SQUARE_SPEED
    ``A v|v|/v1^2``.
    """
    a, w, c = float(p[0]), float(p[1]), float(p[2])
    if code == VISCOUS:
        return a * v
    if code == COULOMB:
        return a * v / sqrt(v * v + w * w)
    if code == STRIBECK:
        return a * (1 + 0.5 * exp(-((v / c) ** 2))) * tanh(v / w)
    x = v / w
    if code == ROOT_SPEED:
        return a * x / sqrt(sqrt(0.01 + x * x))
    return a * x * abs(x)


@compiled
def memory_rate(code: int, p: NDArray[np.float64], v: float, z: float) -> float:
    """Rate of the one memory variable; 0 for laws without.

    DAHL and LUGRE ``z' = v - |v| z/z0`` (Canudas de Wit et al., IEEE TAC 40, 1995, Eq. 1-2, constant g);
    BOUC_WEN ``z' = v - b |v| z - c v |z|``, BOUC_WEN_SQUARE ``z' = v - b |v| |z| z - c v z^2``
    (Ismail et al., ACME 16, 2009, Eq. 6).
    """
    w, c = float(p[1]), float(p[2])
    if code in (DAHL, LUGRE):
        return v - abs(v) * z / w
    if code == BOUC_WEN:
        return v - w * abs(v) * z - c * v * abs(z)
    if code == BOUC_WEN_SQUARE:
        return v - w * abs(v) * abs(z) * z - c * v * z * z
    return 0.0


@compiled
def remembering(
    code: int, p: NDArray[np.float64], u: float, rate: float, z: NDArray[np.float64], first: float
) -> float:
    """Force of laws with memory.

    DAHL ``A z/z0``; LUGRE ``A z/z0 + s1 z'``; BOUC_WEN ``k z``; IWAN: parallel springs k/n, each with a slider that
    yields at its own deflection (Iwan, J. Appl. Mech. 33, 1966), sliders in ``z``.
    """
    a, w, c = float(p[0]), float(p[1]), float(p[2])
    if code == DAHL:
        return a * first / w
    if code == LUGRE:
        return a * first / w + c * rate
    if code == IWAN:
        total = 0.0
        for i in range(N_MEMORY):
            limit = w * (i + 1) * 2 / (N_MEMORY + 1)
            total += min(max(u - float(z[i]), -limit), limit)
        return a * total / N_MEMORY
    return a * first


@compiled
def drag_sliders(p: NDArray[np.float64], u: float, z: NDArray[np.float64]) -> None:
    """Move IWAN's sliders after a step: exact for a rate-independent element."""
    for i in range(N_MEMORY):
        limit = p[1] * (i + 1) * 2 / (N_MEMORY + 1)
        stretch = u - z[i]
        if stretch > limit:
            z[i] = u - limit
        elif stretch < -limit:
            z[i] = u + limit


@compiled
def law_force(
    code: int,
    p: NDArray[np.float64],
    motion: tuple[float, float, float],
    z: NDArray[np.float64],
    first: float,
    rate: float,
) -> float:
    """Force of any law; ``motion`` is deflection, speed and schedule. SCHEDULED: ``A schedule(t) u``."""
    u, v, schedule = motion
    if code <= GAP_SMOOTH:
        return elastic(code, p, u)
    if code == SCHEDULED:
        return float(p[0]) * schedule * u
    if code in (DAHL, LUGRE, BOUC_WEN, BOUC_WEN_SQUARE, IWAN):
        return remembering(code, p, u, rate, z, first)
    return resisting(code, p, v)
