"""Kind of a file, by its content and not by its name."""

import csv
import json
import os
import tomllib
from pathlib import Path

import h5py

from estimation import is_geometry_table

from .errors import FileFormatError, InputError, conversion_advice

RECORDING, FRF, MODEL, LOBES, CUTTING = "recording", "frf", "modal model", "lobes", "cutting data"
GEOMETRY, CHATTER, POLES, DIAGNOSIS = "geometry", "chatter verdicts", "picked poles", "diagnosis"
_FORMATS = {
    "millfrf.recording": RECORDING,
    "millfrf.frf": FRF,
    "millfrf.modal_model": MODEL,
    "millfrf.chatter": CHATTER,
    "millfrf.poles": POLES,
    "millfrf.diagnosis": DIAGNOSIS,
    "millfrf.robot_diagnosis": DIAGNOSIS,
}
_LOBES_COLUMNS = ["spindle_speed_rpm", "depth_limit_m", "chatter_frequency_hz", "bifurcation"]


def kind_of(path: str | os.PathLike[str]) -> str:
    """``recording``, ``frf``, ``modal model``, ``lobes``, ``cutting data``, ``geometry``, ``chatter
    verdicts``, ``picked poles`` or ``diagnosis``.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        It is none of these; the message says what it looked like.
    """
    file = Path(path)
    if file.is_dir():
        raise InputError(f"{file} is a folder; give a file in it")
    if file.is_file() and not file.stat().st_size:
        raise FileFormatError(f"{file} is empty (0 bytes); copy or record it again")
    if not file.is_file():
        raise InputError(f"no file {file}; check the name")
    kind = _hdf5_kind(file) if h5py.is_hdf5(file) else _text_kind(file)
    if kind is None:
        general = "turn files of other programs into one of them with 'millfrf convert'"
        raise FileFormatError(
            f"{file} is no recording, FRF, modal model, table of lobes, cutting file, geometry or chatter verdicts; "
            f"{conversion_advice(file) or general}"
        )
    return kind


def _hdf5_kind(file: Path) -> str | None:
    try:
        with h5py.File(file, "r") as opened:
            return _FORMATS.get(str(opened.attrs.get("format", "")))
    except (OSError, KeyError, RuntimeError):  # damaged, or a recording whose writer was killed: `Recording` says which
        return RECORDING


def _text_kind(file: Path) -> str | None:
    try:
        text = file.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        return None
    if text.lstrip().startswith("{"):
        return _json_kind(text)
    rows = [line for line in text.splitlines() if line and not line.startswith("#")]
    if rows and next(csv.reader(rows[:1]))[: len(_LOBES_COLUMNS)] == _LOBES_COLUMNS:
        return LOBES
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return None
    if "poles" in table:
        return POLES
    return CUTTING if "cutting" in table else GEOMETRY if is_geometry_table(table) else None


def _json_kind(text: str) -> str | None:
    try:
        content = json.loads(text)
    except (json.JSONDecodeError, RecursionError):
        return None
    return _FORMATS.get(str(content.get("format"))) if isinstance(content, dict) else None
