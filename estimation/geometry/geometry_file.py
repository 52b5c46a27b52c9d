"""Geometry as a TOML file, and the files of other programs that hold one."""

import json
import os
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from foundation import FileFormatError, InputError, mistake_in_words, si_factor, writing_whole_file

from .geometry import Geometry
from .geometry_table import read_geometry_table
from .geometry_uff import read_geometry_uff

FORMAT = "millfrf.geometry"

Vector = Annotated[tuple[float, ...], Field(min_length=3, max_length=3)]


class GeometryTable(BaseModel):
    """The file: places by node, local axes of those that have their own, lines between nodes.

    Parameters
    ----------
    format, format_version
        What the file is; may be left out.
    unit
        Unit of the places: ``m``, ``mm``, ``in``.
    nodes
        Place of each node, ``name = [x, y, z]``.
    axes
        Directions of a node's own x, y and z in the axes of the whole, where they differ.
    lines
        Chains of nodes that are drawn as lines.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
    format: str = FORMAT
    format_version: int = 1
    unit: str = "m"
    lines: tuple[tuple[str, ...], ...] = ()
    nodes: dict[str, Vector]
    axes: dict[str, Annotated[tuple[Vector, ...], Field(min_length=3, max_length=3)]] = Field(default_factory=dict)


def read_geometry(path: str | os.PathLike[str]) -> Geometry:
    """Read a geometry: TOML as :func:`write_geometry` writes it, UFF (15, 2411, 18, 2420, 82) or CSV, by suffix.

    Raises
    ------
    InputError
        No such file, another suffix, or a geometry that does not hold together.
    FileFormatError
        A damaged file, or none with nodes.
    """
    return import_geometry(path)[0]


def import_geometry(path: str | os.PathLike[str]) -> tuple[Geometry, tuple[str, ...]]:
    """Read a geometry as :func:`read_geometry` does, and state each thing that the file leaves open.

    Raises
    ------
    InputError, FileFormatError
        As :func:`read_geometry`.
    """
    file = Path(path)
    if not file.is_file():
        raise InputError(f"no file {file}; check the name")
    suffix = file.suffix.lower()
    if suffix == ".toml":
        return _read_toml(file), ()
    if suffix in (".uff", ".unv"):
        return read_geometry_uff(file)
    if suffix in (".csv", ".txt"):
        return read_geometry_table(file)
    raise InputError(f"cannot read a geometry from {file.name}; give .toml, .uff, .unv or .csv")


def is_geometry_table(content: Mapping[str, Any]) -> bool:
    """Whether the content of a TOML file is a geometry."""
    return content.get("format") == FORMAT or ("nodes" in content and "format" not in content)


def write_geometry(path: str | os.PathLike[str], geometry: Geometry) -> None:
    """Write a geometry as TOML: ``nodes`` (m), ``axes`` of nodes that are turned, ``lines``.

    Raises
    ------
    InputError
        Another suffix, or the folder cannot be written to.
    """
    if Path(path).suffix.lower() != ".toml":
        raise InputError(f"cannot write {path}: a geometry is written as .toml; change the suffix")
    text = [f'format = "{FORMAT}"', "format_version = 1", 'unit = "m"', "lines = ["]
    text += [f"    [{', '.join(json.dumps(name) for name in line)}]," for line in geometry.lines]
    text += ["]", "", "[nodes]"]
    for name, position in zip(geometry.nodes, geometry.positions, strict=True):
        text.append(f"{json.dumps(name)} = {_vector(position)}")
    turned = [] if geometry.axes is None else list(zip(geometry.nodes, geometry.axes, strict=True))
    turned = [(name, axes) for name, axes in turned if not np.array_equal(axes, np.eye(3))]
    if turned:
        text += ["", "[axes]"]
        text += [f"{json.dumps(name)} = [{', '.join(_vector(axis) for axis in axes)}]" for name, axes in turned]
    with writing_whole_file(path) as temporary:
        temporary.write_text("\n".join([*text, ""]), encoding="utf-8")


def _vector(numbers: Sequence[float]) -> str:
    return f"[{', '.join(repr(float(number)) for number in numbers)}]"


def _read_toml(path: Path) -> Geometry:
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise FileFormatError(f"{path} is not TOML: {error}") from error
    if not is_geometry_table(content):
        raise FileFormatError(f"{path} is no geometry; it needs a table [nodes] with a position for each name")
    try:
        table = GeometryTable.model_validate(content)
        factor = si_factor("displacement", table.unit)
        unknown = [name for name in table.axes if name not in table.nodes]
        if unknown:
            raise InputError(f"axes are given for node {unknown[0]}, which is not there; add it or take them out")
        positions = np.array(list(table.nodes.values()), dtype=float).reshape(-1, 3) * factor
        axes = [table.axes.get(name, np.eye(3)) for name in table.nodes] if table.axes else None
        return Geometry(tuple(table.nodes), positions, None if axes is None else np.array(axes), table.lines)
    except ValidationError as error:
        raise FileFormatError(f"{path}: {mistake_in_words(error, GeometryTable)}") from error
    except InputError as error:
        raise FileFormatError(f"{path}: {error}") from error
