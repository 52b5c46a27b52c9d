"""Detection of a file's kind from its content."""

import csv
import json
import os
import tomllib
from enum import StrEnum
from pathlib import Path

import h5py

from estimation import is_geometry_table
from millfrf.core.csv_tables import SIDE, is_side_file
from millfrf.core.errors import FileFormatError, InputError, conversion_advice


class FileKind(StrEnum):
    """Kind of a file that millfrf reads or writes."""

    RECORDING = "recording"
    FRF = "frf"
    MODEL = "modal model"
    LOBES = "lobes"
    CUTTING = "cutting data"
    GEOMETRY = "geometry"
    CHATTER = "chatter verdicts"
    POLES = "picked poles"
    DIAGNOSIS = "diagnosis"


_FORMATS = {
    "millfrf.recording": FileKind.RECORDING,
    "millfrf.frf": FileKind.FRF,
    "millfrf.modal_model": FileKind.MODEL,
    "millfrf.chatter": FileKind.CHATTER,
    "millfrf.poles": FileKind.POLES,
    "millfrf.diagnosis": FileKind.DIAGNOSIS,
    "millfrf.robot_diagnosis": FileKind.DIAGNOSIS,
}
_LOBES_COLUMNS = ["spindle_speed_rpm", "depth_limit_m", "chatter_frequency_hz", "bifurcation"]


def kind_of(path: str | os.PathLike[str]) -> FileKind:
    """Detect the kind of a file from its content; its name does not matter.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        The file is of no known kind; the message says how to convert it.
    """
    file = Path(path)
    if file.is_dir():
        raise InputError(f"{file} is a folder; give a file in it")
    if file.is_file() and not file.stat().st_size:
        raise FileFormatError(f"{file} is empty (0 bytes); copy or record it again")
    if not file.is_file():
        raise InputError(f"no file {file}; check the name")
    if is_side_file(file):
        table = file.name.removesuffix(SIDE)
        raise FileFormatError(f"{file} describes the table {table}; give {file.with_name(table)} itself")
    kind = _hdf5_kind(file) if h5py.is_hdf5(file) else _text_kind(file)
    if kind is None:
        general = "turn files of other programs into one of them with 'millfrf convert'"
        raise FileFormatError(
            f"{file} is no recording, FRF, modal model, table of lobes, cutting file, geometry or chatter verdicts; "
            f"{conversion_advice(file) or general}"
        )
    return kind


def _hdf5_kind(file: Path) -> FileKind | None:
    try:
        with h5py.File(file, "r") as opened:
            return _FORMATS.get(str(opened.attrs.get("format", "")))
    except (OSError, KeyError, RuntimeError):  # damaged, or a recording whose writer was killed: `Recording` says which
        return FileKind.RECORDING


def _text_kind(file: Path) -> FileKind | None:
    try:
        text = file.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        return None
    if text.lstrip().startswith("{"):
        return _json_kind(text)
    rows = [line for line in text.splitlines() if line and not line.startswith("#")]
    if rows and next(csv.reader(rows[:1]))[: len(_LOBES_COLUMNS)] == _LOBES_COLUMNS:
        return FileKind.LOBES
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return None
    if "poles" in table:
        return FileKind.POLES
    return (
        FileKind.CUTTING
        if {"cutting", "turning"} & set(table)
        else FileKind.GEOMETRY
        if is_geometry_table(table)
        else None
    )


def _json_kind(text: str) -> FileKind | None:
    try:
        content = json.loads(text)
    except (json.JSONDecodeError, RecursionError):
        return None
    return _FORMATS.get(str(content.get("format"))) if isinstance(content, dict) else None
