"""`described_tables`: the tables of a TOML file with their keys, for the reference and for templates."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from .docstring_keys import keys_of, summary_of
from .json_schemas import held_by
from .known_files import TomlFile
from .type_words import type_in_words


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
    """One table of a TOML file: its heading as it stands in the file, what it is, its keys."""

    heading: str
    text: str
    keys: tuple[DescribedKey, ...]


def described_tables(file: TomlFile) -> tuple[DescribedTable, ...]:
    """All tables of a kind of TOML file, each with every key, the whole file's own keys first.

    Examples
    --------
    >>> from millfrf.toml_files import toml_files
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
        for held in dict.fromkeys(held_by(field.annotation)):
            yield from _tables(held, _heading(field, inner), inner)


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
        return f"[{', '.join(_shown(one) for one in value)}]"
    return f"{value:g}" if isinstance(value, float) else repr(value)[1:-1] if isinstance(value, str) else str(value)
