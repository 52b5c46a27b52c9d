"""Spindle speeds and depths that were typed: rpm and metres, not Hz, rad/s or mm."""

import math

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import InputError
from millfrf.cutting import MillingProcess
from modal_fit import ModalModel

MOST_RPM = 500_000.0
"""The fastest spindles that mill (air bearings, tools below 1 mm)."""

MOST_CUTTING_SPEED = 170.0
"""m/s, about 10 000 m/min: the fastest that anybody has milled aluminium with."""

MOST_DEPTH = 0.3
"""m: no cutting edge is longer."""

MOST_SPEEDS = 100_000

SLOW = 0.1
"""Tooth passing over the lowest mode below which speeds were most likely not meant in rpm."""


def check_speed(rpm: float, process: MillingProcess | None = None) -> list[str]:
    """Judge one spindle speed (rpm), with the cutter where it is known.

    Raises
    ------
    InputError
        A speed that is not positive or that no spindle reaches.
    """
    if not (math.isfinite(rpm) and rpm > 0):
        raise InputError(f"spindle speed {rpm:g} rpm must be positive")
    if rpm > MOST_RPM:
        raise InputError(f"spindle speed {rpm:g} rpm is above {MOST_RPM:g} rpm, which no spindle reaches; give rpm")
    if process is None:
        return []
    speed = math.pi * process.diameter * rpm / 60
    if speed <= MOST_CUTTING_SPEED:
        return []
    return [
        f"{rpm:g} rpm on a diameter of {1e3 * process.diameter:g} mm is a cutting speed of {60 * speed:.4g} m/min: "
        "check the speed (rpm) and diameter_m"
    ]


def check_speeds(
    speeds: tuple[float, float, int], process: MillingProcess, lowest_mode: float | None = None
) -> list[str]:
    """Judge an axis of spindle speeds: two in rpm and their number.

    Parameters
    ----------
    speeds
        Lowest and highest speed (rpm) and their number, as typed after ``--speeds``.
    process
        Milling process of the cutter.
    lowest_mode : Hz
        Lowest natural frequency of the structure; None: not known.

    Raises
    ------
    InputError
        A speed that no spindle reaches, or more speeds than a computer works through.
    """
    low, high, count = speeds
    if count > MOST_SPEEDS:
        raise InputError(f"{count} spindle speeds are more than {MOST_SPEEDS}; give fewer")
    doubts = check_speed(high, process) if high > 0 else []
    passing = process.teeth * high / 60
    if lowest_mode is not None and 0 < passing < SLOW * lowest_mode:
        doubts.append(
            f"at {low:g} to {high:g} rpm teeth pass at {process.teeth * low / 60:.3g} to {passing:.3g} Hz, far below "
            f"the lowest mode at {lowest_mode:.4g} Hz: are the speeds in Hz or rad/s? Give rpm"
        )
    return doubts


def check_depth(depth: float, process: MillingProcess | None = None, what: str = "largest depth") -> list[str]:
    """Judge a depth of cut (m).

    Raises
    ------
    InputError
        A depth that is not positive, or longer than any cutting edge.
    """
    if not (math.isfinite(depth) and depth > 0):
        raise InputError(f"{what} {depth:g} m must be positive, for example 0.005 (5 mm)")
    if depth > MOST_DEPTH:
        raise InputError(
            f"{what} {depth:g} m is above {MOST_DEPTH:g} m: is it in mm? Give metres, for example {1e-3 * depth:g}"
        )
    if process is not None and depth > 10 * process.diameter:
        return [
            f"{what} {1e3 * depth:g} mm is more than ten times the diameter of {1e3 * process.diameter:g} mm: "
            "check both; they are in metres"
        ]
    return []


def rigid_directions(structure: Frf | ModalModel) -> list[str]:
    """Doubt a structure that gives no force or no motion in one of X, Y, Z: lobes take the tool as rigid there."""
    known = [
        {label.partition(":")[2][-1:] for label in labels} for labels in (structure.responses, structure.excitations)
    ]
    missing = [axis for axis in "XYZ" if axis not in known[0] & known[1]]
    if not missing:
        return []
    node = structure.excitations[0].partition(":")[0]
    named = ", ".join(f"{node}:+{axis}" for axis in missing)
    return [f"force or motion at {named} is missing: the tool is taken as rigid there; measure all three directions"]


def lowest_frequency(natural: NDArray[np.float64]) -> float | None:
    """Lowest natural frequency, Hz; None without modes."""
    return float(np.min(natural)) if len(natural) else None
