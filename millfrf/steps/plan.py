"""Plans of speed sweeps: what a TOML file asks for, and the tests that meet it."""

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

RPM = math.pi / 30


class PlanTable(BaseModel):
    """The table ``[plan]``: what sweeps of the spindle speed shall measure.

    Parameters
    ----------
    band_hz : Hz
        Lowest and highest frequency in which the FRF is wanted.
    depth_m : m
        Axial depth of the cuts.
    resolution_hz : Hz
        Distance of spectral lines: a third of the narrowest mode's half-power width is enough.
    acceleration_noise : m/s^2/sqrt(Hz)
        Spectral density of the accelerometer's noise, from its data sheet.
    frf_error_m_per_n : m/N
        Standard deviation of the receptance that is wanted.
    immersion_widths_deg : deg
        Widths of the immersions to choose from.
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
    """Propose three speed sweeps whose forces are independent, long enough for the FRF error that is wanted.

    Parameters
    ----------
    session
        TOML file with the tables [cutting] and [plan].

    Returns
    -------
    SweepPlan
        Speeds, immersions and durations, and the errors that they give.

    Raises
    ------
    InputError
        No such file, values out of range, or a demand that cannot be met.

    Examples
    --------
    ::

        $ millfrf plan cut.toml
    """
    found, doubts = plan_from_file(session)
    warn(doubts)
    tell(lambda: plan_answer(found))
    for table in plan_tables(found):
        show(table)
    return found


def plan_from_file(path: str | os.PathLike[str]) -> tuple[SweepPlan, list[str]]:
    """Read ``[cutting]`` and ``[plan]`` of a TOML file and plan the sweeps.

    The accelerometer's noise becomes one of displacement at the band's lower end, where it is largest:
    ``acceleration_noise / (2 pi f_low)^2``.

    Returns
    -------
    plan, doubts

    Raises
    ------
    InputError
        No such file, values out of range, or a demand that cannot be met.
    FileFormatError
        Not TOML, or a table or key missing or unknown.
    """
    cutter, doubts = read_checked_cutting(path)
    table = tomllib.loads(Path(path).read_text(encoding="utf-8")).get("plan")
    if not isinstance(table, dict):
        raise FileFormatError(f"{path} has no table [plan]; add one with {', '.join(PlanTable.model_fields)}")
    try:
        asked = PlanTable.model_validate(table)
    except ValidationError as error:
        raise FileFormatError(f"{path}: [plan] {mistake_in_words(error, PlanTable)}") from error
    density = asked.acceleration_noise
    doubts += check_demand(asked.band_hz, asked.depth_m, density, asked.immersion_widths_deg, cutter)
    noise = density / (2 * math.pi * max(asked.band_hz[0], 1e-9)) ** 2
    widths = tuple(math.radians(width) for width in asked.immersion_widths_deg)
    demand = SweepDemand(asked.band_hz, asked.depth_m, asked.resolution_hz, noise, asked.frf_error_m_per_n, widths)
    found = plan_sweeps(cutter, demand)
    return found, doubts + check_duration(found, demand)


def plan_tables(plan: SweepPlan) -> tuple[Table, Table]:
    """The tests to mill, and what they will give over the band."""
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
    chosen = range(0, len(plan.frequencies), max(1, (len(plan.frequencies) - 1) // 5))
    rows = tuple(
        (
            f"{plan.frequencies[k]:.2f}",
            *(f"{value:.3g}" for value in plan.singular_values[k]),
            *(f"{value:.2g}" for value in plan.frf_errors[k]),
        )
        for k in chosen
    )
    headings = ("Hz", *(f"{n} singular value (N²/Hz)" for n in ("1st", "2nd", "3rd")), "σ of H·x (m/N)", "H·y", "H·z")
    return (
        Table("Speed sweeps", ("test", "immersion (deg)", "spindle speed (rpm)", "duration (s)"), tests),
        Table(f"Predicted; condition of S_ff up to {plan.condition:.0f}", headings, rows),
    )
