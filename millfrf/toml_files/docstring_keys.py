"""`keys_of`: what the docstring of a table says of its keys."""

import inspect
from dataclasses import dataclass

from pydantic import BaseModel


@dataclass(frozen=True)
class KeyText:
    """Unit and description of a key."""

    unit: str
    text: str


def keys_of(schema: type[BaseModel]) -> dict[str, KeyText]:
    """Unit and description by key, from the section ``Parameters`` of a table's docstring and of those it extends.

    Examples
    --------
    >>> class Row(BaseModel):
    ...     '''A row.
    ...
    ...     Parameters
    ...     ----------
    ...     depth_m, width_m : m
    ...         Size of the cut.
    ...     '''
    ...     depth_m: float
    ...     width_m: float
    >>> keys_of(Row)["width_m"]
    KeyText(unit='m', text='Size of the cut.')
    """
    found: dict[str, KeyText] = {}
    for base in reversed(schema.__mro__):
        if issubclass(base, BaseModel) and base is not BaseModel:
            found |= _of_text(inspect.cleandoc(base.__doc__ or ""))
    return found


def summary_of(schema: type[BaseModel]) -> str:
    """First paragraph of a table's docstring, in one line."""
    return " ".join(inspect.cleandoc(schema.__doc__ or "").split("\n\n")[0].split())


def _of_text(text: str) -> dict[str, KeyText]:
    lines = text.splitlines()
    if "Parameters" not in lines:
        return {}
    found: dict[str, KeyText] = {}
    names: list[str] = []
    begin = lines.index("Parameters") + 2
    for line, after in zip(lines[begin:], [*lines[begin + 1 :], ""], strict=True):
        if after and set(after) == {"-"}:
            break
        if line and not line.startswith(" "):
            listed, _, unit = line.partition(" : ")
            names = [name.strip() for name in listed.split(",")]
            found |= {name: KeyText(unit, "") for name in names}
        elif line.strip():
            found |= {name: KeyText(found[name].unit, f"{found[name].text} {line.strip()}".strip()) for name in names}
    return found
