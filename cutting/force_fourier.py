"""Fourier coefficients of the milling force over a tooth period: what a cut excites with."""

import math

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from .milling_process import MillingProcess
from .one_tooth import tooth_force
from .refusal import refuse_varied

_NODES = 200  # of the quadrature over the immersion; the integrand is a few waves of smooth function


def force_harmonics(process: MillingProcess, n_harmonics: int) -> NDArray[np.complex128]:
    """Coefficients c_h of the stable cutting force, for 1 m of depth: ``F(t) = c_0 + sum_h 2 Re(c_h exp(i h N W t))``.

    ``c_h = N / (2 pi) int f(phi) exp(-i h N phi) dphi`` over the immersion, f the force of one tooth with chip
    thickness ``feed sin(phi) sin(gamma)`` and edge forces (Altintas, Manufacturing Automation, 2nd ed., section 2.7).
    Runout, which puts lines between these, is left out.

    Parameters
    ----------
    process
        Cutter, immersion, coefficients, feed.
    n_harmonics
        Highest harmonic h of the tooth-passing frequency.

    Returns
    -------
    (n_harmonics + 1, 3), N/m, in X, Y, Z

    Raises
    ------
    InputError
        A negative number of harmonics, helical edges or unequal pitch.

    Examples
    --------
    >>> slot = MillingProcess(4, 0.01, math.pi / 2, 1e9, 0.3, 0.0, 0.0, math.pi, 1e-4)
    >>> np.round(force_harmonics(slot, 0)[0].real / 1e5, 3)  # 4 teeth: N feed ktc / 4 (krc, 1)
    array([-0.3,  1. ,  0. ])
    """
    if n_harmonics < 0:
        raise InputError(f"{n_harmonics} harmonics: give 0 or more")
    refuse_varied(process, "the plan of excitation", "give straight edges at equal pitch", takes=("damping",))
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    half = 0.5 * (process.exit_angle - process.start_angle)
    angles = process.start_angle + half * (nodes + 1)
    force = np.array([_force_of_tooth(process, float(angle)) for angle in angles])
    waves = np.exp(-1j * process.teeth * np.outer(np.arange(n_harmonics + 1), angles))
    return np.asarray(process.teeth / (2 * math.pi) * half * (waves * weights) @ force)


def _force_of_tooth(process: MillingProcess, angle: float) -> tuple[float, float, float]:
    sine_edge, cosine_edge = math.sin(process.edge_angle), math.cos(process.edge_angle)
    chip = process.feed_per_tooth * math.sin(angle) * sine_edge
    tangential = process.ktc * chip
    return tooth_force(
        math.sin(angle),
        math.cos(angle),
        sine_edge,
        cosine_edge,
        tangential + process.kte / sine_edge,
        process.krc * tangential + process.kre / sine_edge,
        process.kac * tangential + process.kae / sine_edge,
    )
