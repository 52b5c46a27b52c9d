"""Mapping of FRF files of another program: columns or arrays, unit, and the direction of each file of a tap test."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from estimation import TextSource, open_source, unit_is_of_frf
from millfrf.core import InputError
from millfrf.core.described_tables import described_tables

from .guesses import Question
from .templates import FILL_IN, Row, template
from .toml_files import toml_files

_AXIS = re.compile(r"(?<![a-z])([xyz])(?![a-z])", re.IGNORECASE)
_UNITS = '"m/N", "um/N", "m/s^2/N", "g/N"'


def frf_mapping_text(paths: Sequence[Path]) -> str:
    """Return the commented mapping of FRF files, one FRF each where they are texts.

    Columns, arrays and units are those that the files name. The direction of a file is guessed from a lone x, y or z in
    its name; response and excitation are then the direct term at the tip.
    """
    uff = [path.name for path in paths if path.suffix.lower() in (".uff", ".unv")]
    if uff:
        raise InputError(f"{uff[0]} is UFF, which states what its FRFs are: millfrf convert {uff[0]} frf.h5")
    sources = [open_source(path) for path in paths]
    table, text = _table(sources[0]), isinstance(sources[0], TextSource)
    rows: dict[str, Sequence[Row]] = {"[frf]": [table]}
    if text or len(paths) > 1:
        rows["[[entries]]"] = [_entry(path, len(paths)) for path in paths]
    else:
        where = Question('degrees of freedom along that axis: ["TCP:+X", "TCP:+Y"]')
        order = Question('order of the axes: ["frequency", "response", "excitation"]', open=False)
        table |= {"responses": where, "excitations": where, "axes": order}
    names = " ".join(path.name for path in paths)
    title = (
        f"Mapping of FRFs for: millfrf convert {names} OUT.h5 --map THIS.toml\n"
        f"Directions are guessed from the files' names: check each. Places marked {FILL_IN} are open.\n"
        "Cross terms that no file gives are marked as not measured.\n"
        f"{paths[0].name} holds {sources[0].contents()}."
    )
    kind = next(file for file in toml_files() if file.name == "frf-mapping")
    return template(title, described_tables(kind), rows)


def _table(source: Any) -> dict[str, Any]:
    """Return the keys of ``[frf]``: the places of the numbers and their unit, or questions."""
    places = {name: place for name, place in source.roles().items() if name != "coherence"}
    values = [name for name in ("values", "real", "magnitude") if name in places]
    if not values and isinstance(source, TextSource) and len(source.table.headings) == 3:
        # three columns without headings: analysers write frequency, real and imaginary part
        places, values = {"frequency": 1, "real": 2, "imaginary": 3}, ["real"]
    keys: dict[str, Any] = dict(places)
    for name in ("frequency", *(() if values else ("values",))):
        keys.setdefault(name, Question(f"column or array, one of: {source.contents()}"))
    unit = source.unit(places[values[0]]) if values else ""
    keys["unit"] = unit if unit_is_of_frf(unit) else Question(f"of the FRF: {_UNITS} ...")
    if values == ["magnitude"]:
        keys.setdefault("phase_unit", Question('"deg" or "rad", where the heading does not say it', open=False))
    return keys


def _entry(path: Path, n_files: int) -> dict[str, Any]:
    axes = {axis.upper() for axis in _AXIS.findall(path.stem)}
    point: Any = f"TCP:+{axes.pop()}" if len(axes) == 1 else Question("node:direction, such as TCP:+X")
    return {"response": point, "excitation": point} | ({"file": path.name} if n_files > 1 else {})
