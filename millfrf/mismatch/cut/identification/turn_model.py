"""Force of a rigid cutter over one revolution, as a sum over its six force coefficients."""

import math
from functools import lru_cache

import numpy as np

from millfrf.core import Complex, Real
from millfrf.cutting import MillingProcess, equivalent_chips

FINE = 720  # angles of a revolution at which the force is computed: half a degree
TILTED = 6  # least slices of a tilted cutter
LAG = math.radians(3)  # largest lag within one slice of a helical edge
CONSTANT = np.zeros(3)  # exponents of coefficients that do not depend on the chip thickness
KEPT = 512  # spectra kept: every placement of the sensors is tried with the same cutter, feeds and runouts


def chip_thickness(process: MillingProcess, offsets: Real, tooth: int, immersion: Real) -> Real:
    """Return the chip thickness (n,), m, of a tooth with radial offsets (teeth,), m, of all teeth.

    ``h = max(0, min_k (f_k sin(phi) + e_j - e_(j+k)) sin(gamma))``, k = 1 ... N, where f_k is the feed while the
    spindle turns from tooth j + k to tooth j (Altintas, Manufacturing Automation, 2nd ed., section 4.8).
    """
    steps = np.arange(1, process.teeth + 1)
    turned = np.cumsum(np.roll(process.pitches, -tooth)) * process.teeth / (2 * np.pi)
    relative = offsets[tooth] - offsets[(tooth + steps) % process.teeth]
    thickness = process.feed_per_tooth * turned[:, None] * np.sin(immersion) + relative[:, None]
    return np.asarray(np.maximum(thickness.min(axis=0) * math.sin(process.edge_angle), 0.0))


def force_basis(
    process: MillingProcess,
    depth: float,
    offsets: Real,
    exponents: Real = CONSTANT,
    reference: float = 1e-3,
    angles: int = FINE,
    tilts: Real | None = None,
) -> Real:
    """Return the force on the tool per unit of each coefficient over one revolution.

    The edge is cut into slices of the depth; slice z lags the tip by ``2 z tan(beta) / D``. Each contributes
    ``K_c h + K_e / sin(gamma)`` per metre of depth in tangential, radial and axial direction while it is in the chip;
    with exponents ``K_c`` times the equivalent chip (:class:`millfrf.cutting.ChipLaw`).

    Parameters
    ----------
    process
        Cutter, engagement, feed and edge radius; its coefficients and exponents are not used.
    depth : m
        Axial depth of cut.
    offsets : (teeth,), m
        By how much the radius of each tooth is enlarged.
    exponents : (3,)
        Exponents of the chip thickness, of any size.
    reference : m
        Chip thickness at which the coefficients hold.
    angles
        Number of angles of tooth 0, evenly spaced over a revolution from 0 on.
    tilts : (teeth,), m
        By how much the radius of each tooth is enlarged further at the upper end of the cut, and less at the tip: the
        axis of the cutter is tilted. None: it is not.

    Returns
    -------
    (6, angles, 3), m^2 and m
        For ``Ktc, Krc, Kac`` (Pa) and ``Kte, Kre, Kae`` (N/m), the force in X, Y and Z, N.
    """
    sine_edge, cosine_edge = math.sin(process.edge_angle), math.cos(process.edge_angle)
    step, turn = 2 * np.pi / angles, step_angles(angles)
    slices = max(1 if tilts is None else TILTED, math.ceil(process.lag(depth) / LAG))
    basis = np.zeros((6, angles, 3))
    for ahead, tooth in zip(process.tooth_angles, range(process.teeth), strict=True):
        for slice_depth in (np.arange(slices) + 0.5) / slices * depth:
            phi = (turn + ahead - process.lag(slice_depth) + np.pi / 2) % (2 * np.pi) - np.pi / 2
            # the part of each step that lies in the cut, and its middle: entry and exit fall between two angles
            low, high = np.maximum(phi - step / 2, process.start_angle), np.minimum(phi + step / 2, process.exit_angle)
            phi = np.where(high > low, (low + high) / 2, phi)
            share = np.maximum(high - low, 0.0) / step
            radii = offsets if tilts is None else offsets + tilts * (2 * slice_depth / depth - 1)
            thickness = chip_thickness(process, radii, tooth, phi)
            engaged = share * (thickness > 0) * depth / slices
            chips = equivalent_chips(thickness, exponents, reference, process.chip_law.edge_radius)
            sine, cosine, zero = np.sin(phi), np.cos(phi), np.zeros_like(phi)
            directions = (
                np.column_stack([-cosine, sine, zero]),
                np.column_stack([-sine_edge * sine, -sine_edge * cosine, zero + cosine_edge]),
                np.column_stack([-cosine_edge * sine, -cosine_edge * cosine, zero - sine_edge]),
            )
            for k, direction in enumerate(directions):
                basis[k] += (engaged * chips[:, k])[:, None] * direction
                basis[3 + k] += (engaged / sine_edge)[:, None] * direction
    return basis


def step_angles(angles: int) -> Real:
    """Return evenly spaced angles of a revolution, (angles,), rad."""
    return np.asarray(2 * np.pi * np.arange(angles) / angles)


@lru_cache(maxsize=KEPT)
def basis_spectra(
    process: MillingProcess,
    depth: float,
    offsets: tuple[float, ...],
    top: int,
    exponents: tuple[float, ...],
    reference: float,
    tilts: tuple[float, ...] | None = None,
) -> Complex:
    """Return the Fourier coefficients of :func:`force_basis` at the spindle orders 0 to ``top``, (6, top + 1, 3).

    ``F(angle) = c_0 + 2 Re sum_k c_k exp(i k angle)``.
    """
    tilted = None if tilts is None else np.array(tilts)
    force = force_basis(process, depth, np.array(offsets), np.array(exponents), reference, tilts=tilted)
    spectrum = np.fft.rfft(force, axis=1) / FINE
    return np.asarray(spectrum[:, : top + 1])
