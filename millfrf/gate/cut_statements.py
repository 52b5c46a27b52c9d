"""Statements of a recording about its cut, compared with what was typed: speed, teeth, a sweep."""

import math
import tomllib
from dataclasses import dataclass
from typing import Any

from millfrf.core import InputError
from millfrf.cutting import MillingProcess

from .spindle import check_speed

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
