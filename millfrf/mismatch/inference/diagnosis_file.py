"""Diagnosis files: JSON, format ``millfrf.diagnosis`` version 2; version 1 and the robots' older format are read."""

import json
import math
import os
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from millfrf.core import FileFormatError, writing_whole_file

from .diagnosis import AcceptedCause, Candidate, Diagnosis, HeldOutError, Improvement, Remainder

FORMAT = "millfrf.diagnosis"
FORMAT_VERSION = 2
OLD_ROBOT_FORMAT = "millfrf.robot_diagnosis"


def diagnosis_content(diagnosis: Diagnosis[object]) -> dict[str, Any]:
    """What the file of a diagnosis holds; a number that is not finite stands as null.

    Parameters
    ----------
    diagnosis
        The diagnosis, from any kind of comparison.
    """
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
        "held_out": [asdict(one) for one in diagnosis.held_out],
        "warnings": list(diagnosis.doubts),
    }
    plain: dict[str, Any] = _plain(content | dict(diagnosis.content))
    return plain


def write_diagnosis(path: str | os.PathLike[str], diagnosis: Diagnosis[object]) -> None:
    """Write a diagnosis whole.

    Parameters
    ----------
    path
        The file; an older one is replaced.
    diagnosis
        The diagnosis, from any kind of comparison.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    text = json.dumps(diagnosis_content(diagnosis), indent=1, allow_nan=False)
    with writing_whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def read_diagnosis(path: str | os.PathLike[str]) -> Diagnosis[None]:
    """Read a diagnosis file of any version; fits and recordings are not in it.

    Parameters
    ----------
    path
        A file that ``diagnose``, ``robot diagnose`` or ``cut diagnose`` wrote.

    Raises
    ------
    FileFormatError
        It is no diagnosis, or one of a later version.
    """
    name = Path(path).name
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise FileFormatError(f"{name} cannot be read as a diagnosis: {error}") from error
    kind = str(content.get("format")) if isinstance(content, dict) else None
    newest = {FORMAT: FORMAT_VERSION, OLD_ROBOT_FORMAT: 1}
    version = content.get("format_version", 0) if isinstance(content, dict) else None
    if kind not in newest or not isinstance(version, int) or version > newest[kind]:
        said = f"{kind!r} version {version!r}" if isinstance(content, dict) else "no JSON object"
        raise FileFormatError(f"{name} is {said}; wanted is {FORMAT!r} up to version {FORMAT_VERSION}")
    try:
        if kind == OLD_ROBOT_FORMAT:
            content = _of_old_robot(content)
        elif version < 2:
            content = _of_version_1(content)
        return _diagnosis(content)
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise FileFormatError(f"{name} lacks a part of a diagnosis: {error}; diagnose again") from error


def _diagnosis(content: Mapping[str, Any]) -> Diagnosis[None]:
    """The diagnosis that a file's content of version 2 states."""
    left = content["remainder"]
    known = {*Diagnosis.__dataclass_fields__, "format", "format_version", "leftover_share", "remainder", "warnings"}
    gain = _part(content["improvement"])
    gain["interval"] = tuple(gain["interval"])
    return Diagnosis(
        content["compared"],
        content["verdict"],
        tuple(AcceptedCause(**_part(cause)) for cause in content["physics"]),
        tuple(Candidate(**_part(candidate)) for candidate in content["candidates"]),
        tuple(content["equivalents"]),
        Improvement(**gain),
        _remainder(left["before"]),
        _remainder(left["after"]),
        content["located"],
        None,
        tuple(HeldOutError(**_part(one)) for one in content.get("held_out", ())),
        tuple(content.get("warnings", ())),
        {key: value for key, value in content.items() if key not in known},
    )


def _of_version_1(content: Mapping[str, Any]) -> dict[str, Any]:
    """Content of version 1 as version 2 has it: version 1 says of the remainder only its share at the end."""
    unknown = {"share": None, "size": None}
    left = {"before": unknown, "after": {"share": content["leftover_share"], "size": None}}
    kind = "cut" if "cut" in content else "structure"
    return {"compared": kind, "remainder": left} | dict(content)


def _of_old_robot(content: Mapping[str, Any]) -> dict[str, Any]:
    """Content of a robot diagnosis of the older format as version 2 has it."""
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
            {
                "name": one["name"],
                "evidence": one["evidence"],
                "stage": one["stage"] or "fitted",
            }
            | _old_numbers(one)
            for one in content["candidates"]
        ],
        "equivalents": content["equivalents"],
        "located": {},
        "leftover_share": excess["after"],
        "remainder": {when: {"share": excess[when], "size": excess[when]} for when in ("before", "after")},
        "improvement": asdict(gain) | {"interval": [math.nan, math.nan]},
        "held_out": [{key: row["free" if key == "floor" else key] for key in ("name", "before", "after", "floor")}
                     for row in rows],
        "warnings": content.get("warnings", []),
        "robot": {key: content[key] for key in ("rigid_links", "model_error", "recordings")},
    }  # fmt: skip


def _old_cause(cause: Mapping[str, Any]) -> dict[str, Any]:
    """One accepted cause of the robots' older format."""
    parts = {"fit": cause["fitted_error"], "spread": cause["spread"], "form": cause["form"]}
    named = {"name": cause["name"], "evidence": cause["evidence"], "error_parts": {cause["name"]: parts}}
    return named | _old_numbers(cause)


def _old_numbers(cause: Mapping[str, Any]) -> dict[str, Any]:
    """Location, numbers and errors of a cause of the robots' older format, its companions after it."""
    numbers = (cause, *cause["beside"])
    location: dict[str, Any] = {"kind": cause["kind"], "unit": cause["unit"]}
    if cause["beside"]:
        location["companions"] = {one["name"]: {"unit": one["unit"], "spread": one["spread"]} for one in numbers[1:]}
    return {
        "location": location,
        "parameters": {one["name"]: one["number"] for one in numbers},
        "standard_errors": {one["name"]: one["standard_error"] for one in numbers},
    }


def _remainder(content: Mapping[str, Any]) -> Remainder:
    return Remainder(_number(content["share"]), _number(content["size"]))


def _part(content: Mapping[str, Any]) -> dict[str, Any]:
    """A cause, a candidate or errors with NaN where null stands for a number; a location is left as it is."""
    return {key: value if key == "location" else _with_nan(value) for key, value in content.items()}


def _with_nan(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _with_nan(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_with_nan(one) for one in value]
    return math.nan if value is None else value


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)


def _plain(value: Any) -> Any:
    """Mappings, sequences and numbers as JSON holds them."""
    if isinstance(value, Mapping):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
