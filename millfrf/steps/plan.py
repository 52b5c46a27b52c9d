"""Step ``plan``: speed sweeps that measure the FRF with the error that a TOML file demands."""

import math
import os
import tomllib
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from estimation import SweepDemand, SweepPlan, plan_sweeps
from millfrf.core import FileFormatError, mistake_in_words
from millfrf.core.steps import File, Reads, step
from millfrf.core.terminal import Table, show, tell, warn
from millfrf.gate import check_demand, check_duration, read_checked_cutting

from .answers import plan_answer
from .settings import RPM


class PlanTable(BaseModel):
    """The table ``[plan]``: what sweeps of the spindle speed shall measure.

    Parameters
    ----------
    band_hz : Hz
        Lowest and highest frequency of the FRF.
    depth_m : m
        Axial depth of the cuts.
    resolution_hz : Hz
        Distance of spectral lines: a third of the narrowest mode's half-power width is enough.
    acceleration_noise : m/s^2/sqrt(Hz)
        Spectral density of the accelerometer's noise, from its data sheet.
    frf_error_m_per_n : m/N
        Largest standard deviation of the receptance.
    immersion_widths_deg : deg
        Widths of the immersions to choose from; a central cut of the radial depth of such an up cut is allowed too.
    """

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    band_hz: tuple[float, float]
    depth_m: float
    resolution_hz: float = 0.25
    acceleration_noise: Annotated[float, Field(description="m/s^2/sqrt(Hz)")]
    frf_error_m_per_n: float
    immersion_widths_deg: tuple[float, ...] = (30.0, 45.0, 60.0)


@step
def plan(session: Annotated[File, Reads("SESSION.toml")], /) -> SweepPlan:
    """Propose three speed sweeps with independent forces, long enough for the FRF error that the file demands.

    Parameters
    ----------
    session
        TOML file with the tables [cutting] and [plan].

    Returns
    -------
    SweepPlan
        Speeds, immersions and durations, and the expected errors of the FRF.

    Raises
    ------
    InputError
        No such file, values out of range, or a demand that cannot be met.

    Examples
    --------
    ::

        $ millfrf plan cut.toml
    """
    sweep_plan, warnings = plan_from_file(session)
    warn(warnings)
    tell(lambda: plan_answer(sweep_plan))
    for table in plan_tables(sweep_plan):
        show(table)
    return sweep_plan


def plan_from_file(path: str | os.PathLike[str]) -> tuple[SweepPlan, list[str]]:
    """Read ``[cutting]`` and ``[plan]`` of a TOML file and plan the sweeps; also return warnings.

    The noise of the accelerometer is converted to displacement at the band's lower end, where it is largest:
    ``acceleration_noise / (2 pi f_low)^2``.
    """
    cutter, warnings = read_checked_cutting(path)
    table = tomllib.loads(Path(path).read_text(encoding="utf-8")).get("plan")
    if not isinstance(table, dict):
        raise FileFormatError(f"{path} has no table [plan]; add one with {', '.join(PlanTable.model_fields)}")
    try:
        demanded = PlanTable.model_validate(table)
    except ValidationError as error:
        raise FileFormatError(f"{path}: [plan] {mistake_in_words(error, PlanTable)}") from error
    density = demanded.acceleration_noise
    warnings += check_demand(demanded.band_hz, demanded.depth_m, density, demanded.immersion_widths_deg, cutter)
    noise = density / (2 * math.pi * max(demanded.band_hz[0], 1e-9)) ** 2
    widths = tuple(math.radians(width) for width in demanded.immersion_widths_deg)
    demand = SweepDemand(
        demanded.band_hz, demanded.depth_m, demanded.resolution_hz, noise, demanded.frf_error_m_per_n, widths
    )
    sweep_plan = plan_sweeps(cutter, demand)
    return sweep_plan, warnings + check_duration(sweep_plan, demand)


def plan_tables(plan: SweepPlan) -> tuple[Table, Table]:
    """Tables of the tests to mill, and of the expected spectrum and FRF error over the band."""
    first, last = (speed / RPM for speed in plan.spindle_speeds)
    tests = tuple(
        (
            str(number + 1),
            f"{math.degrees(process.start_angle):.1f} to {math.degrees(process.exit_angle):.1f}",
            f"{first:.0f} to {last:.0f}",
            f"{plan.duration:.0f}",
        )
        for number, process in enumerate(plan.processes)
    )
    shown = range(0, len(plan.frequencies), max(1, (len(plan.frequencies) - 1) // 5))
    rows = tuple(
        (
            f"{plan.frequencies[k]:.2f}",
            *(f"{value:.3g}" for value in plan.singular_values[k]),
            *(f"{value:.2g}" for value in plan.frf_errors[k]),
        )
        for k in shown
    )
    headings = ("Hz", *(f"{n} singular value (N²/Hz)" for n in ("1st", "2nd", "3rd")), "σ of H·x (m/N)", "H·y", "H·z")
    return (
        Table("Speed sweeps", ("test", "immersion (deg)", "spindle speed (rpm)", "duration (s)"), tests),
        Table(f"Predicted; condition of S_ff up to {plan.condition:.0f}", headings, rows),
    )
