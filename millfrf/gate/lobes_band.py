"""Lobes outside the band that was measured: where chatter, or the passing of the teeth, lies beyond what is known."""

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess
from estimation import Frf
from foundation import Band, InputError
from modal_fit import ModalModel
from stability import StabilityLobes, zero_order

DECIDES = 4.0
"""Limit over the lowest of all speeds from which a mode outside the band may decide: one with a quarter of the dynamic
flexibility of the weakest mode inside, for the limit is inverse to it (Altintas & Budak 1995)."""

N_SPEEDS = 48


def band_of_structure(structure: Frf | ModalModel) -> Band | None:
    """The band that a structure states; of an FRF without one, that of its valid lines. None: not known."""
    if structure.band is not None or isinstance(structure, ModalModel):
        return structure.band
    lines = structure.frequencies[structure.valid & (structure.frequencies > 0)]
    return (float(lines[0]), float(lines[-1])) if len(lines) > 1 else None


def check_band_of_lobes(structure: Frf | ModalModel, lobes: StabilityLobes, process: MillingProcess) -> list[str]:
    """Say at which speeds the limits rest on dynamics outside the band that was measured.

    Two things can be outside: the chatter frequency itself; and the passing of the teeth, at speeds where the limit is
    so high (four times the lowest that the structure has at any speed, or none) that a stiffer mode at an unmeasured
    frequency would lower it.

    Parameters
    ----------
    structure
        Receptance at the tool tip; without a band nothing is said.
    lobes
        Its limits.
    process
        The cut they are for.

    Returns
    -------
    list of str
        Doubts.
    """
    band = band_of_structure(structure)
    if band is None:
        return []
    rpm, chatter = lobes.spindle_speeds_rpm, lobes.chatter_frequencies
    doubts = []
    with np.errstate(invalid="ignore"):
        outside = np.isfinite(chatter) & ((chatter < band[0]) | (chatter > band[1]))
    if outside.any():
        doubts.append(
            f"at {_speeds(rpm, outside)} the chatter frequency ({_span(chatter[outside])} Hz) lies outside the "
            f"{band[0]:g} to {band[1]:g} Hz in which the structure was measured: these limits are extrapolated; "
            "measure a wider band"
        )
    passing = process.teeth * rpm / 60
    lowest = _lowest_limit(structure, process, band)
    decided = (passing > band[1]) & ~outside & ~(lobes.depth_limits < DECIDES * lowest)
    if decided.any():
        doubts.append(
            f"at {_speeds(rpm, decided)} the teeth pass at {_span(passing[decided])} Hz, beyond the {band[0]:g} to "
            f"{band[1]:g} Hz in which the structure was measured, and the limit is over {DECIDES:g} times the lowest: "
            "a mode that was not measured may decide there; measure up to the teeth's frequency"
        )
    return doubts


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
