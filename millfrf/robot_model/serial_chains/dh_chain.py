"""The step from a table of Denavit-Hartenberg parameters, standard or modified, to a `SerialChain`."""

import csv
import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from millfrf.core import FileFormatError, InputError, Real

from .serial_chain import RigidPart, SerialChain, SerialJoint, inertia_fault, symmetric
from .urdf import ReadChain

CONVENTIONS = ("standard", "modified")

_SCALES = {"m": 1.0, "mm": 1e-3, "rad": 1.0, "deg": np.pi / 180}
_LENGTHS, _ANGLES = ("a", "d", "b"), ("alpha", "theta", "gamma")
_INERTIA = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
_CENTRE = ("cx", "cy", "cz")


def read_dh(path: str | os.PathLike[str], convention: str) -> ReadChain:
    """Read a robot from a CSV with one row a joint.

    Standard: ``Rot(z, theta + q) Trans(z, d) Trans(x, a) Rot(x, alpha)``, joint i turns about z of frame i - 1
    (Denavit & Hartenberg 1955; Paul 1981). Modified: ``Rot(z, gamma) Trans(z, b) Rot(x, alpha) Trans(x, a)
    Rot(z, theta + q) Trans(z, d)``, joint i turns about z of frame i (Craig 1986; Khalil & Kleinfinger 1986). A
    prismatic joint adds q to d.

    Parameters
    ----------
    path
        CSV with the columns ``a``, ``alpha``, ``d``, ``theta`` with their unit (``a_mm`` or ``a_m``, ``alpha_deg`` or
        ``alpha_rad``); optional ``name``, ``motion``, ``lower`` and ``upper`` (degrees; metres of prismatic joints),
        ``gamma`` and ``b`` (modified), ``mass_kg``, ``cx_m cy_m cz_m`` and ``ixx_kg_m2`` to ``iyz_kg_m2`` about the
        centre, in the axes of frame i.
    convention
        ``standard`` or ``modified``: the same numbers mean two different robots.

    Raises
    ------
    InputError
        No such file or convention.
    FileFormatError
        A column that is missing or unknown, or a value that is no number.
    """
    if convention not in CONVENTIONS:
        raise InputError(f"--dh {convention}: give standard or modified; the same table means another robot in each")
    rows = _rows(Path(path))
    joints, parts = [], []
    behind = np.eye(4)
    for number, row in enumerate(rows):
        name, motion = row.get("name") or str(number + 1), row.get("motion") or "revolute"
        value = {key: _number(path, number, row, key) for key in (*_LENGTHS, *_ANGLES)}
        fixed = _about_z(value["theta"], value["d"])
        if convention == "standard":
            place, body = behind, fixed @ _about_x(value["alpha"], value["a"])
            behind = body
        else:
            place = _about_z(value["gamma"], value["b"]) @ _about_x(value["alpha"], value["a"]) @ fixed
            body = np.eye(4)
        lower, upper = _limits(path, number, row, motion)
        joints.append(SerialJoint(name, motion, place, np.array([0.0, 0.0, 1.0]), lower, upper))
        part = _part(path, number, row, name, body)
        parts += [part] if part is not None else []
    flange = behind if convention == "standard" else np.eye(4)
    notes = () if parts else ("the table gives no masses: statics only, until [[bodies]] or --total-mass are given",)
    return ReadChain("flange", SerialChain(tuple(joints), tuple(parts), np.eye(4), flange), notes)


def _rows(path: Path) -> list[dict[str, str]]:
    if not path.is_file():
        raise InputError(f"no file {path}; check the name")
    lines = [line for line in path.read_text(encoding="utf-8-sig").splitlines() if line.strip() and line[0] != "#"]
    rows = list(csv.DictReader(lines, skipinitialspace=True))
    if not rows:
        raise FileFormatError(f"{path}: no row of parameters; give a header and one row a joint")
    known = {f"{key}_{unit}" for key in _LENGTHS for unit in ("m", "mm")}
    known |= {f"{key}_{unit}" for key in _ANGLES for unit in ("deg", "rad")}
    known |= {"name", "motion", "lower", "upper", "mass_kg", *(f"{key}_m" for key in _CENTRE)}
    known |= {f"{key}_kg_m2" for key in _INERTIA}
    columns = [name.strip() for name in rows[0] if name is not None]
    for name in columns:
        if name not in known:
            raise FileFormatError(f"{path}: column {name!r} is not known; columns are {', '.join(sorted(known))}")
    for key in ("a", "alpha", "d", "theta"):
        if sum(name.rpartition("_")[0] == key for name in columns) != 1:
            unit = "m or _mm" if key in _LENGTHS else "deg or _rad"
            raise FileFormatError(f"{path}: give the column {key} once, with its unit: {key}_{unit}")
    return [{(key or "").strip(): (text or "").strip() for key, text in row.items()} for row in rows]


def _number(path: object, number: int, row: Mapping[str, str], key: str) -> float:
    """A length or an angle in m or rad; 0 where there is no such column."""
    for column, text in row.items():
        name, _, unit = column.rpartition("_")
        if name == key and unit in _SCALES:
            return _SCALES[unit] * _float(path, number, column, text)
    return 0.0


def _float(path: object, number: int, column: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise FileFormatError(f"{path}: row {number + 1}, column {column}: {text!r} is not a number")
    return value


def _limits(path: object, number: int, row: Mapping[str, str], motion: str) -> tuple[float, float]:
    scale = 1.0 if motion == "prismatic" else _SCALES["deg"]
    given = [row.get(key, "") for key in ("lower", "upper")]
    if not any(given):
        return -np.inf, np.inf
    lower, upper = (_float(path, number, key, row.get(key, "")) for key in ("lower", "upper"))
    return scale * lower, scale * upper


def _part(path: object, number: int, row: Mapping[str, str], name: str, body: Real) -> RigidPart | None:
    """The link's mass, from the axes of frame i into those of the joint's body."""
    if not row.get("mass_kg") or not (mass := _float(path, number, "mass_kg", row["mass_kg"])):
        return None
    if mass < 0:
        raise InputError(f"{path}: row {number + 1}: mass_kg = {mass:g} must be positive")
    centre = [_float(path, number, f"{key}_m", row.get(f"{key}_m") or "0") for key in _CENTRE]
    inertia = symmetric([_float(path, number, f"{key}_kg_m2", row.get(f"{key}_kg_m2") or "0") for key in _INERTIA])
    fault = inertia_fault(inertia)
    if fault is not None:
        raise InputError(f"{path}: row {number + 1}: {fault}")
    turn = body[:3, :3]
    return RigidPart(f"link {name}", name, mass, turn @ np.array(centre) + body[:3, 3], turn @ inertia @ turn.T)


def _about_z(angle: float, along: float) -> Real:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0, 0], [sine, cosine, 0, 0], [0, 0, 1, along], [0, 0, 0, 1.0]])


def _about_x(angle: float, along: float) -> Real:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0, along], [0, cosine, -sine, 0], [0, sine, cosine, 0], [0, 0, 0, 1.0]])
