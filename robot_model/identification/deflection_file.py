"""Measured deflections as CSV: posture, load and displacement of a tracker's target, one a row."""

import csv
import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from foundation import FileFormatError, InputError, apart

from ..kinematics import Mechanism, close_loops, driven_values, joint_unit
from .stiffness_identification import Deflection

Real = NDArray[np.float64]

LOADS = ("fx_n", "fy_n", "fz_n")
MOVED = ("dx_m", "dy_m", "dz_m")
MOMENTS = ("mx_nm", "my_nm", "mz_nm")
TARGET = ("target_x_m", "target_y_m", "target_z_m")
PULLED = ("pull_x_m", "pull_y_m", "pull_z_m")
"""The last three may be left out: no moment, target and force at the tip."""

_LARGEST = {"n": (2e4, "newtons"), "nm": (2e4, "newton metres"), "m": (0.05, "metres; 1 mm is 0.001")}
_FARTHEST = 3.0
"""Farthest place of a target or of a force from the tip, m."""


def deflection_columns(mechanism: Mechanism) -> tuple[str, ...]:
    """Names of the columns that a table of deflections must have: driven joints first, ``joint_1_deg`` ...

    Examples
    --------
    >>> from robot_model import Frame
    >>> rail = Mechanism((Frame("rail", "0", motion="prismatic"), Frame("1", "rail")), "1")
    >>> deflection_columns(rail)[:3]
    ('joint_rail_m', 'joint_1_deg', 'fx_n')
    """
    frames = [mechanism.frames[index] for index in mechanism.moving if mechanism.frames[index].active]
    return (*(f"joint_{frame.name}_{joint_unit(frame)}" for frame in frames), *LOADS, *MOVED)


def read_deflections(path: str | os.PathLike[str], mechanism: Mechanism) -> tuple[Deflection, ...]:
    """Read deflections: joint values, change of load, change of the target's place between both loads.

    Force, moment and displacement are in the base frame. ``target_*`` and ``pull_*`` are the places of the target and
    of the force from the tip, in the tool frame; a moment beside it is added as it is.

    Parameters
    ----------
    path
        CSV with the columns of ``deflection_columns`` and, where they are known, ``mx_nm my_nm mz_nm``,
        ``target_x_m ...`` and ``pull_x_m ...``. Lines that begin with ``#`` are passed over.
    mechanism
        Mechanism of the robot that was measured.

    Raises
    ------
    InputError
        No such file, or joint values that no joint has.
    FileFormatError
        A column missing or unknown, an entry that is no number, or numbers that their unit cannot mean.
    """
    if not Path(path).is_file():
        raise InputError(f"no file {path}; check the name")
    try:
        lines = Path(path).read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path} is not UTF-8 text; save the table as CSV in UTF-8") from error
    needed, rows = deflection_columns(mechanism), list(csv.DictReader(apart(lines)[1], restkey="further"))
    if not rows:
        raise FileFormatError(f"{path} holds no deflections; give a line of headings and a row for each measurement")
    _check_columns(path, set(rows[0]), needed)
    return tuple(_deflection(path, number, row, mechanism) for number, row in enumerate(rows, 1))


def _check_columns(path: object, given: set[str], needed: tuple[str, ...]) -> None:
    missing = [name for name in needed if name not in given]
    if missing:
        raise FileFormatError(f"{path} lacks the columns {', '.join(missing)}; deflections have {', '.join(needed)}")
    known = {*needed, *MOMENTS, *TARGET, *PULLED}
    unknown = sorted(str(name) for name in given - known)
    if unknown:
        raise FileFormatError(
            f"{path}: column {unknown[0]!r} is not known; beside {', '.join(needed)} there may be "
            f"{', '.join((*MOMENTS, *TARGET, *PULLED))}"
        )


def _deflection(path: object, number: int, row: dict[str, str], mechanism: Mechanism) -> Deflection:
    n_joints = len(deflection_columns(mechanism)) - 6
    where = f"{path}: row {number}"
    typed = [_number(where, name, row) for name in deflection_columns(mechanism)[:n_joints]]
    force, moment, moved, target, pulled = (
        np.array([_number(where, name, row) for name in names]) for names in (LOADS, MOMENTS, MOVED, TARGET, PULLED)
    )
    if not (np.any(force) or np.any(moment)):
        raise FileFormatError(f"{where} has no load; give the change of force that moved the target")
    try:
        q = close_loops(mechanism, driven_values(mechanism, typed))
    except InputError as error:
        raise InputError(f"{where}: {error}") from error
    attitude = mechanism.transforms(q)[mechanism.index(mechanism.tool), :3, :3]
    wrench = np.concatenate([force, moment + np.cross(attitude @ pulled, force)])
    return Deflection(q, wrench, moved, np.asarray(attitude @ target))


def _number(where: str, name: str, row: dict[str, str]) -> float:
    """One entry, checked by the unit that its name ends on; an entry of an optional column may be empty."""
    text = row.get(name)
    optional = name in (*MOMENTS, *TARGET, *PULLED)
    if optional and not text:
        return 0.0
    try:
        value = float(text or "")
    except ValueError as error:
        raise FileFormatError(f"{where}: {name} = {text!r} is no number; give one") from error
    if not np.isfinite(value):
        raise FileFormatError(f"{where}: {name} = {text!r} is not finite; leave the row out")
    if name.startswith("joint_"):
        return value
    largest, unit = (_FARTHEST, "metres from the tip") if name in (*TARGET, *PULLED) else _LARGEST[name.split("_")[-1]]
    if abs(value) > largest:
        raise FileFormatError(f"{where}: {name} = {value:g} is larger than {largest:g}; give {unit}")
    return value
