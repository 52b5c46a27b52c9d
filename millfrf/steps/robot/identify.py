"""Step ``robot identify``: stiffnesses from measured deflections."""

import tomllib
from collections.abc import Sequence
from math import log
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Gt, Le

from millfrf.core import InputError, MillfrfError, writing_whole_file
from millfrf.core.progress import progress
from millfrf.core.provenance import add_comment, origin
from millfrf.core.steps import File, Reads, Typed, Writes, step
from millfrf.core.terminal import Table, say, say_written, show, warn
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
    unit_warnings,
    verify_elastic,
)

from ..given import Robot
from ..settings import ROBOT_STEPS
from .postures import spatial

Place = tuple[str | int, ...]

# Keys of a joint's stiffnesses in a robot's file
KEYS = {
    "radial": "radial_n_per_m",
    "axial": "axial_n_per_m",
    "tilting": "tilting_nm_per_rad",
    "turning": "turning_nm_per_rad",
}


@step
def identify_stiffness(
    robot: Robot,
    deflections: Annotated[File, Reads("DEFLECTIONS.csv")],
    /,
    *,
    out: Annotated[File | None, Writes(suffixes=(".toml",), needed=True)] = None,
    error: Annotated[float, Typed("UM"), Gt(0), Le(10_000)],
    links: bool = False,
    prior: Annotated[float, Typed("FACTOR"), Gt(1), Le(1000)] = 2.7,
) -> Identification:
    """Joint stiffnesses (and link sections) with errors, from deflections that a tracker measured.

    A row is a posture, a change of the force on the tool, and the displacement that it caused, in the base frame. The
    file is written only if the identified numbers predict held-out postures better than those of the file.

    Parameters
    ----------
    robot
        Robot file (.toml), or a name that `robot list` shows.
    deflections
        Table with columns joint_1_deg ... fx_n fy_n fz_n dx_m dy_m dz_m.
    out
        Robot file with the identified numbers to write.
    error : um
        Standard error of a measured displacement.
    links
        Identify the sections of flexible links too, not joint stiffnesses alone.
    prior
        Factor within which the numbers of the file are known.

    Returns
    -------
    Identification
        Numbers with their errors, and combinations that the data does not determine.

    Raises
    ------
    InputError
        Options or files that cannot be used.
    MillfrfError
        The identified numbers predict held-out postures no better than those of the file, or with errors above a third
        of the deflections.

    Examples
    --------
    ::

        $ millfrf robot identify robot.toml deflections.csv --error 37 --out identified.toml
    """
    case = spatial(read_robot(robot))
    measured = read_deflections(deflections, case.robot.mechanism)
    parameters: tuple[ElasticParameter, ...] = joint_parameters(case.robot)
    parameters += link_parameters(case.robot) if links else ()
    metres, spread = 1e-6 * error, log(prior)
    with progress("identifying"):
        held = verify_elastic(case.robot, measured, metres, parameters, prior=spread)
        identified = identify_elastic(case.robot, measured, metres, parameters, prior=spread)
    _show_identified(case, parameters, identified)
    _say_held_out(held, metres)
    warn([*_radians(case, measured), *_warnings(identified, held, metres), *_lost_update(case)])
    if held is not None:
        _refuse_bad_predictions(held, metres)
    if out is not None:
        values = identified_values(robot, Path(deflections).name, parameters, identified, spread)
        with writing_whole_file(out) as unfinished:
            unfinished.write_text(changed_robot_text(robot, values), encoding="utf-8")
            add_comment(unfinished, origin("robot identify", [robot, deflections], {"error_m": metres, "prior": prior}))
            read_robot(unfinished)  # refuses what the checks of robot files refuse, before the file has its name
    say_written([out], f"{identified.identifiable.sum()} of {len(parameters)} numbers are fixed by the data")
    return identified


def identified_values(
    robot: File, table: str, parameters: Sequence[ElasticParameter], identified: Identification, prior: float
) -> dict[Place, Any]:
    """New values by their place in the file, :func:`millfrf.robot_model.changed_robot_text`.

    Numbers that the data does not determine are written too, since predictions need the whole combination; the source
    of their table states it. ``prior`` is the standard deviation of ln p before the measurement.
    """
    content = tomllib.loads(numbered_robot_text(robot))
    changes: dict[Place, Any] = {}
    words: dict[Place, tuple[list[str], list[str]]] = {}
    tubes: dict[int, dict[str, tuple[float, bool]]] = {}
    for parameter, value, error, known in zip(
        parameters, identified.values, identified.relative_errors, identified.identifiable, strict=True
    ):
        if isinstance(parameter, JointStiffness):
            place: Place = ("joints", parameter.joint)
            changes[*place, KEYS[parameter.group]] = float(value)
            what = parameter.group
        else:
            assert isinstance(parameter, LinkSection)
            place, what = ("links", parameter.link, "tube"), parameter.part
            tubes.setdefault(parameter.link, {})[what] = (float(value), bool(known))
        fixed, free = words.setdefault(place, ([], []))
        (fixed.append(f"{what} +-{100 * error:.2g} %") if known else free.append(what))
    for link, parts in tubes.items():
        tube = content["links"][link]["tube"]
        outer, inner = _tube(tube, parts["bending"][0], parts["axial"][0] if parts["axial"][1] else None)
        changes["links", link, "tube", "outer_m"], changes["links", link, "tube", "inner_m"] = outer, inner
    changes["update",] = _update_table(robot, table, parameters, identified, prior)
    for place, (fixed, free) in words.items():
        entry: Any = content
        for key in place:
            entry = entry[key]
        changes[*place, "source"] = _source(table, fixed, free, entry["source"])
    return changes


def _update_table(
    robot: File, table: str, parameters: Sequence[ElasticParameter], identified: Identification, prior: float
) -> dict[str, Any]:
    """Return the file's table ``[update]``: the uncertainty of the joint stiffnesses, for the bands of other steps.

    Sections of links are not in this table, so other steps take them as exact.
    """
    content, source = tomllib.loads(numbered_robot_text(robot)), f"robot identify: {table}"
    joints, numbers = [], []
    for index, parameter in enumerate(parameters):
        if not isinstance(parameter, JointStiffness):
            continue
        joints.append(index)
        row, group = content["joints"][parameter.joint], parameter.group
        numbers.append(
            {
                "name": f"joint {row['frame']} {group}",
                "kind": "stiffness",
                "frame": row["frame"],
                "group": group,
                "spread": prior,
                "value": log(identified.values[index] / row[KEYS[group]]),
                "standard_error": float(identified.relative_errors[index]),
                "told": bool(identified.identifiable[index]),
                "source": source,
            }
        )
    covariance = identified.covariance[np.ix_(joints, joints)]
    named = [str(number["name"]) for number in numbers if number["told"]]
    rows = [[float(f"{value:.10g}") for value in row] for row in covariance]
    return {"source": source, "verdict": "identified", "named": named, "covariance": rows, "numbers": numbers}


def _tube(tube: dict[str, float], bending: float, axial: float | None) -> tuple[float, float]:
    """Return the outer and inner diameter (m) of a tube with the bending stiffness E I and the axial stiffness E A.

    If the data do not determine E A, the tube keeps the area, and so the mass, that the file states.
    """
    outer, inner, young = tube["outer_m"], tube.get("inner_m", 0.0), tube["young_pa"]
    area = np.pi / 4 * (outer**2 - inner**2) if axial is None else axial / young
    try:
        return tube_diameters(float(area), bending / young)
    except InputError:  # softer than a solid bar of that area: the same shape, smaller
        smaller = float((bending / young * 64 / np.pi / (outer**4 - inner**4)) ** 0.25)
        return smaller * outer, smaller * inner


def _source(table: str, fixed: list[str], free: list[str], before: str) -> str:
    """Return the source of the numbers in a table; numbers that the data did not determine keep their older source."""
    parts = [f"identified from {table}: {', '.join(fixed)}"] if fixed else []
    if free:
        parts.append(f"not fixed by {table}: {', '.join(free)} (before: {before})")
    return "; ".join(parts)


def _show_identified(case: SpatialCase, parameters: Sequence[ElasticParameter], identified: Identification) -> None:
    rows = []
    for parameter, value, error, known in zip(
        parameters, identified.values, identified.relative_errors, identified.identifiable, strict=True
    ):
        shown = f"{100 * error:.2g}" if known else "not fixed by the data"
        rows.append((parameter.name(case.robot), f"{parameter.value(case.robot):.3e}", f"{value:.3e}", shown))
    title = "Stiffnesses (N/m, N m/rad; links N m^2 and N)"
    show(Table(title, ("number", "file", "found", "standard error (%)"), tuple(rows)))
    for line in identified.unidentifiable[:5]:
        say(f"not distinguished: {line}")
    if len(identified.unidentifiable) > 5:
        say(f"and {len(identified.unidentifiable) - 5} more combinations like these")


def _say_held_out(held: HeldOut | None, error: float) -> None:
    if held is None:
        say("fewer than 10 postures: none is held out, so the error in other postures is not known")
        return
    before, after, size = (1e3 * lengths for lengths in (held.before, held.after, held.deflections))
    say(
        f"{held.postures} postures held out, deflections {size.mean():.3f} mm on average: the file's numbers miss "
        f"{before.mean():.4f} mm (largest {before.max():.4f}), those found {after.mean():.4f} mm (largest "
        f"{after.max():.4f}), {held.times(error):.2g} times the stated error"
    )


def _refuse_bad_predictions(held: HeldOut, error: float) -> None:
    before, after, size = (float(np.sqrt(np.mean(x**2))) for x in (held.before, held.after, held.deflections))
    if after >= before:
        holds = before / np.sqrt(3) <= ROBOT_STEPS.large_error * error
        remedy = "the file's hold already" if holds else "measure more postures, or larger loads"
        raise MillfrfError(
            f"on {held.postures} postures held out the numbers found miss {1e3 * after:.3f} mm, the file's "
            f"{1e3 * before:.3f} mm: nothing is written; {remedy}"
        )
    if after > ROBOT_STEPS.largest_residual * size and held.times(error) > ROBOT_STEPS.large_error:
        raise MillfrfError(
            f"on {held.postures} postures held out the numbers found leave {100 * after / size:.0f} % of the "
            "deflections: nothing is written; check the axes and signs of displacements and forces, and their places"
        )


def _warnings(identified: Identification, held: HeldOut | None, error: float) -> list[str]:
    doubts = []
    left = identified.residual if held is None else held.times(error)
    if left > ROBOT_STEPS.large_error:
        doubts.append(
            f"the deflections differ from the model by {left:.2g} times their stated error: the model is not valid "
            "(play, friction, wrong axes, signs or load position); error bars are widened by this factor"
        )
    if identified.at_bound:
        doubts.append(f"at a bound, so their errors mean little: {', '.join(identified.at_bound)}")
    return doubts


def _lost_update(case: SpatialCase) -> list[str]:
    """Return a warning if numbers of an earlier update are not identified here, so that their uncertainty is lost."""
    freed = () if case.uncertainty is None else case.uncertainty.parameters
    other = [parameter.name for parameter in freed if parameter.kind != "stiffness"]
    if not other:
        return []
    return [
        f"the file's [update] is replaced by one of stiffnesses: the uncertainty of {', '.join(other[:3])}"
        f"{' and more' if len(other) > 3 else ''} is lost"
    ]


def _radians(case: SpatialCase, measured: Sequence[Any]) -> tuple[str, ...]:
    mechanism = case.robot.mechanism
    driven = np.array([deflection.q[mechanism.active] for deflection in measured])
    largest = driven[np.argmax(np.abs(driven), axis=0), np.arange(driven.shape[1])]
    return unit_warnings(mechanism, list(typed_values(mechanism, largest)))
