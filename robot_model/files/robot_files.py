"""Robots as data: TOML files, the ones that come along by name, each number with its source or `assumed`."""

import os
import tomllib
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from foundation import FileFormatError, InputError, mistake_in_words

from .file_ranges import check_ranges

Schema = TypeVar("Schema", bound=BaseModel)


class Table(BaseModel):
    """A table of a robot file: unknown keys and infinite values are refused, and it says where it comes from.

    Parameters
    ----------
    source
        Where the numbers of the table come from, or ``assumed: reason``, which every result then names.
    """

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    source: str


def robot_names() -> tuple[str, ...]:
    """Names of the robots that come with the program."""
    folder = files("robot_model") / "robots"
    return tuple(sorted(entry.name[:-5] for entry in folder.iterdir() if entry.name.endswith(".toml")))


def robot_text(robot: str | os.PathLike[str]) -> str:
    """Text of a robot file, given by path or by the name of one that comes along.

    Raises
    ------
    InputError
        No such robot.
    FileFormatError
        Not TOML.
    """
    path = Path(robot)
    if path.suffix == ".toml":
        if not path.is_file():
            raise InputError(f"no robot file {robot}; check the name, or use one of {', '.join(robot_names())}")
        text = path.read_text(encoding="utf-8", errors="replace")
    elif str(robot) in robot_names():
        text = (files("robot_model") / "robots" / f"{robot}.toml").read_text(encoding="utf-8")
    else:
        raise InputError(f"no robot {robot}; give a .toml file or one of {', '.join(robot_names())}")
    try:
        tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FileFormatError(f"{robot} is not TOML: {error}") from error
    return text


def read_table(robot: str | os.PathLike[str]) -> dict[str, Any]:
    """Content of a robot file, given by path or by the name of one that comes along.

    Raises
    ------
    InputError
        No such robot.
    FileFormatError
        Not TOML.
    """
    return tomllib.loads(robot_text(robot))


def read_as(schema: type[Schema], robot: str | os.PathLike[str], kind: str) -> Schema:
    """Content of a robot file checked against a schema.

    Raises
    ------
    FileFormatError
        Another kind of robot, a key unknown, missing or of the wrong type, or a number that its unit cannot mean.
    """
    content = read_table(robot)
    found = content.get("robot", {}).get("kind") if isinstance(content.get("robot"), dict) else None
    if found != kind:
        raise FileFormatError(f"{robot} describes a robot of kind {found!r}; {kind!r} is needed here ([robot] kind)")
    try:
        checked = schema.model_validate(content)
        check_ranges(content)
        return checked
    except FileFormatError as error:
        raise FileFormatError(f"{robot}: {error}") from error
    except ValidationError as error:
        raise FileFormatError(f"{robot}: {mistake_in_words(error, schema)}") from error


def assumptions(robot: str | os.PathLike[str]) -> tuple[str, ...]:
    """List the places where a robot's file says `assumed`, with the reason: one line a table.

    Examples
    --------
    >>> assumptions("chen_2026")[0].split(":")[:2]
    ['links[0].section', ' assumed']
    """
    return tuple(_assumed(read_table(robot), ""))


def _assumed(part: Any, place: str) -> list[str]:
    if isinstance(part, list):
        return [line for index, entry in enumerate(part) for line in _assumed(entry, f"{place}[{index}]")]
    if not isinstance(part, dict):
        return []
    source = part.get("source", "")
    own = [f"{place}: {source}"] if isinstance(source, str) and "assumed" in source else []
    inner = [line for key, entry in part.items() for line in _assumed(entry, f"{place}.{key}".lstrip("."))]
    return own + inner
