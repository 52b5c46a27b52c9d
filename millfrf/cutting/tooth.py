"""Force of one cutting tooth, compiled for simulation in the time domain."""

import math
from dataclasses import replace

import numpy as np

from millfrf.core import InputError, Real
from millfrf.core.compilation import compiled

from .cuts_in_words import refuse_varied
from .process import MillingProcess


@compiled("(float64, float64, float64, float64, float64, float64, float64)")
def tooth_force(
    sine: float, cosine: float, sine_edge: float, cosine_edge: float, tangential: float, radial: float, axial: float
) -> tuple[float, float, float]:
    """Return the force on the tool in X, Y, Z from one tooth's tangential, radial and axial force.

    ``Fx = -Ft cos(phi) - (Fr sin(gamma) + Fa cos(gamma)) sin(phi)``,
    ``Fy =  Ft sin(phi) - (Fr sin(gamma) + Fa cos(gamma)) cos(phi)``,
    ``Fz =  Fr cos(gamma) - Fa sin(gamma)``.

    The radial force acts against the direction in which chip thickness is counted (Altintas, Manufacturing Automation,
    2nd ed., section 2.8). Mohammadi & Ahmadi, Eq. 2, print ``-k_rc cos(gamma)`` in the last row, which has the wrong
    sign; for their square end mill (gamma = 90 deg) the term is zero.

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
    """Add whole turns to an angle so that it lies in [-pi/2, 3 pi/2): an immersion within 0 ... pi is not split.

    Examples
    --------
    >>> round(wrapped_immersion(2 * math.pi - 0.25), 12)
    -0.25
    """
    turn = 2.0 * math.pi
    return angle - turn * math.floor((angle + 0.5 * math.pi) / turn)


@compiled
def engaged_share(angle: float, step: float, start: float, leave: float) -> tuple[float, float]:
    """Return the share of an angle step that lies in the immersion, and the middle of this part.

    A tooth enters and leaves the cut between two instants. If its force is weighted with this share, the error of the
    impulse is of second order in the step.

    Parameters
    ----------
    angle : rad
        Immersion angle at the instant, wrapped; the step is centred on it.
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


def rigid_chip_thickness(process: MillingProcess, tooth: int, immersion: Real) -> Real:
    """Return the chip thickness (n,), m, of one tooth at immersion angles (n,), rad, of a tool that does not vibrate.

    ``h = min_k (f_k sin(phi) + rho_j - rho_(j+k)) sin(gamma)``, k = 1 ... N, not below zero, with the feed f_k since
    the tooth j + k passed and the offsets rho of the teeth: a tooth cuts from the deepest surface that any earlier
    tooth left at the same angle (Altintas, Manufacturing Automation, 2nd ed., section 4.8).
    """
    feeds, steps = _earlier_teeth(process, tooth)
    thickness = (feeds * np.sin(immersion)[:, None] + steps).min(axis=1) * math.sin(process.edge_angle)
    return np.asarray(np.maximum(thickness, 0.0))


def _earlier_teeth(process: MillingProcess, tooth: int) -> tuple[Real, Real]:
    """Return the feed since each earlier tooth passed, and by how much this tooth reaches farther, (teeth,) each, m."""
    offsets = tooth_offsets(process)
    order = (tooth + np.arange(1, process.teeth + 1)) % process.teeth
    return np.cumsum(np.roll(process.tooth_feeds, -tooth)), offsets[tooth] - offsets[order]


def thin_chip_immersions(process: MillingProcess, tooth: int) -> tuple[float, ...]:
    """Return immersions (rad) that divide the cut of a tooth so that its chip law is smooth between them.

    The chip of a rigid tool has the edge radius there, four times it, and so on: from one to the next a power of the
    chip thickness is a polynomial of low order, and the law changes at the edge radius. Runout counts where it decides
    which earlier tooth left the surface. Empty without a law.
    """
    if not process.chip_law.varies or process.is_turning:
        return ()
    rigid = process if process.runout_decides else replace(process, runout=0.0)
    feeds, steps = _earlier_teeth(rigid, tooth)
    sine, chip, breaks = math.sin(process.edge_angle), process.chip_law.edge_radius, []
    while chip < ((feeds + steps) * sine).min():
        rises = (chip / sine - steps) / feeds
        angles = np.arcsin(rises[(rises > 0) & (rises < 1)])
        angles = np.concatenate([angles, np.pi - angles])
        breaks += angles[rigid_chip_thickness(rigid, tooth, angles) > (1 - 1e-9) * chip].tolist()
        chip *= 4
    return tuple(sorted({angle for angle in breaks if process.start_angle < angle < process.exit_angle}))


def tooth_offsets(process: MillingProcess) -> Real:
    """Return by how much the spindle's runout enlarges each tooth's radius, m, shape (teeth,)."""
    return np.asarray(process.runout * np.cos(2 * np.pi * np.arange(process.teeth) / process.teeth))


def rigid_force(process: MillingProcess, depth: float, spindle_angles: Real) -> Real:
    """Return the force (n, 3), N, on a tool that does not vibrate, at spindle angles (n,), rad.

    It is F_p of Mohammadi & Ahmadi, Eq. 1. Tooth j (0 ... N - 1) is at ``phi_j = angle + 2 pi j / N`` and has the
    tangential force ``Ft = Ktc a h + Kte a / sin(gamma)`` with the depth a in m and the equivalent chip h of
    :class:`ChipLaw`. Radial and axial force have the same form. All are zero while no chip is cut.
    """
    if not (math.isfinite(depth) and depth >= 0):
        raise InputError(f"depth = {depth!r} m must be zero or more, and finite")
    refuse_varied(process, "the rigid force", "give straight edges at equal pitch", takes=("damping", "runout"))
    _, edge = specific_forces(process)
    sine_edge, cosine_edge = math.sin(process.edge_angle), math.cos(process.edge_angle)
    force = np.zeros((len(spindle_angles), 3))
    for tooth in range(process.teeth):
        turned = np.asarray(spindle_angles, dtype=float) + 2 * np.pi * tooth / process.teeth
        immersion = turned - 2 * np.pi * np.floor((turned + 0.5 * np.pi) / (2 * np.pi))
        thickness = rigid_chip_thickness(process, tooth, immersion)
        cuts = (immersion >= process.start_angle) & (immersion < process.exit_angle) & (thickness > 0)
        local = cuts[:, None] * depth * (chip_forces(process, thickness) + edge / sine_edge)
        outward = local[:, 1] * sine_edge + local[:, 2] * cosine_edge
        force[:, 0] += -local[:, 0] * np.cos(immersion) - outward * np.sin(immersion)
        force[:, 1] += local[:, 0] * np.sin(immersion) - outward * np.cos(immersion)
        force[:, 2] += local[:, 1] * cosine_edge - local[:, 2] * sine_edge
    return force


def specific_forces(process: MillingProcess) -> tuple[Real, Real]:
    """Return cutting coefficients (Ktc, Krc, Kac), Pa, and edge coefficients (Kte, Kre, Kae), N/m, each shape (3,)."""
    cutting = process.ktc * np.array([1.0, process.krc, process.kac])
    return cutting, np.array([process.kte, process.kre, process.kae])


def chip_forces(process: MillingProcess, chips: Real) -> Real:
    """Return tangential, radial and axial force of chips (n,), m, per width, without edge forces, (n, 3), N/m."""
    return np.asarray(specific_forces(process)[0] * process.chip_law.equivalent_chips(chips))
