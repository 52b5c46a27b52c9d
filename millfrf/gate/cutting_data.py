"""Checks of cutting data: coefficients, engagement, spindle speeds, and what a recording states of its cut."""

import json
import math
import os
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import FileFormatError, InputError, tables_of_setup
from millfrf.cutting import MillingProcess, approach_angle_of, read_cutter, read_cutting_process
from modal_fit import ModalModel

from .settings import GATE


@dataclass(frozen=True)
class Physical:
    """Limits of one number of a cutting file, all in the unit of its key."""

    key: str
    least: float  # a value outside of least to most is refused
    most: float
    usual: tuple[float, float]  # a value outside this range gives a warning
    unit: str  # for the message
    hint: str  # the most likely mistake


# Sources: docs/mistakes.md, section on ranges
RANGES = (
    Physical("diameter_m", 1e-4, 0.5, (1e-3, 0.2), " m", "is it in mm"),
    Physical("ktc_pa", 1e6, 2e10, (1e7, 1e10), " Pa", "is it in MPa (times 1e6), or were forces in kN (times 1000)"),
    Physical("krc", -3.0, 3.0, (-0.2, 1.5), "", "it is a share of ktc_pa: divide Krc by Ktc"),
    Physical("kac", -3.0, 3.0, (-1.0, 1.0), "", "it is a share of ktc_pa: divide Kac by Ktc"),
    Physical("feed_per_tooth_m", 0.0, 5e-3, (0.0, 1e-3), " m", "is it in mm"),
    Physical("kte_n_per_m", 0.0, 1e6, (1e3, 2e5), " N/m", "is it in N/mm (times 1000)"),
    Physical("kre_n_per_m", 0.0, 1e6, (1e3, 2e5), " N/m", "is it in N/mm (times 1000)"),
    Physical("kae_n_per_m", 0.0, 1e6, (1e2, 2e5), " N/m", "is it in N/mm (times 1000)"),
    Physical("ktc_exponent", 0.0, 0.99, (0.05, 0.5), "", "is it 1 - m; give m, 0.25 of many steels"),
    Physical("krc_exponent", 0.0, 0.99, (0.05, 0.8), "", "is it 1 - m; give m"),
    Physical("kac_exponent", 0.0, 0.99, (0.05, 0.8), "", "is it 1 - m; give m"),
    Physical("reference_chip_m", 1e-6, 1e-2, (1e-5, 2e-3), " m", "is it in mm"),
    Physical("edge_radius_m", 0.0, 1e-3, (5e-7, 1e-4), " m", "is it in um or mm"),
    Physical("runout_m", 0.0, 1e-3, (0.0, 2e-4), " m", "is it in um or mm"),
    Physical("process_damping_n_per_m", 0.0, 1e8, (1e2, 1e7), " N/m", "give C of C v_n / V in N/m of edge"),
    Physical("teeth", 1, 100, (1, 40), "", "give the number of cutting edges"),
)


def read_checked_cutting(path: str | os.PathLike[str]) -> tuple[MillingProcess, list[str]]:
    """Read a cutting file and check it.

    Returns
    -------
    process
        Milling process of the file.
    warnings
        Warnings of :func:`check_cutting` and those that were written with the coefficients, each with the name of the
        file.

    Raises
    ------
    InputError
        What :func:`millfrf.cutting.read_cutting_process` refuses, or a value that no machine has.
    """
    process, warnings = _checked(read_cutting_process(path), path)
    stored = (f"{os.fspath(path)}: {text}" for text in _comments(path, "warning: "))
    return process, list(dict.fromkeys([*warnings, *stored]))


def cutting_provenance(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the provenance in the comments of a cutting file that ``cut identify`` wrote; empty without one."""
    for text in _comments(path, "provenance: "):
        try:
            stored = json.loads(text)
        except ValueError:  # edited by hand
            continue
        if isinstance(stored, dict):
            return stored
    return {}


def _comments(path: str | os.PathLike[str], kind: str) -> list[str]:
    """Return the comments of a kind at the head of a cutting file, without the kind."""
    begin = f"# {kind}"
    lines = Path(path).read_text(encoding="utf-8").splitlines()
    return [line.removeprefix(begin) for line in takewhile(lambda line: line.startswith("#"), lines)
            if line.startswith(begin)]  # fmt: skip


def read_checked_cutter(path: str | os.PathLike[str]) -> tuple[MillingProcess, list[str]]:
    """Read a cutting file whose force coefficients may be missing, and check it as :func:`read_checked_cutting`."""
    return _checked(read_cutter(path), path)


def _checked(process: MillingProcess, path: str | os.PathLike[str]) -> tuple[MillingProcess, list[str]]:
    try:
        warnings = check_cutting(process)
    except InputError as error:
        raise FileFormatError(f"{path}: {error}") from error
    return process, [f"{os.fspath(path)}: {warning}" for warning in warnings]


def check_cutting(process: MillingProcess) -> list[str]:
    """Check cutter, engagement and cutting coefficients, and return warnings about unusual values.

    Raises
    ------
    InputError
        A value that is physically impossible (``RANGES``), or teeth that are too close together.
    """
    warnings = [warning for limits in RANGES for warning in check_range(limits, _value(process, limits.key))]
    pitch = math.pi * process.diameter / process.teeth
    if pitch < GATE.tooth_distance_min:
        raise InputError(
            f"teeth = {process.teeth} on a diameter of {1e3 * process.diameter:g} mm stand {1e3 * pitch:.2g} mm apart, "
            f"less than {1e3 * GATE.tooth_distance_min:g} mm: correct teeth or diameter_m"
        )
    law = process.chip_law
    if law.varies and process.thickest_chip < law.edge_radius:
        warnings.append(
            f"the thickest chip of {1e6 * process.thickest_chip:.3g} um is below the edge radius of "
            f"{1e6 * law.edge_radius:.3g} um, where the exponents say nothing: check feed_per_tooth_m and edge_radius_m"
        )
    return warnings + _check_angles(process)


def check_feed(feed: float) -> list[str]:
    """Check a feed per tooth (m), and return warnings; raise InputError for one that no cutter takes."""
    return check_range(next(limits for limits in RANGES if limits.key == "feed_per_tooth_m"), feed)


def _value(process: MillingProcess, key: str) -> float:
    law = process.chip_law
    if key in _OF_LAW:
        return (*law.exponents, law.reference, law.edge_radius)[_OF_LAW.index(key)]
    name = key.removesuffix("_n_per_m").removesuffix("_pa").removesuffix("_m")
    return float(getattr(process, name))


_OF_LAW = ("ktc_exponent", "krc_exponent", "kac_exponent", "reference_chip_m", "edge_radius_m")


def check_range(limits: Physical, value: float) -> list[str]:
    """Return a warning about an unusual value; raise InputError for one that is physically impossible."""
    key, unit = limits.key, limits.unit
    if not limits.least <= value <= limits.most:
        raise InputError(
            f"{key} = {value:g}{unit} is outside of {limits.least:g} to {limits.most:g}{unit}: {limits.hint}?"
        )
    low, high = limits.usual
    if value == 0 or low <= value <= high:  # 0 means that the effect is not modelled
        return []
    return [f"{key} = {value:g}{unit} is unusual ({low:g} to {high:g}{unit} in handbooks): {limits.hint}?"]


def _check_angles(process: MillingProcess) -> list[str]:
    """Return warnings about angles that were probably given in radians."""
    warnings = []
    start, leave = math.degrees(process.start_angle), math.degrees(process.exit_angle)
    if leave <= GATE.radians_max:
        warnings.append(
            f"the engagement is {start:.4g} to {leave:.4g} degrees: were start_angle_deg and exit_angle_deg given in "
            "radians? Give degrees"
        )
    elif leave - start < 1:
        warnings.append(f"the engagement of {leave - start:.2g} degrees is unusually short: check both angles")
    for key, angle in (("edge_angle_deg", approach_angle_of(process)), ("helix_angle_deg", process.helix_angle)):
        if 0 < math.degrees(angle) < 2:
            warnings.append(
                f"{key} = {math.degrees(angle):.4g} is unusually small: was it given in radians? Give degrees"
            )
    if math.degrees(process.helix_angle) > 60:
        warnings.append(f"helix_angle_deg = {math.degrees(process.helix_angle):.4g} is unusually large: check it")
    return warnings


def check_speed(rpm: float, process: MillingProcess | None = None) -> list[str]:
    """Check one spindle speed (rpm), and its cutting speed where the cutter is known.

    Raises
    ------
    InputError
        A speed that is not positive or that no spindle reaches.
    """
    if not (math.isfinite(rpm) and rpm > 0):
        raise InputError(f"spindle speed {rpm:g} rpm must be positive")
    if rpm > GATE.rpm_max:
        raise InputError(f"spindle speed {rpm:g} rpm is above {GATE.rpm_max:g} rpm, which no spindle reaches; give rpm")
    if process is None:
        return []
    speed = math.pi * process.diameter * rpm / 60
    if speed <= GATE.cutting_speed_max:
        return []
    return [
        f"{rpm:g} rpm on a diameter of {1e3 * process.diameter:g} mm is a cutting speed of {60 * speed:.4g} m/min: "
        "check the speed (rpm) and diameter_m"
    ]


def check_speeds(
    speeds: tuple[float, float, int], process: MillingProcess, lowest_mode: float | None = None
) -> list[str]:
    """Check an axis of spindle speeds, and return warnings.

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
        A speed that no spindle reaches, or more speeds than a computer can process.
    """
    low, high, count = speeds
    if count > GATE.speeds_max:
        raise InputError(f"{count} spindle speeds are more than {GATE.speeds_max}; give fewer")
    warnings = check_speed(high, process) if high > 0 else []
    passing = process.teeth * high / 60
    if process.is_turning:  # a lathe turns far slower than its modes
        return warnings
    if lowest_mode is not None and 0 < passing < GATE.slow_passing * lowest_mode:
        warnings.append(
            f"at {low:g} to {high:g} rpm teeth pass at {process.teeth * low / 60:.3g} to {passing:.3g} Hz, far below "
            f"the lowest mode at {lowest_mode:.4g} Hz: are the speeds in Hz or rad/s? Give rpm"
        )
    return warnings


def check_depth(depth: float, process: MillingProcess | None = None, what: str = "largest depth") -> list[str]:
    """Check a depth of cut (m).

    Raises
    ------
    InputError
        A depth that is not positive, or longer than any cutting edge.
    """
    if not (math.isfinite(depth) and depth > 0):
        raise InputError(f"{what} {depth:g} m must be positive, for example 0.005 (5 mm)")
    if depth > GATE.depth_max:
        raise InputError(
            f"{what} {depth:g} m is above {GATE.depth_max:g} m: is it in mm? Give metres, for example {1e-3 * depth:g}"
        )
    if process is not None and depth > 10 * process.diameter:
        return [
            f"{what} {1e3 * depth:g} mm is more than ten times the diameter of {1e3 * process.diameter:g} mm: "
            "check both; they are in metres"
        ]
    return []


def rigid_directions(structure: Frf | ModalModel) -> list[str]:
    """Return a warning if force or motion in X, Y or Z is missing; lobes treat the tool as rigid in this direction."""
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
    """Return the lowest natural frequency, Hz; None for a structure without modes."""
    return float(np.min(natural)) if len(natural) else None


# what a typed speed over the stated rpm is where the speed was typed in another unit
_FACTORS = ((math.pi / 30, "rad/s"), (1 / 60, "Hz"), (2 / 60, "tooth passings a second"))


@dataclass(frozen=True)
class StatedCut:
    """Cutting conditions that a recording's set-up states; None for a condition that it does not state."""

    rpm: float | None = None  # constant spindle speed
    sweep: tuple[float, float] | None = None  # first and last spindle speed of a sweep, rpm
    teeth: int | None = None


def stated_cut(setup: str) -> StatedCut:
    """Read the cutting conditions from a recording's set-up; return no conditions if the set-up is not TOML."""
    tables = list(tables_of_setup(setup).values())
    first, last = (_first(tables, f"{which}_spindle_speed_rpm") for which in ("first", "last"))
    teeth = _first(tables, "teeth")
    return StatedCut(
        _first(tables, "spindle_speed_rpm"),
        None if first is None or last is None else (first, last),
        None if teeth is None else round(teeth),
    )


def _first(tables: list[dict[str, Any]], key: str) -> float | None:
    values = [table[key] for table in tables if isinstance(table.get(key), int | float)]
    return float(values[0]) if values else None


def check_one_speed(name: str, setup: str, process: MillingProcess, typed: float | None) -> list[str]:
    """Check a recording that is used as a cut at one constant speed.

    Parameters
    ----------
    name
        Name of the recording.
    setup
        Set-up that it states, TOML text.
    process
        Milling process of the cutting file.
    typed : rpm
        Spindle speed from the command line; None: not specified.

    Returns
    -------
    list of str
        Warnings: another speed or another number of teeth than the set-up states.

    Raises
    ------
    InputError
        A sweep, a speed that no spindle reaches, or one that is the stated speed in another unit.
    """
    stated = stated_cut(setup)
    if stated.sweep is not None and abs(stated.sweep[1] - stated.sweep[0]) > GATE.speed_tolerance * stated.sweep[0]:
        raise InputError(
            f"{name} states a sweep from {stated.sweep[0]:g} to {stated.sweep[1]:g} rpm; give a cut at one constant "
            "speed"
        )
    warnings = []
    if stated.teeth is not None and stated.teeth != process.teeth:
        warnings.append(
            f"{name} states {stated.teeth} teeth, the cutting file has teeth = {process.teeth}: correct one of them"
        )
    if typed is None:
        return warnings
    warnings += check_speed(typed, process)
    if stated.rpm is not None and abs(typed / stated.rpm - 1) > GATE.speed_tolerance:
        for factor, unit in _FACTORS:
            if abs(typed / (factor * stated.rpm) - 1) < GATE.speed_tolerance:
                raise InputError(
                    f"--speed {typed:g} rpm is what {name} states in {unit}: {stated.rpm:g} rpm; give rpm, or leave "
                    "--speed out"
                )
        warnings.append(f"--speed {typed:g} rpm, but {name} states {stated.rpm:g} rpm: check which is right")
    return warnings
