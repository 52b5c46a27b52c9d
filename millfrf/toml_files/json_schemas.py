"""`json_schema`: the schema of a TOML file for editors, with a description at every key."""

from collections.abc import Iterator, Mapping
from typing import Any, get_args

from pydantic import BaseModel

from .docstring_keys import keys_of, summary_of
from .known_files import TomlFile


def json_schema(file: TomlFile) -> dict[str, Any]:
    """JSON schema (draft 2020-12) of a kind of TOML file; other tables beside the checked one are allowed.

    Parameters
    ----------
    file
        Kind of file, one of :func:`toml_files`.
    """
    found = file.schema.model_json_schema()
    classes = {one.__name__: one for one in schemas_in(file.schema)}
    _describe(found, file.schema)
    for name, definition in found.get("$defs", {}).items():
        _describe(definition, classes[name])
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": f"{file.name}: {file.title}"}
    if not file.table:
        return {**found, **head}
    definitions = found.pop("$defs", {})
    inner = {"type": "object", "properties": {file.table: found}, "required": [file.table]}
    return {**head, **inner, **({"$defs": definitions} if definitions else {})}


def schemas_in(schema: type[BaseModel]) -> Iterator[type[BaseModel]]:
    """A model class and all that it holds, each once."""
    waiting, seen = [schema], set()
    while waiting:
        one = waiting.pop()
        if one in seen:
            continue
        seen.add(one)
        yield one
        for field in one.model_fields.values():
            waiting.extend(held_by(field.annotation))


def held_by(annotation: Any) -> Iterator[type[BaseModel]]:
    """Model classes inside an annotation: of a list, a choice, a dictionary."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for inner in get_args(annotation):
        yield from held_by(inner)


def _describe(definition: dict[str, Any], schema: type[BaseModel]) -> None:
    """Replace titles made from names of classes by what the docstring says."""
    texts = keys_of(schema)
    definition.pop("title", None)
    definition["description"] = summary_of(schema)
    properties: Mapping[str, dict[str, Any]] = definition.get("properties", {})
    for name, entry in properties.items():
        entry.pop("title", None)
        text = texts[name]
        entry["description"] = f"{text.text} [{text.unit}]" if text.unit else text.text
