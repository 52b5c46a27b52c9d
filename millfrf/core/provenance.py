"""Origin of a result: it is stored with the result, so that a report can state it."""

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

from .whole_files import writing_whole_file

_MADE_BY = "made_by_millfrf"
_MADE_BY_TABLE = re.compile(rf"^\[{_MADE_BY}\]\nwarnings = \[.*\]\n?", re.MULTILINE)
LIBRARIES = ("numpy", "scipy", "h5py", "numba", "matplotlib")


def sha256(path: str | os.PathLike[str]) -> str:
    """SHA-256 of a file, as hexadecimal text."""
    digest = hashlib.sha256()
    with Path(path).open("rb") as file:
        while chunk := file.read(1 << 20):
            digest.update(chunk)
    return digest.hexdigest()


def sources(paths: Iterable[str | os.PathLike[str]]) -> list[dict[str, str]]:
    """Name and SHA-256 of each file a result was made from."""
    return [{"file": Path(path).name, "sha256": sha256(path)} for path in paths]


def versions() -> dict[str, str]:
    """Versions of this program, of Python and of the libraries that compute."""
    return {
        "millfrf": version("millfrf"),
        "python": platform.python_version(),
        **{name: version(name) for name in LIBRARIES},
    }


def origin(
    step: str, inputs: Iterable[str | os.PathLike[str]], options: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Origin of a result: the step, files with hashes, options, versions.

    Parameters
    ----------
    step
        Name of the command.
    inputs
        Files that the result was made from; a name of something that is no file (a robot that ships) is left out.
    options
        What was asked for; paths and other objects are told as text.
    """
    files = [path for path in inputs if Path(path).is_file()]
    asked = json.loads(json.dumps(dict(options or {}), default=_told))
    return {"step": step, "sources": sources(files), "options": asked, "versions": versions()}


def _told(value: object) -> Any:
    """An option for JSON: tables of settings by their fields, functions by their names, other objects as text."""
    if is_dataclass(value) and not isinstance(value, type):
        return {one.name: getattr(value, one.name) for one in fields(value)}
    return getattr(value, "__qualname__", None) or str(value)


def made(step: str, inputs: Iterable[str | os.PathLike[str]], options: Mapping[str, Any] | None = None) -> str:
    """The same as one line of JSON, see :func:`origin`."""
    return json.dumps(origin(step, inputs, options))


def add_to_json(path: str | os.PathLike[str], provenance: Mapping[str, Any]) -> None:
    """Put a field ``provenance`` into a JSON file; readers that do not know it pass over it."""
    content = json.loads(Path(path).read_text(encoding="utf-8"))
    content["provenance"] = dict(provenance)
    with writing_whole_file(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1), encoding="utf-8")


def add_comment(path: str | os.PathLike[str], provenance: Mapping[str, Any]) -> None:
    """Put the origin above a TOML file, as a comment of one line."""
    text = f"# provenance: {json.dumps(dict(provenance))}\n" + Path(path).read_text(encoding="utf-8")
    with writing_whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def read_provenance(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read the origin that an FRF, a model, lobes or verdicts state; empty where they state none that can be read."""
    try:
        if Path(path).suffix.lower() in (".csv", ".toml"):
            stored = _of_lobes(Path(path))
        elif Path(path).suffix.lower() == ".json":
            stored = json.loads(Path(path).read_text(encoding="utf-8")).get("provenance", {})
        else:
            with h5py.File(path, "r") as file:
                stored = json.loads(str(file.attrs.get("provenance", "")) or "{}")
    except (OSError, ValueError, AttributeError):
        return {}
    return stored if isinstance(stored, dict) else {}


def of_lobes(inputs: Iterable[str | os.PathLike[str]], options: Mapping[str, Any]) -> str:
    """Provenance of a table of lobes as one line of JSON: files with hashes, options, versions."""
    return json.dumps({"step": "lobes", "sources": sources(inputs), "options": dict(options), "versions": versions()})


def of_chatter(
    inputs: Iterable[str | os.PathLike[str]], options: Mapping[str, Any], warnings: Sequence[str]
) -> dict[str, Any]:
    """Provenance of verdicts on cuts: files with hashes, options, warnings, versions."""
    return {
        "step": "chatter",
        "sources": sources(inputs),
        "options": dict(options),
        "warnings": list(warnings),
        "versions": versions(),
    }


def _of_lobes(path: Path) -> Any:
    """Read the origin from the comments above a table of lobes, a recording as CSV, or a TOML file."""
    mark = "# provenance: "
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in file:
            if not line.startswith("#"):
                break
            if line.startswith(mark):
                return json.loads(line.removeprefix(mark))
    return {}


def with_warnings(setup: str, warnings: Sequence[str]) -> str:
    """A recording's set-up (TOML text) with the warnings of the job that made it; as it is where there are none.

    Warnings of an earlier job stay, each once: a table may stand in a file only once.
    """
    if not warnings:
        return setup
    try:
        earlier = tomllib.loads(setup).get(_MADE_BY, {}).get("warnings", [])
    except tomllib.TOMLDecodeError:
        earlier = []
    kept = _MADE_BY_TABLE.sub("", setup).rstrip()
    every = dict.fromkeys([*earlier, *(" ".join(warning.split()) for warning in warnings)])
    listed = ", ".join(json.dumps(warning) for warning in every)
    return f"{kept}\n\n[{_MADE_BY}]\nwarnings = [{listed}]\n".lstrip()
