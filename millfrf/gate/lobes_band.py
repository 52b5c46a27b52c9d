"""Checks of lobes whose chatter frequency or tooth passing lies outside the measured band."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import Band, InputError
from millfrf.cutting import MillingProcess
from millfrf.stability import (
    LimitSensitivity,
    StabilityLobes,
    known_lines,
    limit_sensitivities,
    with_residual_flexibility,
    zero_order,
)
from modal_fit import ModalModel

from .settings import GATE

AVERAGED = ("zero-order", "nyquist")  # methods whose limits do not depend on harmonics, as their warnings state


def band_of_structure(structure: Frf | ModalModel) -> Band | None:
    """Return the band that a structure states, else the band of the valid lines of an FRF; None if it is not known."""
    if structure.band is not None or isinstance(structure, ModalModel):
        return structure.band
    lines = structure.frequencies[structure.valid & (structure.frequencies > 0)]
    return (float(lines[0]), float(lines[-1])) if len(lines) > 1 else None


def check_band_of_lobes(structure: Frf | ModalModel, lobes: StabilityLobes, process: MillingProcess) -> list[str]:
    """Return warnings about speeds whose limits depend on dynamics outside the measured band.

    Three things can lie outside the band:

    - the chatter frequency;
    - the tooth passing, at speeds where the limit is so high (infinite, or four times the lowest limit) that a stiffer
      mode at an unmeasured frequency would lower it;
    - harmonics of the tooth passing about the chatter frequency, if the possible flexibility there (a tenth of the
      largest, or as much as the upper end of the band allows) would move the limit by more than 5 %.

    Parameters
    ----------
    structure
        Receptance at the tool tip; without a band there are no warnings.
    lobes
        Depth limits of that structure.
    process
        Milling process of the limits.
    """
    if isinstance(structure, Frf):
        structure, _ = known_lines(structure)
    band = band_of_structure(structure)
    if band is None:
        return []
    rpm, chatter = lobes.spindle_speeds_rpm, lobes.chatter_frequencies
    warnings = []
    outside = _chatter_outside(lobes, band)
    if outside.any():
        warnings.append(
            f"at {_speeds(rpm, outside)} the chatter frequency ({_span(chatter[outside])} Hz) lies outside the "
            f"{band[0]:g} to {band[1]:g} Hz in which the structure was measured: these limits are extrapolated; "
            "measure a wider band"
        )
    passing = process.teeth * rpm / 60
    beyond = _passing_beyond(structure, lobes, process, band) & ~outside
    if beyond.any():
        warnings.append(
            f"at {_speeds(rpm, beyond)} the teeth pass at {_span(passing[beyond])} Hz, beyond the {band[0]:g} to "
            f"{band[1]:g} Hz in which the structure was measured, and the limit is over {GATE.limit_ratio:g} times the "
            "lowest: a mode that was not measured may set the limit there; measure up to the teeth's frequency"
        )
    return warnings + _moved_from_outside(structure, lobes, process, band, np.isfinite(chatter) & ~outside)


def limits_inside_band(structure: Frf | ModalModel, lobes: StabilityLobes, process: MillingProcess) -> StabilityLobes:
    """Replace the limits that depend on dynamics outside the measured band by NaN (not known).

    Parameters
    ----------
    structure
        Receptance at the tool tip; without a band all limits stay.
    lobes
        Depth limits of that structure.
    process
        Milling process of the limits.
    """
    if isinstance(structure, Frf):
        structure, _ = known_lines(structure)
    band = band_of_structure(structure)
    if band is None:
        return lobes
    unknown = _chatter_outside(lobes, band) | _passing_beyond(structure, lobes, process, band)
    return replace(lobes, depth_limits=np.where(unknown, np.nan, lobes.depth_limits))


def _chatter_outside(lobes: StabilityLobes, band: Band) -> NDArray[np.bool_]:
    """Return the speeds at which the chatter frequency lies outside the band."""
    chatter = lobes.chatter_frequencies
    with np.errstate(invalid="ignore"):
        return np.asarray(np.isfinite(chatter) & ((chatter < band[0]) | (chatter > band[1])))


def _passing_beyond(
    structure: Frf | ModalModel, lobes: StabilityLobes, process: MillingProcess, band: Band
) -> NDArray[np.bool_]:
    """Return the speeds whose tooth passing lies above the band and whose limit a mode at this frequency may lower."""
    passing = process.teeth * lobes.spindle_speeds_rpm / 60
    if not (passing > band[1]).any():
        return np.zeros(len(passing), dtype=bool)
    lowest = _lowest_limit(structure, process, band)
    return np.asarray((passing > band[1]) & ~(lobes.depth_limits < GATE.limit_ratio * lowest))


def _moved_from_outside(
    structure: Frf | ModalModel, lobes: StabilityLobes, process: MillingProcess, band: Band, in_band: NDArray[np.bool_]
) -> list[str]:
    """Return a warning if harmonics outside the band would move limits whose chatter frequency lies in the band.

    The shift is ``sum_q |weights[q]| u (edge / f_q)^2`` over the lines f_q of the motion outside the band, with the
    weights of :class:`millfrf.stability.LimitSensitivity`. Below the band, the unknown flexibility u is a share of the
    largest flexibility in the band; above the band, the flexibility at its upper end bounds u. Limits from averaged
    coefficients do not depend on such lines.
    """
    if lobes.method in AVERAGED:
        return []
    places = np.flatnonzero(in_band)
    chosen = places[np.linspace(0, len(places) - 1, min(GATE.shift_speeds, len(places))).astype(int)]
    largest, at_edge = _flexibilities(structure, band)
    below = GATE.unknown_flexibility * largest
    above = min(below, GATE.edge_amplification * at_edge)
    shifts = []
    sensitivities = _sensitivities(structure, process, lobes, chosen)
    for sensitivity, depth in zip(sensitivities, lobes.depth_limits[chosen], strict=True):
        if sensitivity is not None:
            lines = np.abs(sensitivity.lines)
            beyond = np.where(lines > band[1], above * (band[1] / np.maximum(lines, band[1])) ** 2, 0.0)
            unknown = np.where(lines < band[0], below, beyond)
            shifts.append(float(np.linalg.norm(sensitivity.weights, axis=(1, 2)) @ unknown) / float(depth))
    moved = np.array(shifts) > GATE.limit_shift
    if not moved.any():
        return []
    return [
        f"at {int(moved.sum())} of the {len(moved)} speeds that were checked, harmonics of the tooth passing outside "
        f"the {band[0]:g} to {band[1]:g} Hz in which the structure was measured influence the limit: a mode there with "
        f"{100 * above / largest:.2g} % of the largest flexibility in the band would shift limits by up to "
        f"{100 * max(shifts):.0f} % (to first order); measure and fit a wider band to exclude it"
    ]


def _sensitivities(
    structure: Frf | ModalModel, process: MillingProcess, lobes: StabilityLobes, chosen: NDArray[np.int64]
) -> list[LimitSensitivity | None]:
    """Return the sensitivities of some limits; None for a helix, an unequal pitch, or a limit of another solver."""
    selection = replace(
        lobes,
        spindle_speeds=lobes.spindle_speeds[chosen],
        depth_limits=lobes.depth_limits[chosen],
        chatter_frequencies=lobes.chatter_frequencies[chosen],
        bifurcations=tuple(lobes.bifurcations[k] for k in chosen),
        status=tuple(lobes.status[k] for k in chosen),
    )
    try:
        return limit_sensitivities(structure, process, selection)
    except InputError:
        return [None] * len(chosen)


def _flexibilities(structure: Frf | ModalModel, band: Band) -> tuple[float, float]:
    """Return the largest Frobenius norm of the receptance in the band, and the median at the band's upper end, m/N."""
    if isinstance(structure, ModalModel):
        natural = structure.natural_frequencies
        peaks = natural[(natural >= band[0]) & (natural <= band[1])]
        lines = np.unique(np.concatenate([np.linspace(max(band[0], 1e-3 * band[1]), band[1], GATE.model_lines), peaks]))
        values = with_residual_flexibility(structure).receptance(lines)
    else:
        positive = structure.valid & (structure.frequencies > 0)
        lines, values = structure.frequencies[positive], structure.values[positive]
    size = np.linalg.norm(values, axis=(1, 2))
    end = size[lines >= band[1] - GATE.band_edge * (band[1] - band[0])]
    return float(size.max()), float(np.median(end))


def _lowest_limit(structure: Frf | ModalModel, process: MillingProcess, band: Band) -> float:
    """Return the lowest zero-order limit (m) at speeds whose tooth passing lies in the band."""
    speeds = np.geomspace(max(band[0], 0.2 * band[1]), band[1], GATE.limit_speeds) * 2 * np.pi / process.teeth
    try:
        return float(zero_order(structure, process, speeds, 1e3).depth_limits.min())
    except InputError:
        return float("inf")  # no zero-order limit: only the chatter frequency is checked


def _speeds(rpm: NDArray[np.float64], chosen: NDArray[np.bool_]) -> str:
    count, low, high = int(chosen.sum()), float(rpm[chosen].min()), float(rpm[chosen].max())
    span = f"{low:.0f} rpm" if count == 1 else f"{low:.0f} to {high:.0f} rpm"
    return f"{count} of {len(rpm)} speeds ({span})"


def _span(values: NDArray[np.float64]) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"
