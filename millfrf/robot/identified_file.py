"""What an identification changes in a robot's file: numbers, and what each table's source says of them."""

import tomllib
from collections.abc import Sequence
from math import log
from typing import Any

import numpy as np

from millfrf.core import InputError
from millfrf.robot_model import (
    ElasticParameter,
    Identification,
    JointStiffness,
    LinkSection,
    numbered_robot_text,
    tube_diameters,
)

Place = tuple[str | int, ...]

KEYS = {
    "radial": "radial_n_per_m",
    "axial": "axial_n_per_m",
    "tilting": "tilting_nm_per_rad",
    "turning": "turning_nm_per_rad",
}
"""Keys of a joint's stiffnesses in a robot's file."""


def identified_values(
    robot: str, table: str, parameters: Sequence[ElasticParameter], found: Identification, prior: float
) -> dict[Place, Any]:
    """New values by their place in the file, :func:`millfrf.robot_model.changed_robot_text`.

    What the data does not fix is written too: its combination with the rest is what predicts. Its table says so.

    Parameters
    ----------
    robot
        The file that was identified, or the name of a robot that comes along.
    table
        Name of the table of deflections, for the sources.
    parameters, found
        Numbers that were identified, and what was found of them.
    prior
        Standard deviation of ln p before the data spoke.
    """
    content = tomllib.loads(numbered_robot_text(robot))
    changes: dict[Place, Any] = {}
    words: dict[Place, tuple[list[str], list[str]]] = {}
    tubes: dict[int, dict[str, tuple[float, bool]]] = {}
    for parameter, value, error, known in zip(
        parameters, found.values, found.relative_errors, found.identifiable, strict=True
    ):
        if isinstance(parameter, JointStiffness):
            place: Place = ("joints", parameter.joint)
            changes[*place, KEYS[parameter.group]] = float(value)
            what = parameter.group
        else:
            assert isinstance(parameter, LinkSection)
            place, what = ("links", parameter.link, "tube"), parameter.part
            tubes.setdefault(parameter.link, {})[what] = (float(value), bool(known))
        told, untold = words.setdefault(place, ([], []))
        (told.append(f"{what} +-{100 * error:.2g} %") if known else untold.append(what))
    for link, parts in tubes.items():
        tube = content["links"][link]["tube"]
        outer, inner = _tube(tube, parts["bending"][0], parts["axial"][0] if parts["axial"][1] else None)
        changes["links", link, "tube", "outer_m"], changes["links", link, "tube", "inner_m"] = outer, inner
    changes["update",] = _update_table(robot, table, parameters, found, prior)
    for place, (told, untold) in words.items():
        source: Any = content
        for step in place:
            source = source[step]
        changes[*place, "source"] = _source(table, told, untold, source["source"])
    return changes


def _update_table(
    robot: str, table: str, parameters: Sequence[ElasticParameter], found: Identification, prior: float
) -> dict[str, Any]:
    """The file's ``[update]``: what is open of the joints' stiffnesses, from which bands follow elsewhere.

    Sections of links have no number there: they are taken as certain, the stiffnesses with the rest left open.
    """
    content, source = tomllib.loads(numbered_robot_text(robot)), f"robot identify: {table}"
    joints = [index for index, one in enumerate(parameters) if isinstance(one, JointStiffness)]
    numbers = []
    for index in joints:
        one = parameters[index]
        assert isinstance(one, JointStiffness)
        row, error = content["joints"][one.joint], float(found.relative_errors[index])
        number = {"name": f"joint {row['frame']} {one.group}", "kind": "stiffness", "frame": row["frame"]}
        number |= {"group": one.group, "spread": prior, "value": log(found.values[index] / row[KEYS[one.group]])}
        numbers.append(number | {"standard_error": error, "told": bool(found.identifiable[index]), "source": source})
    covariance = found.covariance[np.ix_(joints, joints)]
    told = [str(number["name"]) for number in numbers if number["told"]]
    rows = [[float(f"{value:.10g}") for value in row] for row in covariance]
    return {"source": source, "verdict": "identified", "named": told, "covariance": rows, "numbers": numbers}


def _tube(tube: dict[str, float], bending: float, axial: float | None) -> tuple[float, float]:
    """Diameters of a tube with E I, and with E A where the data fixes it; else with the file's area, so its mass."""
    outer, inner, young = tube["outer_m"], tube.get("inner_m", 0.0), tube["young_pa"]
    area = np.pi / 4 * (outer**2 - inner**2) if axial is None else axial / young
    try:
        return tube_diameters(float(area), bending / young)
    except InputError:  # softer than a solid bar of that area: the same shape, smaller
        smaller = float((bending / young * 64 / np.pi / (outer**4 - inner**4)) ** 0.25)
        return smaller * outer, smaller * inner


def _source(table: str, told: list[str], untold: list[str], before: str) -> str:
    """Where a table's numbers come from now; what the data did not fix keeps its older origin."""
    parts = [f"identified from {table}: {', '.join(told)}"] if told else []
    if untold:
        parts.append(f"not fixed by {table}: {', '.join(untold)} (before: {before})")
    return "; ".join(parts)
