"""Cutting files: coefficients, cutter and engagement in ranges that a machine can have."""

import math
import os
from dataclasses import dataclass

from millfrf.core import FileFormatError, InputError
from millfrf.cutting import MillingProcess, read_cutting_process


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
