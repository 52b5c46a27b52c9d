"""Plans of sweeps: demands that can be, speeds that a spindle has, durations that a laboratory has."""

import math

from estimation import SweepDemand, SweepPlan
from millfrf.core import InputError
from millfrf.cutting import MillingProcess

from .cutting_data import MOST_RADIANS, MOST_RPM, check_depth

SLOWEST_RPM = 1.0
"""Below it no spindle turns evenly."""

LONGEST_SWEEP = 8 * 3600.0
"""A day's work, s: longer sweeps are refused."""

TIRING_SWEEP = 1800.0
"""Half an hour, s: longer sweeps are doubted."""

MOST_NOISE = 1.0
"""m/s^2/sqrt(Hz): an accelerometer is 10 to 10 000 times quieter."""


def check_demand(
    band: tuple[float, float], depth: float, noise: float, widths_deg: tuple[float, ...], cutter: MillingProcess
) -> list[str]:
    """Judge the demands on a plan before it is computed.

    Parameters
    ----------
    band : Hz
        Lowest and highest frequency to be excited.
    depth : m
        Axial depth of the sweeps.
    noise : m/s^2/sqrt(Hz)
        Noise density of the accelerometers.
    widths_deg : degrees
        Immersion widths of the sweeps.
    cutter
        Milling process of the cutter that sweeps the band.

    Returns
    -------
    list of str
        Doubts: sentences for a warning; empty where nothing is odd.

    Raises
    ------
    InputError
        A band that no spindle sweeps, or a value beyond what there is.
    """
    doubts = check_depth(depth, cutter, "depth_m")
    low, high = (60 * f / cutter.teeth for f in band)
    if 0 < band[0] < band[1] and not (low >= SLOWEST_RPM and high <= MOST_RPM):
        raise InputError(
            f"band_hz {band[0]:g} to {band[1]:g} Hz asks for {low:.3g} to {high:.3g} rpm with {cutter.teeth} teeth; "
            f"spindles turn at {SLOWEST_RPM:g} to {MOST_RPM:g} rpm: give a band that they sweep"
        )
    if noise > MOST_NOISE:
        raise InputError(
            f"acceleration_noise = {noise:g} m/s^2/sqrt(Hz) is above {MOST_NOISE:g}: no accelerometer is so loud; "
            "is it in ug/sqrt(Hz) (times 1e-5)?"
        )
    for width in widths_deg:
        if not (math.isfinite(width) and 0 < width <= 180):
            raise InputError(f"immersion_widths_deg: {width:g} is not within 0 to 180 degrees")
    if widths_deg and max(widths_deg) <= MOST_RADIANS:
        listed = ", ".join(f"{width:g}" for width in widths_deg)
        raise InputError(
            f"immersion_widths_deg = {listed} are too small for sweeps: were they given in radians? Give degrees"
        )
    return doubts


def check_duration(plan: SweepPlan, demand: SweepDemand) -> list[str]:
    """Judge how long the planned sweeps take.

    Raises
    ------
    InputError
        Longer than a day's work.
    """
    seconds = plan.duration
    remedy = (
        f"widen resolution_hz = {demand.resolution:g}, allow a larger frf_error_m_per_n = {demand.frf_error:g}, cut "
        f"deeper than depth_m = {demand.depth:g}, or raise the band's lower end of {demand.band[0]:g} Hz"
    )
    if seconds > LONGEST_SWEEP:
        raise InputError(f"each sweep would take {_long(seconds)}, more than {_long(LONGEST_SWEEP)}; {remedy}")
    if seconds > TIRING_SWEEP:
        return [f"each sweep takes {_long(seconds)}; to shorten it {remedy}"]
    return []


def _long(seconds: float) -> str:
    """A duration in the unit that a reader takes in."""
    for size, unit in ((365.25 * 86400, "years"), (86400, "days"), (3600, "hours"), (60, "minutes")):
        if seconds >= 2 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds:.3g} s"
