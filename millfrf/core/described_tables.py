"""TOML tables described by the docstrings and fields of their classes, as text and as JSON schema."""

import inspect
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo


@dataclass(frozen=True)
class ParameterText:
    """Unit and description of a parameter."""

    unit: str
    text: str


def parameters_in(docstring: str) -> dict[str, ParameterText]:
    """Return unit and description of each name in the section ``Parameters``.

    Parameters
    ----------
    docstring
        Docstring in which a parameter is written ``name : unit``, with an indented description below.

    Examples
    --------
    >>> parameters_in('''A cut.
    ...
    ...     Parameters
    ...     ----------
    ...     depth, width : m
    ...         Size of the cut.
    ...     ''')["width"]
    ParameterText(unit='m', text='Size of the cut.')
    """
    lines = inspect.cleandoc(docstring).splitlines()
    if "Parameters" not in lines:
        return {}
    texts: dict[str, ParameterText] = {}
    names: list[str] = []
    begin = lines.index("Parameters") + 2
    for line, after in zip(lines[begin:], [*lines[begin + 1 :], ""], strict=True):
        if after and set(after) == {"-"}:
            break
        if line and not line.startswith(" "):
            listed, _, unit = line.partition(" : ")
            names = [name.strip().lstrip("*") for name in listed.split(",")]
            texts |= {name: ParameterText(unit, "") for name in names}
        elif line.strip():
            texts |= {
                name: ParameterText(texts[name].unit, f"{texts[name].text} {line.strip()}".strip()) for name in names
            }
    return texts


def paragraphs_in(docstring: str) -> tuple[str, ...]:
    """Return the summary and the further paragraphs before the first section, each in one line."""
    text = inspect.cleandoc(docstring)
    head = re.split(r"^\w[\w ]*\n-{3,}$", text, maxsplit=1, flags=re.MULTILINE)[0]
    return tuple(" ".join(part.split()) for part in head.split("\n\n") if part.strip()) or ("",)


@dataclass(frozen=True)
class TomlFile:
    """One kind of TOML file.

    Parameters
    ----------
    name
        Short name of the kind, such as ``cut``.
    title
        What such a file says, a few words.
    schema
        Model class that checks the file, or the one table of it that counts.
    table
        Name of that table, such as ``cutting``; empty: the whole file.
    read_by
        Commands that read it.
    """

    name: str
    title: str
    schema: type[BaseModel]
    table: str
    read_by: tuple[str, ...]


def keys_of(schema: type[BaseModel]) -> dict[str, ParameterText]:
    """Return unit and description of each key, from the docstrings of a table and of the tables that it extends.

    Parameters
    ----------
    schema
        Model class of the table.
    """
    texts: dict[str, ParameterText] = {}
    for base in reversed(schema.__mro__):
        if issubclass(base, BaseModel) and base is not BaseModel:
            texts |= parameters_in(base.__doc__ or "")
    return texts


def summary_of(schema: type[BaseModel]) -> str:
    """Return the first paragraph of a table's docstring in one line."""
    return paragraphs_in(schema.__doc__ or "")[0]


def json_schema(file: TomlFile) -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a kind of TOML file; it allows tables that are not checked.

    Parameters
    ----------
    file
        Kind of file, one of :func:`toml_files`.
    """
    schema = file.schema.model_json_schema()
    classes = {model.__name__: model for model in schemas_in(file.schema)}
    _describe(schema, file.schema)
    for name, definition in schema.get("$defs", {}).items():
        _describe(definition, classes[name])
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": f"{file.name}: {file.title}"}
    if not file.table:
        return {**schema, **head}
    definitions = schema.pop("$defs", {})
    inner = {"type": "object", "properties": {file.table: schema}, "required": [file.table]}
    return {**head, **inner, **({"$defs": definitions} if definitions else {})}


def schemas_in(schema: type[BaseModel]) -> Iterator[type[BaseModel]]:
    """Yield a model class and all model classes of its fields, without repetitions."""
    waiting, seen = [schema], set()
    while waiting:
        model = waiting.pop()
        if model in seen:
            continue
        seen.add(model)
        yield model
        for field in model.model_fields.values():
            waiting.extend(models_in(field.annotation))


def models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """Yield the model classes in an annotation, also inside a list, a union or a dictionary."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for inner in get_args(annotation):
        yield from models_in(inner)


def _describe(definition: dict[str, Any], schema: type[BaseModel]) -> None:
    """Replace titles made from class names by the texts of the docstring."""
    texts = keys_of(schema)
    definition.pop("title", None)
    definition["description"] = summary_of(schema)
    properties: Mapping[str, dict[str, Any]] = definition.get("properties", {})
    for name, entry in properties.items():
        entry.pop("title", None)
        text = texts[name]
        entry["description"] = f"{text.text} [{text.unit}]" if text.unit else text.text


_PLAIN = {"string": "text", "integer": "whole number", "number": "number", "boolean": "true or false"}
_BOUNDS = (
    ("exclusiveMinimum", "above {}"),
    ("minimum", "{} or more"),
    ("exclusiveMaximum", "below {}"),
    ("maximum", "{} or less"),
)


def type_in_words(schema: Mapping[str, Any]) -> str:
    """Describe the type of a key's value in a few words.

    Examples
    --------
    >>> type_in_words({"type": "array", "prefixItems": [{"type": "number"}] * 2})
    'list of 2 numbers'
    >>> type_in_words({"anyOf": [{"type": "number", "exclusiveMinimum": 0}, {"type": "null"}]})
    'number above 0'
    """
    ways = schema.get("anyOf") or schema.get("oneOf")
    if ways:
        words = [type_in_words(way) for way in ways if way.get("type") != "null"]
        return " or ".join(dict.fromkeys(words))
    if "const" in schema:
        return f"`{schema['const']}`"
    if "enum" in schema:
        return " or ".join(f"`{value}`" for value in schema["enum"] if value != "")
    if "$ref" in schema:
        return "table"
    if schema.get("type") == "object":
        entry = schema.get("additionalProperties")
        return "tables by name" if isinstance(entry, dict) and "$ref" in entry else "free table"
    if schema.get("type") == "array":
        return _list(schema)
    bounds = [words.format(f"{schema[key]:g}") for key, words in _BOUNDS if key in schema]
    return " ".join([_PLAIN.get(str(schema.get("type")), "value"), " and ".join(bounds)]).strip()


def _list(schema: Mapping[str, Any]) -> str:
    entries = schema.get("prefixItems")
    if entries:
        return f"list of {len(entries)} {_plural(type_in_words(entries[0]))}"
    inner = schema.get("items", {})
    most, least = schema.get("maxItems"), schema.get("minItems")
    count = f"{most} " if most is not None and most == least else ""
    return f"list of {count}{_plural(type_in_words(inner))}"


def _plural(words: str) -> str:
    first, _, rest = words.partition(" ")
    if words.startswith("whole number"):
        return words.replace("whole number", "whole numbers", 1)
    if words == "free table":
        return "free tables"
    if first in ("number", "table", "value", "list"):
        return f"{first}s {rest}".strip()
    return "texts" if words == "text" else words


@dataclass(frozen=True)
class DescribedKey:
    """One key of a table.

    Parameters
    ----------
    name, unit, text
        Its name, its unit (empty: none) and what it means.
    kind
        What it takes, such as ``number above 0``.
    default
        What holds where it is left out; ``None``: it must be given; empty: nothing.
    """

    name: str
    unit: str
    text: str
    kind: str
    default: str | None


@dataclass(frozen=True)
class DescribedTable:
    """One table of a TOML file: heading as written in the file, description, and keys."""

    heading: str
    text: str
    keys: tuple[DescribedKey, ...]


def described_tables(file: TomlFile) -> tuple[DescribedTable, ...]:
    """Return all tables of a kind of TOML file with all their keys; the keys above the first heading come first.

    Examples
    --------
    >>> from millfrf.new.templates import toml_files
    >>> cut = next(file for file in toml_files() if file.name == "cut")
    >>> described_tables(cut)[0].heading, described_tables(cut)[0].keys[1].name
    ('[cutting]', 'diameter_m')
    """
    heading = f"[{file.table}]" if file.table else ""
    return tuple(_tables(file.schema, heading, file.table))


def _tables(schema: type[BaseModel], heading: str, path: str) -> Iterator[DescribedTable]:
    texts, properties = keys_of(schema), schema.model_json_schema().get("properties", {})
    keys = tuple(
        _key(name, field, texts[name].unit, texts[name].text, properties[name])
        for name, field in schema.model_fields.items()
    )
    yield DescribedTable(heading, summary_of(schema), keys)
    for name, field in schema.model_fields.items():
        own = f"{name}.NAME" if get_origin(field.annotation) is dict else name
        inner = f"{path}.{own}" if path else own
        for model in dict.fromkeys(models_in(field.annotation)):
            yield from _tables(model, _heading(field, inner), inner)


def _heading(field: FieldInfo, path: str) -> str:
    return f"[[{path}]]" if get_origin(field.annotation) in (tuple, list) else f"[{path}]"


def _key(name: str, field: FieldInfo, unit: str, text: str, schema: Mapping[str, Any]) -> DescribedKey:
    if field.is_required():
        return DescribedKey(name, unit, text, type_in_words(schema), None)
    value = field.get_default(call_default_factory=True, validated_data={})
    empty = value is None or value in ("", (), [], {}) or isinstance(value, BaseModel)
    shown = "" if empty else str(value).lower() if isinstance(value, bool) else _shown(value)
    return DescribedKey(name, unit, text, type_in_words(schema), shown)


def _shown(value: object) -> str:
    if isinstance(value, tuple | list):
        return f"[{', '.join(_shown(entry) for entry in value)}]"
    return f"{value:g}" if isinstance(value, float) else repr(value)[1:-1] if isinstance(value, str) else str(value)
