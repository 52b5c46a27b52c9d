"""A robot's file with some numbers changed: the user's comments, order and spelling stay in files of kind `spatial`."""

import os
from collections.abc import Mapping
from typing import Any

import tomlkit
from tomlkit.exceptions import NonExistentKey

from foundation import InputError

from .numbered_text import numbered_robot_text
from .robot_files import robot_text

Place = tuple[str | int, ...]
"""Where a value stands: ``("joints", 2, "turning_nm_per_rad")``, tables counted from 0."""


def changed_robot_text(robot: str | os.PathLike[str], changes: Mapping[Place, Any]) -> str:
    """Text of a robot's file with other values at some places; a key that is not there is added to its table.

    Parameters
    ----------
    robot
        Path of a file, or name of a robot that comes along.
    changes
        New values by place: numbers (written with nine digits), text, lists or tables.

    Raises
    ------
    InputError
        No such robot, or a place whose table the file does not have.
    FileFormatError
        Not TOML.

    Examples
    --------
    >>> text = changed_robot_text("chen_2026", {("links", 0, "mass_kg"): 43.0})
    >>> text.splitlines()[0].startswith("#"), "mass_kg = 43.0" in text
    (True, True)
    """
    if not changes:
        return robot_text(robot)
    document = tomlkit.parse(numbered_robot_text(robot))
    for place, value in changes.items():
        table: Any = document
        try:
            for step in place[:-1]:
                table = table[step]
        except (NonExistentKey, IndexError, TypeError) as error:
            raise InputError(f"{robot} has no table {_shown(place[:-1])}; only values of its tables change") from error
        table[place[-1]] = float(f"{value:.9g}") if isinstance(value, float) else value
    return tomlkit.dumps(document)


def _shown(place: Place) -> str:
    """``joints[3].tube``, counted from 1 as in messages about a file's numbers."""
    words = "".join(f"[{step + 1}]" if isinstance(step, int) else f".{step}" for step in place)
    return words.lstrip(".")
