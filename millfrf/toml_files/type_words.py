"""`type_in_words`: what a key takes, from its JSON schema: `number above 0`, `text`, `list of 3 numbers`."""

from collections.abc import Mapping
from typing import Any

_PLAIN = {"string": "text", "integer": "whole number", "number": "number", "boolean": "true or false"}
_BOUNDS = (
    ("exclusiveMinimum", "above {}"),
    ("minimum", "{} or more"),
    ("exclusiveMaximum", "below {}"),
    ("maximum", "{} or less"),
)


def type_in_words(schema: Mapping[str, Any]) -> str:
    """What a key takes, in a few words.

    Examples
    --------
    >>> type_in_words({"type": "array", "prefixItems": [{"type": "number"}] * 2})
    'list of 2 numbers'
    >>> type_in_words({"anyOf": [{"type": "number", "exclusiveMinimum": 0}, {"type": "null"}]})
    'number above 0'
    """
    ways = schema.get("anyOf") or schema.get("oneOf")
    if ways:
        words = [type_in_words(one) for one in ways if one.get("type") != "null"]
        return " or ".join(dict.fromkeys(words))
    if "const" in schema:
        return f"`{schema['const']}`"
    if "enum" in schema:
        return " or ".join(f"`{value}`" for value in schema["enum"] if value != "")
    if "$ref" in schema:
        return "table"
    if schema.get("type") == "object":
        held = schema.get("additionalProperties")
        return "tables by name" if isinstance(held, dict) and "$ref" in held else "free table"
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
