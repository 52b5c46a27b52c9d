"""`ZoomedPlot`: a figure of bokeh as text for a page, the same text for the same figure."""

import base64
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

Columns = Mapping[str, NDArray[np.floating[Any]]]

_NAME = re.compile(r"^p\d+$")


@dataclass(frozen=True)
class ZoomedPlot:
    """A figure that a browser draws.

    Parameters
    ----------
    document
        JSON of bokeh: the figure with its data.
    choices
        JSON: a list of ``label`` and ``sources`` (columns by name of their source) among which a reader chooses;
        ``[]`` where there is one thing to see.
    """

    document: str
    choices: str = "[]"


def as_plot(layout: Any, choices: Sequence[tuple[str, Mapping[str, Columns]]] = ()) -> ZoomedPlot:
    """Turn a layout of bokeh into text.

    Parameters
    ----------
    layout
        Layout or figure of bokeh; it is used up.
    choices
        Label, and columns by the name of their source.
    """
    from bokeh.embed import json_item

    told = [
        {"label": label, "sources": {name: _packed(columns) for name, columns in sources.items()}}
        for label, sources in choices
    ]
    return ZoomedPlot(json.dumps(_renumbered(json_item(layout))), json.dumps(told))


def _packed(columns: Columns) -> dict[str, str]:
    """Columns as base64 of single precision: seven digits are more than a screen shows."""
    return {name: base64.b64encode(np.asarray(one, "<f4").tobytes()).decode("ascii") for name, one in columns.items()}


def _renumbered(item: Any) -> Any:
    """The same with names of models counted from 1: bokeh counts on through the life of the program."""
    names: dict[str, str] = {}

    def walk(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: walk(one) for key, one in value.items()}
        if isinstance(value, list):
            return [walk(one) for one in value]
        if isinstance(value, str) and _NAME.match(value):
            return names.setdefault(value, f"m{len(names) + 1}")
        return value

    return walk(item)


def browser_library() -> str:
    """The program that draws in the browser, as text.

    Raises
    ------
    InputError
        A version of bokeh whose text would end the script of a page.
    """
    from bokeh.util.paths import bokehjs_path

    text = (Path(bokehjs_path()) / "js" / "bokeh.min.js").read_text(encoding="utf-8")
    if "</script" in text.lower():
        raise InputError("this version of bokeh cannot stand inside a page; install another one")
    return text
