"""Stiffness identification from the command line: fit, verdict on postures held out, the robot's file."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from millfrf.core import InputError, MillfrfError, writing_whole_file
from millfrf.robot_model import (
    ElasticParameter,
    HeldOut,
    Identification,
    SpatialCase,
    changed_robot_text,
    identify_elastic,
    joint_parameters,
    link_parameters,
    read_deflections,
    read_robot,
    typed_values,
    unit_doubts,
    verify_elastic,
)

from ..options import check_output
from ..progress import bar
from ..provenance import add_comment, origin
from ..tables import Table, show
from ..terminal import say
from .asked_loads import check_positive
from .identified_file import identified_values
from .postures import spatial

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
