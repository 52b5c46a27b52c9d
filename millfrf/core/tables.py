"""Checked TOML tables: validation by pydantic, errors as one line, and notes above CSV tables."""

import difflib
import json
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from .errors import InputError

MUST_BE: dict[str, str] = {
    "float_type": "must be a number",
    "float_parsing": "must be a number",
    "finite_number": "must be finite",
    "int_type": "must be a whole number",
    "int_parsing": "must be a whole number",
    "int_parsing_size": "must be a whole number of fewer digits",
    "int_from_float": "must be a whole number",
    "bool_type": "must be true or false",
    "bool_parsing": "must be true or false",
    "string_type": "must be text in quotation marks",
    "string_too_short": "must not be empty",
    "string_pattern_mismatch": "must begin with a letter and hold letters, digits and _ only",
    "tuple_type": "must be a list in brackets",
    "list_type": "must be a list in brackets",
    "dict_type": "must be a table",
    "model_type": "must be a table",
    "model_attributes_type": "must be a table",
    "too_short": "must have more entries",
}
"""What a value must be, by pydantic's name of the mistake; mistakes with a bound are in :data:`BOUNDS`."""

BOUNDS: dict[str, tuple[str, str]] = {
    "greater_than": ("must be above {}", "gt"),
    "greater_than_equal": ("must be {} or more", "ge"),
    "less_than": ("must be below {}", "lt"),
    "less_than_equal": ("must be {} or less", "le"),
    "too_long": ("must have {} entries", "max_length"),
    "string_too_long": ("must have at most {} letters", "max_length"),
    "literal_error": ("must be {}", "expected"),
    "enum": ("must be {}", "expected"),
}
_TYPES = ("constrained-int", "constrained-str", "int", "str", "float", "bool")
"""Parts of a location that name a type of pydantic, not a key of the file."""

_LONGEST = 60


def mistake_in_words(error: Any, schema: Any = None, known: Mapping[str, str] | None = None) -> str:
    """Describe the first mistake of a table in one sentence, with the number of further mistakes.

    Parameters
    ----------
    error
        The ``ValidationError`` that pydantic raised.
    schema
        The model class that refused the table; its keys are proposed where a key is unknown.
    known
        Sentences for particular mistakes, by pydantic's name of the mistake.

    Returns
    -------
    str
        Such as ``channels[2].range_v must be above 0, not -3``.
    """
    mistakes = error.errors(include_url=False)
    first = _deepest(mistakes)
    more = f" (and {len(mistakes) - 1} more)" if len(mistakes) > 1 else ""
    return f"{_sentence(first, schema, known or {})}{more}"


def _deepest(mistakes: list[Any]) -> Any:
    """Choose one of the mistakes of a value that may have several types: a violated bound is the most specific."""
    first = mistakes[0]
    same = [other for other in mistakes if other["loc"][:1] == first["loc"][:1] and other["input"] == first["input"]]
    return max(same, key=lambda mistake: mistake["type"] in BOUNDS) if len(same) > 1 else first


def _sentence(mistake: Any, schema: Any, known: Mapping[str, str]) -> str:
    kind, value = mistake["type"], mistake.get("input")
    location = _of_the_file([part for part in mistake["loc"] if part not in _TYPES], schema)
    where = place(location)
    if kind in known:
        return f"{where}{known[kind]}"
    if kind == "extra_forbidden":
        return f"{where} is not a known key{_suggestion(location, schema)}"
    if kind == "missing":
        short = bool(location) and isinstance(location[-1], int)
        return f"{place(location[:-1])} must have more entries" if short else f"{where} is missing; add it"
    if kind in ("value_error", "assertion_error"):
        message = str(mistake["ctx"]["error"])
        return f"{where}: {message}" if location else message
    if kind in BOUNDS:
        words, bound = BOUNDS[kind]
        number = mistake["ctx"][bound]
        return f"{where} {words.format(f'{number:g}' if isinstance(number, float) else number)}, not {shown(value)}"
    return f"{where} {MUST_BE.get(kind, 'has a value that cannot be used')}, not {shown(value)}"


def place(location: Iterable[str | int]) -> str:
    """Write the place of a key, such as ``channels[2].unit``, with numbers from 1.

    Examples
    --------
    >>> place(["channels", 1, "unit"])
    'channels[2].unit'
    """
    text = ""
    for part in location:
        text += f"[{part + 1}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text or "the file"


def shown(value: object) -> str:
    """Write a value as a user types it; cut off a long value.

    Examples
    --------
    >>> shown(True), shown("119 MPa"), shown({"a": 1})
    ('true', "'119 MPa'", 'a table')
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, list | tuple):
        text = "[" + ", ".join(shown(entry) for entry in value[:8]) + (", ..." if len(value) > 8 else "") + "]"
    else:
        text = repr(value)
    return " ".join(text.split()) if len(text) < _LONGEST else f"{' '.join(text.split())[: _LONGEST - 3]}..."


def _models(annotation: Any) -> list[Any]:
    """Return the model classes within a type, also inside a list or a union."""
    if hasattr(annotation, "model_fields"):
        return [annotation]
    return [model for inner in get_args(annotation) for model in _models(inner)]


def _of_the_file(location: list[str | int], schema: Any) -> list[str | int]:
    """Return a location without the names of choices that pydantic inserts between keys."""
    if schema is None:
        return location
    models: list[Any] = [schema]
    keys: list[str | int] = []
    for number, part in enumerate(location):
        owners = [model for model in models if part in model.model_fields]
        if isinstance(part, int) or owners or number == len(location) - 1:
            keys.append(part)
        if owners:
            models = [inner for owner in owners for inner in _models(owner.model_fields[part].annotation)]
    return keys


def _suggestion(location: list[str | int], schema: Any) -> str:
    """Suggest the most similar known key; if no key is similar, list all known keys."""
    if schema is None:
        return "; check its spelling"
    models = [schema]
    for part in location[:-1]:
        if isinstance(part, str):
            models = [
                inner
                for model in models
                if part in model.model_fields
                for inner in _models(model.model_fields[part].annotation)
            ]
    keys = sorted({key for model in models for key in model.model_fields})
    near = difflib.get_close_matches(str(location[-1]), keys, 1)
    return f"; did you mean {near[0]}?" if near else f"; known keys: {', '.join(keys)}"


Table = TypeVar("Table", bound=BaseModel)


def checked_toml(path: Path, schema: type[Table], kind: str) -> Table:
    """Read a TOML file and check it by a pydantic model.

    Parameters
    ----------
    path
        Path of the file.
    schema
        Model class that the whole file must satisfy.
    kind
        Word for the file in messages, such as ``mapping``.

    Raises
    ------
    InputError
        No such file, no TOML, or a key that is unknown, missing or out of range; one line with file, key and value.
    """
    try:
        return schema.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise InputError(f"cannot read {kind} {path}: {error.strerror}; check the name") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{kind} {path} is not TOML: {error}; correct the line") from error
    except ValidationError as error:
        raise InputError(f"{kind} {path}: {mistake_in_words(error, schema)}") from error


WARNING, PROVENANCE = "# warning: ", "# provenance: "
"""Beginnings of the lines above a table that hold one warning, and the provenance."""


def tables_of_setup(setup: str) -> dict[str, dict[str, Any]]:
    """Return the TOML tables in the set-up of a recording by name; a set-up in free text has none.

    Examples
    --------
    >>> tables_of_setup("[cut]\\ndepth_m = 0.001\\n"), tables_of_setup("steel, dry")
    ({'cut': {'depth_m': 0.001}}, {})
    """
    try:
        content = tomllib.loads(setup)
    except (tomllib.TOMLDecodeError, RecursionError):
        return {}
    return {name: table for name, table in content.items() if isinstance(table, dict)}


def apart(lines: Iterable[str]) -> tuple[tuple[str, ...], list[str]]:
    """Separate the lines of a table into its warnings and the lines that do not begin with ``#``.

    Examples
    --------
    >>> apart(["# warning: late\\n", "# anything\\n", "x_m\\n", "1\\n"])
    (('late',), ['x_m\\n', '1\\n'])
    """
    every = list(lines)
    warnings = tuple(line.removeprefix(WARNING).strip() for line in every if line.startswith(WARNING))
    return warnings, [line for line in every if not line.startswith("#")]


def provenance_above(lines: Iterable[str]) -> dict[str, Any]:
    """Read the provenance from the lines ``# ...`` above a TOML file, or above a table of an earlier version."""
    for line in lines:
        if not line.startswith("#"):
            break
        if line.startswith(PROVENANCE):
            stored = json.loads(line.removeprefix(PROVENANCE))
            return stored if isinstance(stored, dict) else {}
    return {}
