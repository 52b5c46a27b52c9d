"""Lobes outside the band that was measured: where chatter, or the passing of the teeth, lies beyond what is known."""

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

DECIDES = 4.0
"""Limit over the lowest of all speeds from which a mode outside the band may decide: one with a quarter of the dynamic
flexibility of the weakest mode inside, for the limit is inverse to it (Altintas & Budak 1995)."""

N_SPEEDS, N_LINES = 48, 400

UNKNOWN = 0.1
"""Flexibility that a structure may have just outside its band, as a share of the largest inside; beyond it falls with
the square of the frequency, as that of a mass does."""

EDGE, AMPLIFIED = 0.05, 25.0
"""Share of the band at its upper end, and how much softer than there a mode beyond it may be: a mode of 2 % damping
leaves ``2 zeta`` of its largest flexibility below its resonance, where the band would show it."""

MOVED = 0.05
"""Relative shift of a limit by so much unknown flexibility, from which on it is said. In the demonstration, whose
milled model knows 13 to 25 Hz, shifts of 9 to 28 % are computed, and limits are off by up to 30 %, at one lobe more."""

AVERAGED = ("zero-order", "nyquist")
"""Methods whose limits do not depend on harmonics; they say so themselves."""

ASKED = 12
"""Speeds at which that shift is computed, at most."""


def band_of_structure(structure: Frf | ModalModel) -> Band | None:
    """The band that a structure states; of an FRF without one, that of its valid lines. None: not known."""
    if structure.band is not None or isinstance(structure, ModalModel):
        return structure.band
    lines = structure.frequencies[structure.valid & (structure.frequencies > 0)]
    return (float(lines[0]), float(lines[-1])) if len(lines) > 1 else None


def check_band_of_lobes(structure: Frf | ModalModel, lobes: StabilityLobes, process: MillingProcess) -> list[str]:
    """Say at which speeds the limits rest on dynamics outside the band that was measured.

    Three things can be outside: the chatter frequency itself; harmonics of the tooth passing about it, where a tenth of
    the largest flexibility there, or as much as the upper end of the band allows, would move the limit by more than a
    twentieth; and the passing of the teeth, at speeds
    where the limit is so high (four times the lowest that the structure has at any speed, or none) that a stiffer mode
    at an unmeasured frequency would lower it.

    Parameters
    ----------
    structure
        Receptance at the tool tip; without a band nothing is said.
    lobes
        Depth limits of that structure.
    process
        The cut they are for.

    Returns
    -------
    list of str
        Doubts: sentences for a warning; empty where nothing is odd.
    """
    if isinstance(structure, Frf):
        structure, _ = known_lines(structure)
    band = band_of_structure(structure)
    if band is None:
        return []
    rpm, chatter = lobes.spindle_speeds_rpm, lobes.chatter_frequencies
    doubts = []
    outside = _chatter_outside(lobes, band)
    if outside.any():
        doubts.append(
            f"at {_speeds(rpm, outside)} the chatter frequency ({_span(chatter[outside])} Hz) lies outside the "
            f"{band[0]:g} to {band[1]:g} Hz in which the structure was measured: these limits are extrapolated; "
            "measure a wider band"
        )
    passing = process.teeth * rpm / 60
    decided = _decided_beyond(structure, lobes, process, band) & ~outside
    if decided.any():
        doubts.append(
            f"at {_speeds(rpm, decided)} the teeth pass at {_span(passing[decided])} Hz, beyond the {band[0]:g} to "
            f"{band[1]:g} Hz in which the structure was measured, and the limit is over {DECIDES:g} times the lowest: "
            "a mode that was not measured may decide there; measure up to the teeth's frequency"
        )
    return doubts + _moved_from_outside(structure, lobes, process, band, np.isfinite(chatter) & ~outside)


def limits_inside_band(structure: Frf | ModalModel, lobes: StabilityLobes, process: MillingProcess) -> StabilityLobes:
    """The limits that rest on what was measured; at the other speeds they are not known (NaN).

    Parameters
    ----------
    structure
        Receptance at the tool tip; without a band all limits stay.
    lobes
        Depth limits of that structure.
    process
        The cut they are for.
    """
    if isinstance(structure, Frf):
        structure, _ = known_lines(structure)
    band = band_of_structure(structure)
    if band is None:
        return lobes
    unknown = _chatter_outside(lobes, band) | _decided_beyond(structure, lobes, process, band)
    return replace(lobes, depth_limits=np.where(unknown, np.nan, lobes.depth_limits))


def _chatter_outside(lobes: StabilityLobes, band: Band) -> NDArray[np.bool_]:
    """Speeds at which the chatter frequency lies outside the band."""
    chatter = lobes.chatter_frequencies
    with np.errstate(invalid="ignore"):
        return np.asarray(np.isfinite(chatter) & ((chatter < band[0]) | (chatter > band[1])))


def _decided_beyond(
    structure: Frf | ModalModel, lobes: StabilityLobes, process: MillingProcess, band: Band
) -> NDArray[np.bool_]:
    """Speeds at which the teeth pass beyond the band and the limit is so high that a mode there may decide."""
    passing = process.teeth * lobes.spindle_speeds_rpm / 60
    if not (passing > band[1]).any():
        return np.zeros(len(passing), dtype=bool)
    lowest = _lowest_limit(structure, process, band)
    return np.asarray((passing > band[1]) & ~(lobes.depth_limits < DECIDES * lowest))


def _moved_from_outside(
    structure: Frf | ModalModel, lobes: StabilityLobes, process: MillingProcess, band: Band, inside: NDArray[np.bool_]
) -> list[str]:
    """A doubt where harmonics outside the band would move limits whose chatter lies inside.

    The shift is ``sum_q |weights[q]| u (edge / f_q)^2`` over the lines f_q of the motion outside the band, with the
    weights of :class:`millfrf.stability.LimitSensitivity`. Below the band the unknown flexibility u is a share of the
    largest
    inside, above it no more than the upper end of the band allows. Averaged coefficients have no such lines.
    """
    if lobes.method in AVERAGED:
        return []
    places = np.flatnonzero(inside)
    chosen = places[np.linspace(0, len(places) - 1, min(ASKED, len(places))).astype(int)]
    largest, at_edge = _flexibilities(structure, band)
    above, below = min(UNKNOWN * largest, AMPLIFIED * at_edge), UNKNOWN * largest
    shifts = []
    for found, depth in zip(_sensitivities(structure, process, lobes, chosen), lobes.depth_limits[chosen], strict=True):
        if found is not None:
            lines = np.abs(found.lines)
            beyond = np.where(lines > band[1], above * (band[1] / np.maximum(lines, band[1])) ** 2, 0.0)
            unknown = np.where(lines < band[0], below, beyond)
            shifts.append(float(np.linalg.norm(found.weights, axis=(1, 2)) @ unknown) / float(depth))
    moved = np.array(shifts) > MOVED
    if not moved.any():
        return []
    return [
        f"at {int(moved.sum())} of the {len(moved)} speeds that were looked at, harmonics of the tooth passing outside "
        f"the {band[0]:g} to {band[1]:g} Hz in which the structure was measured have a say: a mode there that is as "
        f"soft as {100 * above / largest:.2g} % of the largest flexibility inside would shift limits by up to "
        f"{100 * max(shifts):.0f} % (to first order); measure and fit a wider band to exclude it"
    ]


def _sensitivities(
    structure: Frf | ModalModel, process: MillingProcess, lobes: StabilityLobes, chosen: NDArray[np.int64]
) -> list[LimitSensitivity | None]:
    """Give sensitivities of some limits; None without a first order (helix, unequal pitch, another solver's limit)."""
    some = replace(
        lobes,
        spindle_speeds=lobes.spindle_speeds[chosen],
        depth_limits=lobes.depth_limits[chosen],
        chatter_frequencies=lobes.chatter_frequencies[chosen],
        bifurcations=tuple(lobes.bifurcations[k] for k in chosen),
        status=tuple(lobes.status[k] for k in chosen),
    )
    try:
        return limit_sensitivities(structure, process, some)
    except InputError:
        return [None] * len(chosen)


def _flexibilities(structure: Frf | ModalModel, band: Band) -> tuple[float, float]:
    """Largest Frobenius norm of the receptance inside the band, and the median at its upper end, m/N."""
    if isinstance(structure, ModalModel):
        natural = structure.natural_frequencies
        peaks = natural[(natural >= band[0]) & (natural <= band[1])]
        lines = np.unique(np.concatenate([np.linspace(max(band[0], 1e-3 * band[1]), band[1], N_LINES), peaks]))
        values = with_residual_flexibility(structure).receptance(lines)
    else:
        inside = structure.valid & (structure.frequencies > 0)
        lines, values = structure.frequencies[inside], structure.values[inside]
    size = np.linalg.norm(values, axis=(1, 2))
    end = size[lines >= band[1] - EDGE * (band[1] - band[0])]
    return float(size.max()), float(np.median(end))


def _lowest_limit(structure: Frf | ModalModel, process: MillingProcess, band: Band) -> float:
    """Lowest zero-order limit at speeds whose teeth pass inside the band, where its modes decide, m."""
    speeds = np.geomspace(max(band[0], 0.2 * band[1]), band[1], N_SPEEDS) * 2 * np.pi / process.teeth
    try:
        return float(zero_order(structure, process, speeds, 1e3).depth_limits.min())
    except InputError:
        return float("inf")  # a cut that zero-order cannot judge: only chatter's own frequency is told


def _speeds(rpm: NDArray[np.float64], chosen: NDArray[np.bool_]) -> str:
    count, low, high = int(chosen.sum()), float(rpm[chosen].min()), float(rpm[chosen].max())
    span = f"{low:.0f} rpm" if count == 1 else f"{low:.0f} to {high:.0f} rpm"
    return f"{count} of {len(rpm)} speeds ({span})"


def _span(values: NDArray[np.float64]) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"
