"""Step ``robot identify``: stiffnesses from measured deflections."""

import tomllib
from collections.abc import Sequence
from math import log
from pathlib import Path
from typing import Any

import numpy as np

from millfrf.core import InputError, MillfrfError, writing_whole_file
from millfrf.core.progress import bar
from millfrf.core.provenance import add_comment, origin
from millfrf.core.terminal import Table, say, show
from millfrf.options import check_output
from millfrf.robot_model import (
    ElasticParameter,
    HeldOut,
    Identification,
    JointStiffness,
    LinkSection,
    SpatialCase,
    changed_robot_text,
    identify_elastic,
    joint_parameters,
    link_parameters,
    numbered_robot_text,
    read_deflections,
    read_robot,
    tube_diameters,
    typed_values,
    unit_doubts,
    verify_elastic,
)

from .postures import check_positive, spatial

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


_MUCH = 2.0
"""What may be left on postures held out, in standard errors of the measurement, before a warning."""

_MOST_LEFT = 1 / 3
"""Share of the deflections that may be left where it is more than the measurement's error."""


def write_identified(robot: str, table: Path, out: Path, error: float, links: bool, prior: float) -> None:
    """Identify, print what was found and how well it holds, and write the robot's file.

    Raises
    ------
    InputError
        Options or files that cannot be used.
    MillfrfError
        What was found predicts postures held out no better than the file's numbers, or leaves a third of them.
    """
    check_output(out, (".toml",), [table, Path(robot)])
    check_positive("error", 1e6 * error, "micrometres", 1e4)
    if not 1 < prior <= 1e3:
        raise InputError(
            f"--prior {prior:g}: give a factor above 1, such as 2.7: the file's numbers are that uncertain"
        )
    case = spatial(read_robot(robot))
    measured = read_deflections(table, case.robot.mechanism)
    parameters: tuple[ElasticParameter, ...] = joint_parameters(case.robot)
    parameters += link_parameters(case.robot) if links else ()
    with bar("identifying"):
        held = verify_elastic(case.robot, measured, error, parameters, prior=float(np.log(prior)))
        found = identify_elastic(case.robot, measured, error, parameters, prior=float(np.log(prior)))
    _show_found(case, parameters, found)
    doubts = [*_radians(case, measured), *_doubts(found, held, error), *_forgotten(case)]
    _show_held_out(held, error)
    for doubt in doubts:
        say(f"warning: {doubt}")
    if held is not None:
        _refuse_what_does_not_hold(held, error)
    text = changed_robot_text(robot, identified_values(robot, table.name, parameters, found, float(np.log(prior))))
    with writing_whole_file(out) as unfinished:
        unfinished.write_text(text, encoding="utf-8")
        add_comment(unfinished, origin("robot identify", [robot, table], {"error_m": error, "prior": prior}))
        read_robot(unfinished)  # refuses what the checks of robot files refuse, before the file has its name
    say(f"wrote {out}: {found.identifiable.sum()} of {len(parameters)} numbers are fixed by the data")


def _show_found(case: SpatialCase, parameters: Sequence[ElasticParameter], found: Identification) -> None:
    rows = []
    for parameter, value, error, known in zip(
        parameters, found.values, found.relative_errors, found.identifiable, strict=True
    ):
        told = f"{100 * error:.2g}" if known else "not fixed by the data"
        rows.append((parameter.name(case.robot), f"{parameter.value(case.robot):.3e}", f"{value:.3e}", told))
    title = "Stiffnesses (N/m, N m/rad; links N m^2 and N)"
    show(Table(title, ("number", "file", "found", "standard error (%)"), tuple(rows)))
    for line in found.unidentifiable[:5]:
        say(f"not told apart: {line}")
    if len(found.unidentifiable) > 5:
        say(f"and {len(found.unidentifiable) - 5} more combinations like these")


def _show_held_out(held: HeldOut | None, error: float) -> None:
    if held is None:
        say("fewer than 10 postures: none is held out, so what the numbers predict elsewhere is not known")
        return
    before, after, size = (1e3 * lengths for lengths in (held.before, held.after, held.deflections))
    say(
        f"{held.postures} postures held out, deflections {size.mean():.3f} mm on average: the file's numbers miss "
        f"{before.mean():.4f} mm (largest {before.max():.4f}), those found {after.mean():.4f} mm (largest "
        f"{after.max():.4f}), {held.times(error):.2g} times the stated error"
    )


def _refuse_what_does_not_hold(held: HeldOut, error: float) -> None:
    before, after, size = (float(np.sqrt(np.mean(one**2))) for one in (held.before, held.after, held.deflections))
    if after >= before:
        holds = before / np.sqrt(3) <= _MUCH * error
        remedy = "the file's hold already" if holds else "measure more postures, or larger loads"
        raise MillfrfError(
            f"on {held.postures} postures held out the numbers found miss {1e3 * after:.3f} mm, the file's "
            f"{1e3 * before:.3f} mm: nothing is written; {remedy}"
        )
    if after > _MOST_LEFT * size and held.times(error) > _MUCH:
        raise MillfrfError(
            f"on {held.postures} postures held out the numbers found leave {100 * after / size:.0f} % of the "
            "deflections: nothing is written; check the axes and signs of displacements and forces, and their places"
        )


def _doubts(found: Identification, held: HeldOut | None, error: float) -> list[str]:
    doubts = []
    left = found.residual if held is None else held.times(error)
    if left > _MUCH:
        doubts.append(
            f"the deflections differ from the model by {left:.2g} times their stated error: it does not hold as it is "
            "(play, friction, axes or signs of the measurement, a load beside its place); error bars are widened by it"
        )
    if found.at_bound:
        doubts.append(f"at a bound, so their errors mean little: {', '.join(found.at_bound)}")
    return doubts


def _forgotten(case: SpatialCase) -> list[str]:
    """What an earlier update left open of numbers that are not identified here."""
    freed = () if case.uncertainty is None else case.uncertainty.parameters
    other = [one.name for one in freed if one.kind != "stiffness"]
    if not other:
        return []
    return [
        f"the file's [update] is exchanged for one of stiffnesses: what it left open of {', '.join(other[:3])}"
        f"{' and more' if len(other) > 3 else ''} is taken as certain from here on"
    ]


def _radians(case: SpatialCase, measured: Sequence[Any]) -> tuple[str, ...]:
    mechanism = case.robot.mechanism
    driven = np.array([case_.q[mechanism.active] for case_ in measured])
    largest = driven[np.argmax(np.abs(driven), axis=0), np.arange(driven.shape[1])]
    return unit_doubts(mechanism, list(typed_values(mechanism, largest)))
