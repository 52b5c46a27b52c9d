"""Cutting files: the tables ``[cutting]`` and ``[cutter]``, or ``[turning]``, read, checked and written."""

import math
import os
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, Strict, ValidationError

from millfrf.core import FileFormatError, InputError, mistake_in_words, without_unit, writing_whole_file
from millfrf.core.argument_types import shown

from .coefficient_keys import CoefficientKeys, Number, coefficient_entries, coefficient_fields
from .cutter_table import cutter_fields, cutter_rows
from .process import MillingProcess, immersion_angles
from .turning_table import turning_from_table, turning_rows


class _MillKeys(BaseModel):
    """Keys of a table ``[cutting]`` that a table ``[turning]`` has not, or with another meaning.

    Parameters
    ----------
    teeth
        Number of cutting edges, 1 or more.
    diameter_m : m
        Diameter of the cutter, above 0.
    edge_angle_deg : deg
        Cutting edge angle, above 0 to 90: 90 for a square end mill. With less than 90 the coefficients count per depth
        of cut (Mohammadi & Ahmadi, Eq. 1); for coefficients per width of the edge, as handbooks give them, leave it at
        90 and give ``[cutter]`` with ``shape = "tapered"``.
    ktc_pa : Pa
        Tangential force coefficient (specific cutting force), above 0. Typical: 0.5e9 to 1e9 for aluminium, 2e9 to
        3e9 for steel, some 1e8 for porous material.
    krc
        Radial force coefficient as a share of ``ktc_pa``; positive: the chip pushes the tooth away from the surface.
        Published: 0.17 for acetal at 0.15 mm per tooth (Mohammadi & Ahmadi), 0.33 for aluminium of 6e8 Pa (Insperger &
        Stepan). The limits depend on it, so measure it for your material.
    kac
        Axial force coefficient as a share of ``ktc_pa``; positive: the chip pulls the tool along -Z, out of the
        spindle, as a right-hand helix does (square end mill).
    start_angle_deg : deg
        Immersion angle at which a tooth enters the cut, 0 to below ``exit_angle_deg``, from +Y (normal to the feed) in
        the sense of rotation. Give both angles, or ``immersion``.
    exit_angle_deg : deg
        Immersion angle at which a tooth leaves the cut, at most 180.
    immersion
        Type of cut instead of the two angles: ``up`` (conventional: the chip starts thin), ``down`` (climb: it ends
        thin), ``central`` (each with ``radial_depth_m``) or ``slot``.
    radial_depth_m : m
        Radial depth of cut, at most the diameter; half immersion is half the diameter.
    feed_per_tooth_m : m
        Feed per tooth, 0 or more. It decides whether teeth leave the cut; it changes the depth limit only with
        ``ktc_exponent``.
    kte_n_per_m : N/m
        Tangential edge coefficient, 0 or more: force per metre of engaged edge in addition to that of the chip.
    kre_n_per_m : N/m
        Radial edge coefficient, 0 or more.
    kae_n_per_m : N/m
        Axial edge coefficient, 0 or more; its direction is that of ``kac``.
    runout_m : m
        Radial offset of the cutter from the spindle's axis, 0 or more; the radius of tooth j = 0, 1, ... is larger by
        ``runout_m cos(2 pi j / teeth)``.
    helix_angle_deg : deg
        Helix angle of the edges, 0 to below 90; 0: straight edges.
    pitch_angles_deg : deg
        Angle from each tooth to the one before it in the cut, one per tooth, 360 together; empty: equal pitch.
    """

    teeth: Annotated[int, Strict()]
    diameter_m: Number
    edge_angle_deg: Number = 90.0
    ktc_pa: Number
    krc: Number
    kac: Number = 0.0
    start_angle_deg: Number | None = None
    exit_angle_deg: Number | None = None
    immersion: str | None = None
    radial_depth_m: Number | None = None
    feed_per_tooth_m: Number = 0.0
    kte_n_per_m: Number = 0.0
    kre_n_per_m: Number = 0.0
    kae_n_per_m: Number = 0.0
    runout_m: Number = 0.0
    helix_angle_deg: Number = 0.0
    pitch_angles_deg: tuple[Number, ...] = ()


class CuttingTable(CoefficientKeys, _MillKeys):
    """The table ``[cutting]``: cutter, engagement and force coefficients."""


def read_cutting_process(path: str | os.PathLike[str]) -> MillingProcess:
    """Read a cutter, its engagement and coefficients from ``CUT.toml``.

    The engagement is ``start_angle_deg`` and ``exit_angle_deg``, or ``immersion`` (up, down, central: with
    ``radial_depth_m``; slot). A turning cut has the table ``[turning]`` instead.

    Raises
    ------
    InputError
        No such file, or a value out of its range.
    FileFormatError
        Not TOML, no table ``[cutting]`` or ``[turning]``, or both, a key unknown, missing or of the wrong type.
    """
    content = _content(path)
    if "turning" in content:
        return turning_from_table(_table(content, "turning", path), os.fspath(path))
    return process_from_table(*_milling(content, path))


def milling_process(*, cutter: Mapping[str, Any] | None = None, **cutting: Any) -> MillingProcess:
    """Describe a milling operation by the keys of a cutting file, whose names end with their units.

    Quantities of pint are converted.

    Parameters
    ----------
    cutter
        Keys of the table ``[cutter]``, such as ``{"shape": "ball"}``; without it a square end mill.
    **cutting
        Keys of the table ``[cutting]``: ``teeth``, ``diameter_m``, ``ktc_pa``, ``krc``, ``kac``, ``start_angle_deg``
        and ``exit_angle_deg`` (or ``immersion`` and ``radial_depth_m``), ``feed_per_tooth_m``, ``helix_angle_deg`` and
        the others of the reference.

    Raises
    ------
    InputError
        A key that is unknown or missing, or a value of the wrong type or out of its range.

    Examples
    --------
    >>> cut = milling_process(
    ...     teeth=2, diameter_m=0.0127, ktc_pa=119e6, krc=0.17, immersion="down", radial_depth_m=0.00635
    ... )
    >>> round(cut.start_angle, 4), round(cut.exit_angle, 4)
    (1.5708, 3.1416)
    """
    if not (cutter is None or isinstance(cutter, Mapping)):
        raise InputError(f"cutter {shown(cutter)}: give a mapping, such as {{'shape': 'ball'}}")
    tables = ({key: _plain(key, value) for key, value in table.items()} for table in (cutting, cutter or {}))
    return process_from_table(next(tables), "milling_process", next(tables))


def _plain(key: str, value: Any) -> Any:
    """Return the value of a key as a file holds it: numbers in the unit with which the key ends."""
    unit = next((unit for end, unit in _UNITS.items() if key.endswith(end)), "")
    try:
        plain = without_unit(value, unit)
    except InputError as error:
        raise InputError(f"{key} {error}") from error
    return plain.tolist() if hasattr(plain, "tolist") else plain


_UNITS = {"_n_per_m": "N/m", "_m": "m", "_deg": "deg", "_pa": "Pa"}


def read_cutter(path: str | os.PathLike[str]) -> MillingProcess:
    """Read a cutter and its engagement from ``CUT.toml``, whose force coefficients may be missing.

    Missing coefficients get the placeholders ``ktc`` = 1 GPa and ``krc`` = 0.3: the result is meant for their
    identification. Milling only.

    Raises
    ------
    InputError
        As :func:`read_cutting_process`.
    """
    table, name, cutter = _milling(_content(path), path)
    return process_from_table({"ktc_pa": 1e9, "krc": 0.3} | table, name, cutter)


def _content(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the content of a file, which describes one cut."""
    if not Path(path).is_file():
        raise InputError(f"no file {path}; check the name")
    try:
        content = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise FileFormatError(f"{path} is not TOML: {error}") from error
    if "turning" in content and {"cutting", "cutter"} & set(content):
        raise FileFormatError(f"{path} describes turning and milling; keep [turning], or [cutting] and [cutter]")
    return content


def _milling(content: dict[str, Any], path: str | os.PathLike[str]) -> tuple[dict[str, Any], str, dict[str, Any]]:
    """Return the table ``[cutting]``, the file's name, and the table ``[cutter]``, which may be missing."""
    if "turning" in content:
        raise InputError(f"{path} describes turning; give a file with the table [cutting] of a milling cut")
    if "cutting" not in content:
        raise FileFormatError(f"{path} has no table [cutting]; add one with teeth, diameter_m, ktc_pa, krc, ...")
    return _table(content, "cutting", path), os.fspath(path), _table(content, "cutter", path)


def _table(content: dict[str, Any], name: str, path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return a table of a file, empty if it is missing."""
    table = content.get(name, {})
    if not isinstance(table, dict):
        raise FileFormatError(f"{path}: {name} is not a table; write [{name}] and its keys below")
    return table


def process_from_table(table: Mapping[str, Any], name: str, cutter: Mapping[str, Any] | None = None) -> MillingProcess:
    """Return the process of tables ``[cutting]`` and ``[cutter]`` that were read already.

    Parameters
    ----------
    table
        Keys and values of the table.
    name
        Name of the file, for messages.
    cutter
        Keys and values of the table ``[cutter]``; without it the cutter is a square end mill.

    Raises
    ------
    InputError
        A value out of its range.
    FileFormatError
        A key unknown, missing or of the wrong type.
    """
    try:
        cutting = CuttingTable.model_validate(table)
    except ValidationError as error:
        raise FileFormatError(f"{name}: cutting.{mistake_in_words(error, CuttingTable)}") from error
    fields: dict[str, Any] = {field: getattr(cutting, key) for field, key in _KEYS.items()}
    fields |= {field: math.radians(getattr(cutting, key)) for field, key in _ANGLES.items()}
    fields |= cutter_fields(cutter or {}, cutting.diameter_m, name)
    try:
        start, leave = _engagement(cutting)
        return MillingProcess(
            teeth=cutting.teeth,
            start_angle=start,
            exit_angle=leave,
            pitch_angles=tuple(math.radians(angle) for angle in cutting.pitch_angles_deg),
            **fields,
            **coefficient_fields(cutting),
        )
    except InputError as error:
        raise type(error)(f"{name}: {error}") from error


# fields of MillingProcess whose key has the same unit, and fields whose key is in degrees
_KEYS = {
    "diameter": "diameter_m",
    "feed_per_tooth": "feed_per_tooth_m",
    "runout": "runout_m",
}
_ANGLES = {"edge_angle": "edge_angle_deg", "helix_angle": "helix_angle_deg"}


def _engagement(cutting: CuttingTable) -> tuple[float, float]:
    """Return start and exit angle, rad, from the keys for both angles or from immersion and radial depth."""
    start, leave = cutting.start_angle_deg, cutting.exit_angle_deg
    if cutting.immersion is not None:
        if (start, leave) != (None, None):
            raise InputError("give either immersion or start_angle_deg and exit_angle_deg, not both")
        if cutting.radial_depth_m is None and cutting.immersion != "slot":
            raise InputError(f"immersion {cutting.immersion!r} needs radial_depth_m")
        return immersion_angles(cutting.immersion, cutting.radial_depth_m or 0.0, cutting.diameter_m)
    if start is None or leave is None:
        name = "start_angle_deg" if start is None else "exit_angle_deg"
        raise FileFormatError(f"cutting.{name} is missing; give both angles, or immersion and radial_depth_m")
    return math.radians(start), math.radians(leave)


def write_cutting_process(path: str | os.PathLike[str], process: MillingProcess, comments: Sequence[str] = ()) -> None:
    """Write a process to a cutting file, with its engagement as two angles.

    Parameters
    ----------
    path
        Cutting file to write, such as ``CUT.toml``.
    process
        Cutter, engagement and coefficients.
    comments
        Comment lines for the head of the file.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    rows = [f"# {line}" for line in comments]
    if process.is_turning:
        rows += turning_rows(process)
    else:
        rows += ["[cutting]", *(f"{key} = {value}" for key, value in _entries(process).items())]
        rows += cutter_rows(process)
    with writing_whole_file(path) as temporary:
        temporary.write_text("\n".join(rows) + "\n", encoding="utf-8")


def _entries(process: MillingProcess) -> dict[str, str]:
    entries = {
        "teeth": str(process.teeth),
        "diameter_m": repr(float(process.diameter)),
        "edge_angle_deg": _degrees(process.edge_angle),
        "start_angle_deg": _degrees(process.start_angle),
        "exit_angle_deg": _degrees(process.exit_angle),
        "feed_per_tooth_m": repr(float(process.feed_per_tooth)),
        **coefficient_entries(process),
    }
    if process.runout:
        entries["runout_m"] = repr(float(process.runout))
    if process.helix_angle:
        entries["helix_angle_deg"] = _degrees(process.helix_angle)
    if process.pitch_angles:
        entries["pitch_angles_deg"] = "[" + ", ".join(_degrees(angle) for angle in process.pitch_angles) + "]"
    return entries


def _degrees(angle: float) -> str:
    # rounded, as a conversion to radians and back does not return the same number
    return repr(round(math.degrees(angle), 9))
