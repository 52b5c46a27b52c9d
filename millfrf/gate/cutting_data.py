"""Checks of cutting data: coefficients, engagement, spindle speeds, and what a recording states of its cut."""

import math
import os
import tomllib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import FileFormatError, InputError
from millfrf.cutting import MillingProcess, read_cutting_process
from modal_fit import ModalModel


@dataclass(frozen=True)
class Physical:
    """Limits of a number of a cutting file.

    Parameters
    ----------
    key
        Key of the number in the file.
    least, most
        Smallest and largest value in SI units; outside of them the number is refused.
    usual
        Usual range in SI units; outside of it the number is doubted.
    unit
        Unit in which the message shows the number.
    hint
        The mistake that is most likely.
    """

    key: str
    least: float
    most: float
    usual: tuple[float, float]
    unit: str
    hint: str


RANGES = (
    Physical("diameter_m", 1e-4, 0.5, (1e-3, 0.2), " m", "is it in mm"),
    Physical("ktc_pa", 1e6, 2e10, (1e7, 1e10), " Pa", "is it in MPa (times 1e6)"),
    Physical("krc", -3.0, 3.0, (-0.2, 1.5), "", "it is a share of ktc_pa: divide Krc by Ktc"),
    Physical("kac", -3.0, 3.0, (-1.0, 1.0), "", "it is a share of ktc_pa: divide Kac by Ktc"),
    Physical("feed_per_tooth_m", 0.0, 5e-3, (0.0, 1e-3), " m", "is it in mm"),
    Physical("kte_n_per_m", 0.0, 1e6, (1e3, 2e5), " N/m", "is it in N/mm (times 1000)"),
    Physical("kre_n_per_m", 0.0, 1e6, (1e3, 2e5), " N/m", "is it in N/mm (times 1000)"),
    Physical("kae_n_per_m", 0.0, 1e6, (1e2, 2e5), " N/m", "is it in N/mm (times 1000)"),
    Physical("runout_m", 0.0, 1e-3, (0.0, 2e-4), " m", "is it in um or mm"),
    Physical("process_damping_n_per_m", 0.0, 1e8, (1e2, 1e7), " N/m", "give C of C v_n / V in N/m of edge"),
    Physical("teeth", 1, 100, (1, 40), "", "give the number of cutting edges"),
)
"""Sources: docs/mistakes.md, section on ranges."""

MOST_RADIANS = 3.2
"""Degrees: an engagement that ends below this was most likely given in radians."""

SMALLEST_PITCH = 2e-4
"""Distance between teeth along the circumference below which no cutter is made, m."""


def read_checked_cutting(path: str | os.PathLike[str]) -> tuple[MillingProcess, list[str]]:
    """Read a cutting file and judge it.

    Returns
    -------
    process, doubts

    Raises
    ------
    InputError
        What :func:`millfrf.cutting.read_cutting_process` refuses, or a value that no machine has.
    """
    process = read_cutting_process(path)
    try:
        doubts = check_cutting(process)
    except InputError as error:
        raise FileFormatError(f"{path}: {error}") from error
    return process, [f"{os.fspath(path)}: {doubt}" for doubt in doubts]


def check_cutting(process: MillingProcess) -> list[str]:
    """Judge cutter, engagement and coefficients.

    Returns
    -------
    list of str
        Doubts: sentences for a warning; empty where nothing is odd.

    Raises
    ------
    InputError
        A value outside of the range that :data:`RANGES` states, or teeth closer than they can stand.
    """
    doubts = []
    for one in RANGES:
        doubts += _in_range(one, _value(process, one.key))
    pitch = math.pi * process.diameter / process.teeth
    if pitch < SMALLEST_PITCH:
        raise InputError(
            f"teeth = {process.teeth} on a diameter of {1e3 * process.diameter:g} mm stand {1e3 * pitch:.2g} mm apart, "
            f"less than {1e3 * SMALLEST_PITCH:g} mm: correct teeth or diameter_m"
        )
    return doubts + _angles(process)


def _value(process: MillingProcess, key: str) -> float:
    name = key.removesuffix("_n_per_m").removesuffix("_pa").removesuffix("_m")
    return float(getattr(process, name))


def _in_range(one: Physical, value: float) -> list[str]:
    if not one.least <= value <= one.most:
        raise InputError(
            f"{one.key} = {value:g}{one.unit} is outside of {one.least:g} to {one.most:g}{one.unit}: {one.hint}?"
        )
    low, high = one.usual
    if value == 0 or low <= value <= high:
        return []
    return [f"{one.key} = {value:g}{one.unit} is unusual ({low:g} to {high:g}{one.unit} in handbooks): {one.hint}?"]


def _angles(process: MillingProcess) -> list[str]:
    """Angles that look like radians."""
    doubts = []
    start, leave = math.degrees(process.start_angle), math.degrees(process.exit_angle)
    if leave <= MOST_RADIANS:
        doubts.append(
            f"the engagement is {start:.4g} to {leave:.4g} degrees: were start_angle_deg and exit_angle_deg given in "
            "radians? Give degrees"
        )
    elif leave - start < 1:
        doubts.append(f"the engagement of {leave - start:.2g} degrees is unusually short: check both angles")
    for key, angle in (("edge_angle_deg", process.edge_angle), ("helix_angle_deg", process.helix_angle)):
        if 0 < math.degrees(angle) < 2:
            doubts.append(
                f"{key} = {math.degrees(angle):.4g} is unusually small: was it given in radians? Give degrees"
            )
    if math.degrees(process.helix_angle) > 60:
        doubts.append(f"helix_angle_deg = {math.degrees(process.helix_angle):.4g} is unusually large: check it")
    return doubts


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


NEAR = 0.02
"""Share by which a typed speed may differ from the stated one."""

_FACTORS = ((math.pi / 30, "rad/s"), (1 / 60, "Hz"), (2 / 60, "tooth passings a second"))


@dataclass(frozen=True)
class StatedCut:
    """Numbers that a recording's set-up states about the cut; None where it says nothing.

    Parameters
    ----------
    rpm : rpm
        Constant spindle speed.
    sweep : rpm
        First and last spindle speed of a sweep.
    teeth
        Number of teeth of the cutter.
    """

    rpm: float | None = None
    sweep: tuple[float, float] | None = None
    teeth: int | None = None


def stated_cut(setup: str) -> StatedCut:
    """Read a recording's set-up (TOML); empty where it is no TOML."""
    try:
        tables = [table for table in tomllib.loads(setup).values() if isinstance(table, dict)]
    except tomllib.TOMLDecodeError:
        return StatedCut()
    first, last = (_first(tables, f"{which}_spindle_speed_rpm") for which in ("first", "last"))
    teeth = _first(tables, "teeth")
    return StatedCut(
        _first(tables, "spindle_speed_rpm"),
        None if first is None or last is None else (first, last),
        None if teeth is None else round(teeth),
    )


def _first(tables: list[dict[str, Any]], key: str) -> float | None:
    found = [table[key] for table in tables if isinstance(table.get(key), int | float)]
    return float(found[0]) if found else None


def check_one_speed(name: str, setup: str, process: MillingProcess, typed: float | None) -> list[str]:
    """Judge a recording that a job takes as a cut at one constant speed.

    Parameters
    ----------
    name
        Name of the recording.
    setup
        Set-up that it states, TOML text.
    process
        Milling process of the cutting file.
    typed : rpm
        Spindle speed that was typed; None: none was.

    Returns
    -------
    list of str
        Doubts: another speed or another number of teeth than stated.

    Raises
    ------
    InputError
        A sweep, a speed that no spindle reaches, or one that is the stated speed in another unit.
    """
    stated = stated_cut(setup)
    if stated.sweep is not None and abs(stated.sweep[1] - stated.sweep[0]) > NEAR * stated.sweep[0]:
        raise InputError(
            f"{name} states a sweep from {stated.sweep[0]:g} to {stated.sweep[1]:g} rpm; give a cut at one constant "
            "speed"
        )
    doubts = []
    if stated.teeth is not None and stated.teeth != process.teeth:
        doubts.append(
            f"{name} states {stated.teeth} teeth, the cutting file has teeth = {process.teeth}: correct one of them"
        )
    if typed is None:
        return doubts
    doubts += check_speed(typed, process)
    if stated.rpm is not None and abs(typed / stated.rpm - 1) > NEAR:
        for factor, unit in _FACTORS:
            if abs(typed / (factor * stated.rpm) - 1) < NEAR:
                raise InputError(
                    f"--speed {typed:g} rpm is what {name} states in {unit}: {stated.rpm:g} rpm; give rpm, or leave "
                    "--speed out"
                )
        doubts.append(f"--speed {typed:g} rpm, but {name} states {stated.rpm:g} rpm: check which is right")
    return doubts
