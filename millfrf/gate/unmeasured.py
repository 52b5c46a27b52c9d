"""Warnings about lobes that rest on dynamics that were not measured: outside the band, or cross terms."""

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import InputError, Real, listed
from millfrf.cutting import MillingProcess
from millfrf.stability import (
    RobustCut,
    StabilityLobes,
    UnmeasuredDynamics,
    cross_term_effect,
    largest_unmeasured_part,
    unmeasured_dynamics,
)
from modal_fit import ModalModel

LOWEST_MODE_REMEDY = (
    "or, where you know that neither machine nor workpiece has a mode below a frequency, state it with `--lowest-mode` "
    "of the fit"
)


def check_band_of_lobes(structure: Frf | ModalModel, lobes: StabilityLobes, process: MillingProcess) -> list[str]:
    """Return a warning for each reason why limits are ``unmeasured``, with what to measure next.

    The reasons are a chatter frequency outside the measured band, a tooth passing above it, and harmonics of the tooth
    passing outside the band at which unmeasured modes may move the limit.

    Parameters
    ----------
    structure
        Receptance at the tool tip; without a band there are no warnings.
    lobes
        Depth limits of that structure, with the band of each (:func:`millfrf.stability.with_band`).
    process
        Milling process of the limits.
    """
    unmeasured = unmeasured_dynamics(structure)
    open_limits = np.array([word == "unmeasured" for word in lobes.band], dtype=bool)
    if unmeasured is None or not open_limits.any():
        return []
    (low, high), rpm, chatter = unmeasured.band, lobes.spindle_speeds_rpm, lobes.chatter_frequencies
    measured = f"the {low:g} to {high:g} Hz in which the structure was measured"
    warnings = []
    with np.errstate(invalid="ignore"):
        outside = open_limits & ((chatter < low) | (chatter > high))
    if outside.any():
        warnings.append(
            f"at {_speeds(rpm, outside)} the chatter frequency ({_span(chatter[outside])} Hz) lies outside {measured}: "
            "these limits are extrapolated; measure a wider band"
        )
    passing = process.teeth * rpm / 60
    beyond = open_limits & (passing > high) & ~outside
    if beyond.any():
        needed = highest_needed(float(passing[beyond].max()))
        warnings.append(
            f"at {_speeds(rpm, beyond)} the teeth pass at {_span(passing[beyond])} Hz, beyond {measured}; modes there "
            f"that the measurement does not exclude (up to {unmeasured.flexibility:.2g} m/N) may set the limit: "
            f"measure up to {needed:.3g} Hz (tap the tip), or lower the speed"
        )
    rest = open_limits & ~outside & ~beyond
    if rest.any():
        what = f"harmonics of the tooth passing outside {measured} influence the limit: modes there that the "
        what += "measurement does not exclude"
        if unmeasured.cross_terms is not None:
            what = f"cross terms that were not measured, or modes outside {measured},"
        warnings.append(
            f"at {_speeds(rpm, rest)} {what} may move the limit by more than 5 %; "
            f"{_remedy(structure, lobes, process, unmeasured, rest)}"
        )
    return warnings


def highest_needed(passing: float) -> float:
    """Return the frequency (Hz) up to which the structure is needed for a cut with this tooth passing (Hz).

    Above twice the tooth passing, modes have only the limit that does not depend on speed.
    """
    return 2 * passing


def _remedy(
    structure: Frf | ModalModel,
    lobes: StabilityLobes,
    process: MillingProcess,
    unmeasured: UnmeasuredDynamics,
    chosen: NDArray[np.bool_],
) -> str:
    """Name the frequency at which unmeasured modes have the largest effect on the lowest of the chosen limits."""
    low, high = unmeasured.band
    worst = int(np.argmin(np.where(chosen, lobes.depth_limits, np.inf)))
    speed, depth = float(lobes.spindle_speeds[worst]), 0.95 * float(lobes.depth_limits[worst])
    bounded = process.is_helical and bool(np.isfinite(depth))
    beyond = f"measure and fit beyond {high:.4g} Hz (tap the tip)"
    other = "hit each direction and measure the other, too"
    if not bounded:
        return beyond if unmeasured.cross_terms is None else other
    try:
        if unmeasured.cross_terms is not None:
            part, _ = largest_unmeasured_part(structure, process, unmeasured, speed, depth)
            where = {"below": f"below {low:.4g} Hz", "inside": "inside the band"}.get(part)
            better = f"most of it is noise of the measurement {where}: hit harder and more often, or record longer"
            return other if where is None else better
        at = RobustCut(structure, process, unmeasured).gain(speed, depth).frequency
    except InputError:
        return beyond
    if at < low:
        return f"the largest effect is at {at:.3g} Hz: measure and fit from a lower frequency on, {LOWEST_MODE_REMEDY}"
    if at <= high:
        return "the largest effect is inside the band, near its edge: fit a wider band"
    return f"the largest effect is at {at:.3g} Hz: measure and fit beyond it (tap the tip)"


def _speeds(rpm: NDArray[np.float64], chosen: NDArray[np.bool_]) -> str:
    count, low, high = int(chosen.sum()), float(rpm[chosen].min()), float(rpm[chosen].max())
    span = f"{low:.0f} rpm" if count == 1 else f"{low:.0f} to {high:.0f} rpm"
    return f"{count} of {len(rpm)} speeds ({span})"


def _span(values: NDArray[np.float64]) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"


def cross_term_warnings(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float
) -> list[str]:
    """Return a warning that states cross terms that were not measured, and what small ones change in the limits.

    Parameters
    ----------
    structure
        Receptance at the tool tip, which states what was not measured.
    process
        Milling process of the limits.
    spindle_speeds : (n_speeds,), rad/s
        Speeds of the limits.
    max_depth : m
        Largest axial depth that is searched.
    """
    if structure.measured is None:
        return []
    effect = cross_term_effect(structure, process, spindle_speeds, max_depth)
    assumed = f"{structure.unmeasured} (response / force) was not measured and is taken as 0"
    if effect is None:
        return [
            f"{assumed}: what that changes in the limits is not known; hit each direction and measure the other, too"
        ]
    return [
        f"{assumed}: small cross terms, +-{100 * effect.share:g} % of the direct ones, lower limits by up to "
        f"{100 * effect.lowered:.2g} % (at {effect.speed * 30 / np.pi:.0f} rpm) and raise them by up to "
        f"{100 * effect.raised:.2g} %; {_modes_of_both(structure)}: hit each direction and measure the other, too"
    ]


def _modes_of_both(structure: Frf | ModalModel) -> str:
    """Return a clause on modes that overlap with one of another direction: they may be one mode at an angle to both."""
    angle = "a mode at an angle to both directions has cross terms as large as its direct ones"
    if not isinstance(structure, ModalModel) or structure.measured is None:
        return angle
    natural, width = structure.natural_frequencies, np.abs(structure.poles.real) / (2 * np.pi)
    moves = np.abs(structure.right) > 0
    apart = ~(moves[:, None, :] & moves[None, :, :]).any(axis=2)
    near = np.abs(natural[:, None] - natural) < width[:, None] + width
    first = np.flatnonzero((apart & near & (natural[:, None] <= natural)).any(axis=1))
    if not len(first):
        return angle
    shared = listed(list(dict.fromkeys(f"{natural[mode]:.4g}" for mode in first)))
    return f"at {shared} Hz both directions have a mode: if it is one at an angle to both, they are as large as those"
