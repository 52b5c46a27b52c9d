"""Diagnosis files: JSON, format ``millfrf.diagnosis`` version 2; version 1 and the robots' older format are read."""

import math
import os
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from millfrf.core import FileFormatError, read_json, write_json

from .diagnosis import AcceptedCause, Candidate, Diagnosis, HeldOutError, Improvement, Remainder

FORMAT = "millfrf.diagnosis"
FORMAT_VERSION = 2
OLD_ROBOT_FORMAT = "millfrf.robot_diagnosis"
Part = TypeVar("Part")


def diagnosis_content(diagnosis: Diagnosis[object]) -> dict[str, Any]:
    """Return the content of a diagnosis file; a number that is not finite is written as null."""
    content = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "compared": diagnosis.compared,
        "verdict": diagnosis.verdict,
        "physics": [asdict(cause) for cause in diagnosis.physics],
        "candidates": [asdict(candidate) for candidate in diagnosis.candidates],
        "equivalents": list(diagnosis.equivalents),
        "located": dict(diagnosis.located),
        "leftover_share": diagnosis.leftover,
        "remainder": {"before": asdict(diagnosis.before), "after": asdict(diagnosis.after)},
        "improvement": asdict(diagnosis.improvement),
        "held_out": [asdict(error) for error in diagnosis.held_out],
        "warnings": list(diagnosis.doubts),
    }
    plain: dict[str, Any] = _plain(content | dict(diagnosis.content))
    return plain


def write_diagnosis(path: str | os.PathLike[str], diagnosis: Diagnosis[object]) -> None:
    """Write a diagnosis to a JSON file.

    Parameters
    ----------
    path
        File to write; an older one is replaced.
    diagnosis
        Diagnosis from any kind of comparison.

    Raises
    ------
    InputError
        The folder is not writable.
    """
    write_json(path, diagnosis_content(diagnosis))


def read_diagnosis(path: str | os.PathLike[str]) -> Diagnosis[None]:
    """Read a diagnosis file of any version; the result has no fits and no recordings.

    Parameters
    ----------
    path
        File written by ``diagnose``, ``robot diagnose`` or ``cut diagnose``.

    Raises
    ------
    FileFormatError
        The file is no diagnosis, or has a later version than this program reads.
    """
    name = Path(path).name
    content = read_json(path, "a diagnosis made by diagnose")
    kind = str(content.get("format"))
    newest = {FORMAT: FORMAT_VERSION, OLD_ROBOT_FORMAT: 1}
    version = content.get("format_version", 0)
    if kind not in newest or not isinstance(version, int) or version > newest[kind]:
        raise FileFormatError(
            f"{name} is {kind!r} version {version!r}; expected is {FORMAT!r} up to version {FORMAT_VERSION}"
        )
    try:
        if kind == OLD_ROBOT_FORMAT:
            content = _of_old_robot(content)
        elif version < 2:
            content = _of_version_1(content)
        return _diagnosis(content)
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise FileFormatError(f"{name} lacks a part of a diagnosis: {error}; diagnose again") from error


def _diagnosis(content: Mapping[str, Any]) -> Diagnosis[None]:
    """Build the diagnosis from content of version 2."""
    remainder = content["remainder"]
    known = {*Diagnosis.__dataclass_fields__, "format", "format_version", "leftover_share", "remainder", "warnings"}
    improvement = _null_as_nan(content["improvement"])
    return Diagnosis(
        _typed(str, content["compared"]),
        _typed(str, content["verdict"]),
        tuple(_built(AcceptedCause, cause) for cause in content["physics"]),
        tuple(_built(Candidate, candidate) for candidate in content["candidates"]),
        _typed(tuple[str, ...], content["equivalents"]),
        _built(Improvement, improvement),
        _remainder(remainder["before"]),
        _remainder(remainder["after"]),
        _typed(dict[str, Any], content["located"]),
        None,
        tuple(_built(HeldOutError, error) for error in content.get("held_out", ())),
        _typed(tuple[str, ...], content.get("warnings", ())),
        {key: value for key, value in content.items() if key not in known},
    )


def _built(kind: type[Part], content: Mapping[str, Any]) -> Part:
    """Build a part of a diagnosis from exactly its fields, of their types."""
    fields = _null_as_nan(content)
    kind(**fields)  # pydantic ignores fields that are unknown
    part: Part = _typed(kind, fields)
    return part


def _typed(kind: Any, value: Any) -> Any:
    try:
        return TypeAdapter(kind).validate_python(value)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise ValueError(f"{place}: {first['msg']}, not {str(first['input'])[:40]!r}".removeprefix(": ")) from error


def _of_version_1(content: Mapping[str, Any]) -> dict[str, Any]:
    """Convert content of version 1, which only contains the final share of the remainder, to version 2."""
    unknown = {"share": None, "size": None}
    remainder = {"before": unknown, "after": {"share": content["leftover_share"], "size": None}}
    kind = "cut" if "cut" in content else "structure"
    return {"compared": kind, "remainder": remainder} | dict(content)


def _of_old_robot(content: Mapping[str, Any]) -> dict[str, Any]:
    """Convert a robot diagnosis of the older format to version 2."""
    rows = content["held_out"]
    before, after, floor = (
        math.sqrt(sum(row[key] ** 2 for row in rows) / len(rows)) for key in ("before", "after", "free")
    )
    names = ", ".join(row["name"] for row in rows)
    gain = Improvement(names, before, before, after, floor, content["p_value"], (0, 0), against="nominal")
    excess = content["excess"]
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "compared": "robot",
        "verdict": content["verdict"],
        "physics": [_old_cause(cause) for cause in content["causes"]],
        "candidates": [
            {"name": candidate["name"], "evidence": candidate["evidence"], "stage": candidate["stage"] or "fitted"}
            | _old_numbers(candidate)
            for candidate in content["candidates"]
        ],
        "equivalents": content["equivalents"],
        "located": {},
        "leftover_share": excess["after"],
        "remainder": {when: {"share": excess[when], "size": excess[when]} for when in ("before", "after")},
        "improvement": asdict(gain) | {"interval": [math.nan, math.nan]},
        "held_out": [
            {"name": row["name"], "before": row["before"], "after": row["after"], "floor": row["free"]} for row in rows
        ],
        "warnings": content.get("warnings", []),
        "robot": {key: content[key] for key in ("rigid_links", "model_error", "recordings")},
    }


def _old_cause(cause: Mapping[str, Any]) -> dict[str, Any]:
    parts = {"fit": cause["fitted_error"], "spread": cause["spread"], "form": cause["form"]}
    own = {"name": cause["name"], "evidence": cause["evidence"], "error_parts": {cause["name"]: parts}}
    return own | _old_numbers(cause)


def _old_numbers(cause: Mapping[str, Any]) -> dict[str, Any]:
    """Convert location, numbers and errors of a cause of the older robot format; numbers of companions come last."""
    numbers = (cause, *cause["beside"])
    location: dict[str, Any] = {"kind": cause["kind"], "unit": cause["unit"]}
    if cause["beside"]:
        location["companions"] = {
            row["name"]: {"unit": row["unit"], "spread": row["spread"]} for row in cause["beside"]
        }
    return {
        "location": location,
        "parameters": {row["name"]: row["number"] for row in numbers},
        "standard_errors": {row["name"]: row["standard_error"] for row in numbers},
    }


def _remainder(content: Mapping[str, Any]) -> Remainder:
    share, size = (math.nan if content[key] is None else float(content[key]) for key in ("share", "size"))
    return Remainder(share, size)


def _null_as_nan(content: Mapping[str, Any]) -> dict[str, Any]:
    """Replace each null, which stands for a number, by NaN; locations, in which null is a valid value, are kept."""
    return {key: value if key == "location" else _with_nan(value) for key, value in content.items()}


def _with_nan(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _with_nan(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_with_nan(item) for item in value]
    return math.nan if value is None else value


def _plain(value: Any) -> Any:
    """Convert mappings, sequences and numbers to types that JSON can hold."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
