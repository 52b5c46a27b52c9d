"""Force of one cutting tooth, compiled for simulation in the time domain."""

import math

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError
from millfrf.core.compilation import compiled

from .process import MillingProcess, refuse_varied


@compiled(
    "(float64, float64, float64, float64, float64, float64, float64)",
)
def tooth_force(
    sine: float,
    cosine: float,
    sine_edge: float,
    cosine_edge: float,
    tangential: float,
    radial: float,
    axial: float,
) -> tuple[float, float, float]:
    """Force on the tool in X, Y, Z from one tooth's tangential, radial and axial force.

    ``Fx = -Ft cos(phi) - (Fr sin(gamma) + Fa cos(gamma)) sin(phi)``,
    ``Fy =  Ft sin(phi) - (Fr sin(gamma) + Fa cos(gamma)) cos(phi)``,
    ``Fz =  Fr cos(gamma) - Fa sin(gamma)``.

    The radial force acts against the direction in which chip thickness is counted. Mohammadi & Ahmadi, Eq. 2, print
    ``-k_rc cos(gamma)`` in the last row, which would not; the sign here is Altintas' (Manufacturing Automation,
    2nd ed., section 2.8). With their square end mill (gamma = 90 deg) the term is zero.

    Parameters
    ----------
    sine, cosine
        Sine and cosine of the immersion angle phi.
    sine_edge, cosine_edge
        Sine and cosine of the edge angle gamma.
    tangential, radial, axial : N
        Forces on the tooth.

    Returns
    -------
    tuple of three
        Force on the tool in X, Y, Z, N.

    Examples
    --------
    >>> tooth_force(1.0, 0.0, 1.0, 0.0, 100.0, 17.0, 33.0)
    (-17.0, 100.0, -33.0)
    """
    outward = radial * sine_edge + axial * cosine_edge
    return (
        -tangential * cosine - outward * sine,
        tangential * sine - outward * cosine,
        radial * cosine_edge - axial * sine_edge,
    )


@compiled
def wrapped_immersion(angle: float) -> float:
    """Bring an angle into [-pi/2, 3 pi/2), where an immersion within 0 ... pi has no seam.

    Examples
    --------
    >>> round(wrapped_immersion(2 * math.pi - 0.25), 12)
    -0.25
    """
    turn = 2.0 * math.pi
    return angle - turn * math.floor((angle + 0.5 * math.pi) / turn)


@compiled
def engaged_share(angle: float, step: float, start: float, leave: float) -> tuple[float, float]:
    """Give the share of the angle step around ``angle`` that lies in the immersion, and the middle of that part.

    A tooth enters and leaves between two instants; weighting with this share keeps the force's impulse right to the
    second order of the step, instead of quantising entry and exit.

    Parameters
    ----------
    angle : rad
        Immersion angle at the instant, wrapped.
    step : rad
        Angle turned between two instants.
    start, leave : rad
        Angles at which the immersion begins and ends.

    Returns
    -------
    share
        Between 0 and 1.
    middle
        Angle at which to evaluate the force, rad.

    Examples
    --------
    >>> engaged_share(1.0, 0.5, 1.0, 2.0)
    (0.5, 1.125)
    """
    low = max(angle - 0.5 * step, start)
    high = min(angle + 0.5 * step, leave)
    if high <= low:
        return 0.0, angle
    return (high - low) / step, 0.5 * (low + high)


def rigid_chip_thickness(process: MillingProcess, tooth: int, immersion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the chip thickness of one tooth, with runout, when the tool does not vibrate.

    ``h = min_k (k f sin(phi) + rho_j - rho_(j+k)) sin(gamma)``, k = 1 ... N, not below zero: the surface at an angle is
    the deepest that any earlier tooth left there (Altintas, Manufacturing Automation, 2nd ed., section 4.8).

    Parameters
    ----------
    process
        Cutter, feed and runout.
    tooth
        Index j of the tooth, 0 ... N - 1.
    immersion : (n,), rad
        Immersion angles of the tooth.

    Returns
    -------
    (n,), m
    """
    offsets = tooth_offsets(process)
    earlier = np.arange(1, process.teeth + 1)
    relative = offsets[tooth] - offsets[(tooth + earlier) % process.teeth]
    feed = process.feed_per_tooth * np.sin(immersion)
    thickness = (earlier * feed[:, None] + relative).min(axis=1) * math.sin(process.edge_angle)
    return np.asarray(np.maximum(thickness, 0.0))


def tooth_offsets(process: MillingProcess) -> NDArray[np.float64]:
    """How far each tooth runs large by the spindle's runout, m, shape (teeth,)."""
    return np.asarray(process.runout * np.cos(2 * np.pi * np.arange(process.teeth) / process.teeth))


def rigid_force(process: MillingProcess, depth: float, spindle_angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the force on a tool that does not vibrate, the F_p of Mohammadi & Ahmadi, Eq. 1.

    Tooth j (0 ... N - 1) stands at ``phi_j = angle + 2 pi j / N``; its forces are ``Ft = Ktc a h + Kte a / sin(gamma)``
    and alike for radial and axial, zero while no chip is cut.

    Parameters
    ----------
    process
        Cutter, immersion and coefficients.
    depth : m
        Axial depth of cut a.
    spindle_angles : (n,), rad
        Spindle angles, counted as the angle of tooth 0.

    Returns
    -------
    (n, 3), N
        Force on the tool in X, Y, Z.

    Raises
    ------
    InputError
        The depth is negative or not finite, or the edges are helical or of unequal pitch.
    """
    if not (math.isfinite(depth) and depth >= 0):
        raise InputError(f"depth = {depth!r} m must be zero or more, and finite")
    refuse_varied(process, "the rigid force", "give straight edges at equal pitch", takes=("damping",))
    cutting, edge = specific_forces(process)
    sine_edge, cosine_edge = math.sin(process.edge_angle), math.cos(process.edge_angle)
    force = np.zeros((len(spindle_angles), 3))
    for tooth in range(process.teeth):
        turned = np.asarray(spindle_angles, dtype=float) + 2 * np.pi * tooth / process.teeth
        immersion = turned - 2 * np.pi * np.floor((turned + 0.5 * np.pi) / (2 * np.pi))
        thickness = rigid_chip_thickness(process, tooth, immersion)
        cuts = (immersion >= process.start_angle) & (immersion < process.exit_angle) & (thickness > 0)
        local = cuts[:, None] * depth * (thickness[:, None] * cutting + edge / sine_edge)
        outward = local[:, 1] * sine_edge + local[:, 2] * cosine_edge
        force[:, 0] += -local[:, 0] * np.cos(immersion) - outward * np.sin(immersion)
        force[:, 1] += local[:, 0] * np.sin(immersion) - outward * np.cos(immersion)
        force[:, 2] += local[:, 1] * cosine_edge - local[:, 2] * sine_edge
    return force


def specific_forces(process: MillingProcess) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Cutting coefficients (Ktc, Krc, Kac), Pa, and edge coefficients (Kte, Kre, Kae), N/m, each shape (3,)."""
    cutting = process.ktc * np.array([1.0, process.krc, process.kac])
    return cutting, np.array([process.kte, process.kre, process.kae])
