"""Sections of numpydoc docstrings, from which help texts, schemas and reference pages are made."""

import inspect
import re
from dataclasses import dataclass


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
    """Return the summary and the further paragraphs before the first section, each as one line."""
    text = inspect.cleandoc(docstring)
    head = re.split(r"^\w[\w ]*\n-{3,}$", text, maxsplit=1, flags=re.MULTILINE)[0]
    return tuple(" ".join(part.split()) for part in head.split("\n\n") if part.strip()) or ("",)
