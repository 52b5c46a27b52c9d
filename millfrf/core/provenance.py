"""Provenance of a result: step, input files with hashes, options and versions, stored with the result."""

import hashlib
import json
import os
import platform
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import h5py

from .content_hashes import EDITED
from .csv_tables import read_csv
from .errors import InputError
from .hdf5_files import hdf5_state, require_backed
from .json_files import json_state, write_json
from .tables import PROVENANCE, provenance_above
from .whole_files import writing_whole_file

_MADE_BY = "made_by_millfrf"
_MADE_BY_TABLE = re.compile(rf"^\[{_MADE_BY}\]\nwarnings = \[.*\]\n?", re.MULTILINE)
LIBRARIES = ("numpy", "scipy", "h5py", "numba", "matplotlib")


def sha256(path: str | os.PathLike[str]) -> str:
    """Return the SHA-256 of a file as hexadecimal text."""
    digest = hashlib.sha256()
    with Path(path).open("rb") as file:
        while chunk := file.read(1 << 20):
            digest.update(chunk)
    return digest.hexdigest()


def sources(paths: Iterable[str | os.PathLike[str]]) -> list[dict[str, str]]:
    """Return name and SHA-256 of each file from which a result was made, and the state of its content hash."""
    stated = []
    for path in paths:
        stated.append({"file": Path(path).name, "sha256": sha256(path)})
        if state := edits_of(path) or content_state(path):
            stated[-1]["content"] = state
    return stated


def edits_of(path: str | os.PathLike[str]) -> str:
    """Return how a file of results was edited or made from an edited one; empty if neither is known.

    Examples
    --------
    A table of lobes of an edited model: ``made from model.json, edited after it was written``.
    """
    if content_state(path) == EDITED:
        return EDITED
    if Path(path).suffix.lower() not in (".json", ".csv") and not _holds_frf(Path(path)):
        return ""
    made_from = read_provenance(path).get("sources")
    for source in made_from if isinstance(made_from, list) else []:
        state = str(source.get("content", "")) if isinstance(source, dict) else ""
        if state.endswith(EDITED):
            return state if state.startswith("made from") else f"made from {source.get('file')}, {EDITED}"
    return ""


def content_state(path: str | os.PathLike[str]) -> str:
    """Return `EDITED` or `WITHOUT_HASH` for such a file of results, else an empty text."""
    try:
        if Path(path).suffix.lower() == ".json":
            content = json.loads(Path(path).read_text(encoding="utf-8"))
            return json_state(content) if isinstance(content, dict) else ""
        if _holds_frf(Path(path)):
            with h5py.File(path, "r") as file:
                require_backed(file, path)
                return hdf5_state(file)
    except (OSError, ValueError, RuntimeError, RecursionError, InputError):  # a file that another reader understands
        pass
    return ""


def versions() -> dict[str, str]:
    """Return the versions of this program, of Python and of the numerical libraries."""
    return {
        "millfrf": version("millfrf"),
        "python": platform.python_version(),
        **{name: version(name) for name in LIBRARIES},
    }


def origin(
    step: str, inputs: Iterable[str | os.PathLike[str]], options: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return the provenance of a result; leave out inputs that are no files, such as a built-in robot."""
    files = [path for path in inputs if Path(path).is_file()]
    stated = json.loads(json.dumps(dict(options or {}), default=_as_json))
    return {"step": step, "sources": sources(files), "options": stated, "versions": versions()}


def _as_json(value: object) -> Any:
    """Convert an option to JSON: dataclasses by their fields, functions by their names, other objects as text."""
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: getattr(value, field.name) for field in fields(value)}
    return getattr(value, "__qualname__", None) or str(value)


def _holds_frf(path: Path) -> bool:
    """Return whether a file is an FRF by its first bytes: recordings are opened by their guarded reader alone."""
    if not path.is_file():  # a result that was never stored, under a name for messages
        return False
    with path.open("rb") as file:
        start = file.read(1 << 20)
    return start.startswith(b"\x89HDF") and b"millfrf.frf" in start


def made(step: str, inputs: Iterable[str | os.PathLike[str]], options: Mapping[str, Any] | None = None) -> str:
    """Return the provenance in one line of JSON, see :func:`origin`."""
    return json.dumps(origin(step, inputs, options))


def add_to_json(path: str | os.PathLike[str], provenance: Mapping[str, Any]) -> None:
    """Add a field ``provenance`` to a JSON file."""
    content = json.loads(Path(path).read_text(encoding="utf-8"))
    write_json(path, {**content, "provenance": dict(provenance)})


def add_comment(path: str | os.PathLike[str], provenance: Mapping[str, Any]) -> None:
    """Write the provenance above a TOML file, as a comment of one line."""
    text = f"{PROVENANCE}{json.dumps(dict(provenance))}\n" + Path(path).read_text(encoding="utf-8")
    with writing_whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def read_provenance(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read the provenance of an FRF, a model, lobes or verdicts; return an empty dictionary if none can be read."""
    try:
        if Path(path).suffix.lower() == ".csv":
            stored = dict(read_csv(path).provenance)
        elif Path(path).suffix.lower() == ".toml":
            stored = provenance_above(Path(path).read_text(encoding="utf-8", errors="replace").splitlines())
        elif Path(path).suffix.lower() == ".json":
            stored = json.loads(Path(path).read_text(encoding="utf-8")).get("provenance", {})
        else:
            with h5py.File(path, "r") as file:
                stored = json.loads(str(file.attrs.get("provenance", "")) or "{}")
    except (OSError, ValueError, AttributeError, InputError):
        return {}
    return _well_formed(stored) if isinstance(stored, dict) else {}


_KEYS = {"taps": {"file", "hit", "left_out", "peak_n"}}
_LISTS, _TABLES = ("sources", "dropped", "cut_and_taps", "taps"), ("options", "versions", "stabilisation")


def _well_formed(stored: dict[str, Any]) -> dict[str, Any]:
    """Leave out what has another form than this program writes: provenance is read for reports and warnings only."""
    kept = dict(stored)
    for name in _LISTS:
        rows = kept.pop(name, None)
        if isinstance(rows, list):
            kept[name] = [row for row in rows if isinstance(row, dict) and _KEYS.get(name, set()) <= set(row)]
    for name in _TABLES:
        if not isinstance(kept.get(name, {}), dict):
            del kept[name]
    if "warnings" in kept:
        warnings = kept["warnings"]
        kept["warnings"] = [str(text) for text in warnings] if isinstance(warnings, list) else []
    if "band_hz" in kept and not _are_numbers(kept["band_hz"], 2):
        del kept["band_hz"]
    if not isinstance(kept.get("reduced_chi_square", 0.0), int | float):
        del kept["reduced_chi_square"]
    error = kept.get("relative_error")
    if error is not None and not (isinstance(error, list) and error and all(map(_are_numbers, error))):
        del kept["relative_error"]
    return kept


def _are_numbers(values: object, count: int | None = None) -> bool:
    is_list = isinstance(values, list) and len(values) == (count or len(values)) and len(values) > 0
    return is_list and all(isinstance(value, int | float) for value in values)  # type: ignore[attr-defined]


def of_lobes(inputs: Iterable[str | os.PathLike[str]], options: Mapping[str, Any]) -> str:
    """Return the provenance of a table of lobes in one line of JSON: files with hashes, options, versions."""
    return json.dumps({"step": "lobes", "sources": sources(inputs), "options": dict(options), "versions": versions()})


def of_chatter(
    inputs: Iterable[str | os.PathLike[str]], options: Mapping[str, Any], warnings: Sequence[str]
) -> dict[str, Any]:
    """Return the provenance of verdicts on cuts: files with hashes, options, warnings, versions."""
    return {
        "step": "chatter",
        "sources": sources(inputs),
        "options": dict(options),
        "warnings": list(warnings),
        "versions": versions(),
    }


def with_warnings(setup: str, warnings: Sequence[str]) -> str:
    """Add the warnings of a step to the set-up (TOML text) of the recording that it made, after earlier warnings."""
    if not warnings:
        return setup
    try:
        earlier = tomllib.loads(setup).get(_MADE_BY, {}).get("warnings", [])
    except tomllib.TOMLDecodeError:
        earlier = []
    remaining = _MADE_BY_TABLE.sub("", setup).rstrip()  # TOML allows a table only once
    every = dict.fromkeys([*earlier, *(" ".join(warning.split()) for warning in warnings)])
    listed = ", ".join(json.dumps(warning) for warning in every)
    return f"{remaining}\n\n[{_MADE_BY}]\nwarnings = [{listed}]\n".lstrip()
