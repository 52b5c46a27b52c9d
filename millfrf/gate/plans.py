"""Checks of sweep plans: feasible demands, and sweeps of a practical duration."""

import math

from estimation import SweepDemand, SweepPlan
from millfrf.core import InputError
from millfrf.cutting import MillingProcess

from .cutting_data import check_depth
from .settings import GATE


def check_demand(
    band: tuple[float, float], depth: float, noise: float, widths_deg: tuple[float, ...], cutter: MillingProcess
) -> list[str]:
    """Check the demands on a plan before it is computed.

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
        Warnings of :func:`check_depth`.

    Raises
    ------
    InputError
        A band that no spindle can sweep, or an impossible value.
    """
    warnings = check_depth(depth, cutter, "depth_m")
    low, high = (60 * f / cutter.teeth for f in band)
    if 0 < band[0] < band[1] and not (low >= GATE.rpm_min and high <= GATE.rpm_max):
        raise InputError(
            f"band_hz {band[0]:g} to {band[1]:g} Hz needs {low:.3g} to {high:.3g} rpm with {cutter.teeth} teeth; "
            f"spindles turn at {GATE.rpm_min:g} to {GATE.rpm_max:g} rpm: give a band that they sweep"
        )
    if noise > GATE.accelerometer_noise_max:
        raise InputError(
            f"acceleration_noise = {noise:g} m/s^2/sqrt(Hz) is above {GATE.accelerometer_noise_max:g}: no "
            "accelerometer is so noisy; is it in ug/sqrt(Hz) (times 1e-5)?"
        )
    for width in widths_deg:
        if not (math.isfinite(width) and 0 < width <= 180):
            raise InputError(f"immersion_widths_deg: {width:g} is not within 0 to 180 degrees")
    if widths_deg and max(widths_deg) <= GATE.radians_max:
        listed = ", ".join(f"{width:g}" for width in widths_deg)
        raise InputError(
            f"immersion_widths_deg = {listed} are too small for sweeps: were they given in radians? Give degrees"
        )
    return warnings


def check_duration(plan: SweepPlan, demand: SweepDemand) -> list[str]:
    """Check the duration of the planned sweeps, and return a warning if it is long.

    Raises
    ------
    InputError
        A sweep takes more than a day's work.
    """
    seconds = plan.duration
    remedy = (
        f"widen resolution_hz = {demand.resolution:g}, allow a larger frf_error_m_per_n = {demand.frf_error:g}, cut "
        f"deeper than depth_m = {demand.depth:g}, or raise the band's lower end of {demand.band[0]:g} Hz"
    )
    if seconds > GATE.sweep_max:
        raise InputError(f"each sweep would take {_long(seconds)}, more than {_long(GATE.sweep_max)}; {remedy}")
    if seconds > GATE.sweep_long:
        return [f"each sweep takes {_long(seconds)}; to shorten it {remedy}"]
    return []


def _long(seconds: float) -> str:
    """Format a duration in the largest unit in which it is at least 2."""
    for size, unit in ((365.25 * 86400, "years"), (86400, "days"), (3600, "hours"), (60, "minutes")):
        if seconds >= 2 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds:.3g} s"
