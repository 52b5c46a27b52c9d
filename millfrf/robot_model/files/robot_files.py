"""Robot files: TOML by path or name, checked against a schema and the ranges of their units."""

import os
import tomllib
from collections.abc import Callable, Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from millfrf.core import FileFormatError, InputError, mistake_in_words

# ending of the key, smallest and largest size of a number that is not 0, and what to give
_RANGES = (
    ("kg_per_m3", 100.0, 25e3, "a density in kg/m^3; aluminium has 2700"),
    ("nm_per_rad", 1e-6, 1e12, "a stiffness in N m/rad"),
    ("n_per_m", 1.0, 1e13, "a stiffness in N/m"),
    ("m_per_s2", 0.1, 30.0, "metres per second squared"),
    ("kg_m2", 1e-9, 1e5, "a moment of inertia in kg m^2"),
    ("nm2", 1.0, 1e12, "a bending stiffness E I in N m^2"),
    ("_pa", 1e8, 2e12, "pascals; aluminium has 69e9"),
    ("_kg", 1e-6, 2e4, "kilograms"),
    ("_hz", 1e-3, 1e5, "hertz"),
    ("_deg", 0.0, 1080.0, "degrees"),
    ("_n", 1.0, 1e13, "newtons"),
    ("repeatability_m", 1e-6, 5e-3, "the pose repeatability of ISO 9283 in metres; 0.06 mm is 6e-5"),
    ("_m", 0.0, 20.0, "metres"),
)
# the unit of joint values and limits follows from the joint's motion; an inertia is checked as a whole
_OWN_CHECK = ("driven", "driven_deg", "angles_deg", "limits_m", "limits_deg", "measured_first_mode_hz", "inertia_kg_m2")


def _check_ranges(content: dict[str, Any]) -> None:
    """Raise an error at the first number that is out of the range of its unit."""
    for place, key, value in _numbers(content, ""):
        for ending, least, most, unit in _RANGES:
            if key.endswith(ending):
                if value and not least <= abs(value) <= most:
                    raise FileFormatError(f"{place} = {value!r}: give {unit} (size {least:g} to {most:g})")
                break


def _numbers(part: Any, place: str, key: str = "") -> Iterator[tuple[str, str, float]]:
    """Yield every number with its place (``links[1].tube.outer_m``) and its key."""
    if isinstance(part, dict):
        for name, entry in part.items():
            if name not in _OWN_CHECK:
                yield from _numbers(entry, f"{place}.{name}".lstrip("."), name)
    elif isinstance(part, list):
        for index, entry in enumerate(part):
            yield from _numbers(entry, f"{place}[{index + 1}]", key)
    elif isinstance(part, (int, float)) and not isinstance(part, bool):
        yield place, key, float(part)


class Table(BaseModel):
    """A table of a robot file; unknown keys and infinite values are refused.

    Parameters
    ----------
    source
        Where the numbers of the table come from, or ``assumed: reason``, which every result then names.
    """

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    source: str


class HeadTable(Table):
    """The table ``[robot]``.

    Parameters
    ----------
    name
        Name of the robot.
    kind
        ``serial``, ``spatial`` or ``planar``: which tables the file has.
    """

    name: str
    kind: str


class SpatialHeadTable(HeadTable):
    """The table ``[robot]``.

    Parameters
    ----------
    gravity_m_per_s2 : m/s^2
        Gravity as a stiffness of the structure, for open chains only; 0: neglected.
    up
        Axis of the base against the weight: ``[0, 0, 1]`` stands on the floor, ``[0, 0, -1]`` hangs from a ceiling.
    repeatability_m : m
        Pose repeatability after ISO 9283 (RP), such as 6e-5 for 0.06 mm.
    """

    gravity_m_per_s2: float = Field(0.0, ge=0, le=30)
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    repeatability_m: float | None = Field(None, ge=1e-6, le=5e-3)


def robot_names() -> tuple[str, ...]:
    """Names of the robots that come with the program."""
    folder = files("millfrf.robot_model") / "robots"
    return tuple(sorted(entry.name[:-5] for entry in folder.iterdir() if entry.name.endswith(".toml")))


def robot_text(robot: str | os.PathLike[str]) -> str:
    """Return the text of a robot file, by path or by the name of a robot of this package; it must be TOML."""
    path = Path(robot)
    if path.suffix == ".toml":
        if not path.is_file():
            raise InputError(f"no robot file {robot}; check the name, or use one of {', '.join(robot_names())}")
        text = path.read_text(encoding="utf-8", errors="replace")
    elif str(robot) in robot_names():
        text = (files("millfrf.robot_model") / "robots" / f"{robot}.toml").read_text(encoding="utf-8")
    else:
        raise InputError(f"no robot {robot}; give a .toml file or one of {', '.join(robot_names())}")
    try:
        tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FileFormatError(f"{robot} is not TOML: {error}") from error
    return text


def read_table(robot: str | os.PathLike[str]) -> dict[str, Any]:
    """Content of a robot file, by path or by the name of a robot of this package."""
    return tomllib.loads(robot_text(robot))


def kind_of(content: dict[str, Any]) -> Any:
    """Return the key ``kind`` of the table ``[robot]``; None if it is missing."""
    head = content.get("robot")
    return head.get("kind") if isinstance(head, dict) else None


Schema = TypeVar("Schema", bound=BaseModel)
Case = TypeVar("Case")


def read_as(schema: type[Schema], robot: str | os.PathLike[str], kind: str, build: Callable[[Schema], Case]) -> Case:
    """Read a robot file, check it against a schema, and build the robot from it; errors begin with the file's name."""
    content = read_table(robot)
    if kind_of(content) != kind:
        raise FileFormatError(
            f"{robot} describes a robot of kind {kind_of(content)!r}; {kind!r} is needed here ([robot] kind)"
        )
    try:
        checked = schema.model_validate(content)
        _check_ranges(content)
        return build(checked)
    except ValidationError as error:
        raise FileFormatError(f"{robot}: {mistake_in_words(error, schema)}") from error
    except InputError as error:
        raise type(error)(f"{robot}: {error}") from error


def assumptions(robot: str | os.PathLike[str]) -> tuple[str, ...]:
    """List the tables of a robot's file whose source is marked `assumed`, one line each, with the reason.

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
