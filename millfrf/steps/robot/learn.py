"""Step ``robot learn``: modal models of some postures, for predictions in all."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le
from scipy.stats import qmc

from millfrf.core import InputError, Real, writing_whole_file
from millfrf.core.progress import progress
from millfrf.core.provenance import add_to_json, origin
from millfrf.core.steps import File, Grid, PythonOnly, Reads, Typed, Writes, step
from millfrf.core.terminal import Table, say, say_written, show, warn
from millfrf.robot_model import (
    LearnedPostures,
    LeftOutPosture,
    SpatialCase,
    choose_postures,
    left_out_postures,
    measured_modes,
    named_posture,
    read_robot,
    shown_values,
    tool_down,
    write_learned_postures,
)
from millfrf.robot_model import learn_postures as learn_from_modes
from modal_fit import read_modal_model

from ..given import Degrees, Height, Poses, Robot
from ..settings import ROBOT_STEPS
from .postures import axes_turned, check_axis, driven_of_each, solve_place, spatial


@step
def learn_postures(
    robot: Robot,
    /,
    *models: Annotated[File, Reads("MODEL.json")],
    poses: Poses = (),
    out: Annotated[File | None, Writes(suffixes=(".json",), needed=True)] = None,
    channels_turned: Degrees | None = None,
    next: Annotated[int | None, Typed("N"), Ge(1), Le(12)] = None,
    x: Grid | None = None,
    y: Grid | None = None,
    z: Height = 0.8,
    names: Annotated[Sequence[str], PythonOnly()] = (),
) -> LearnedPostures:
    """Learn the difference of measured modes from the robot's model over postures, for `robot frf --learned`.

    Parameters
    ----------
    robot
        Robot file (.toml), or a name that `robot list` shows.
    models
        Modal models at the tool tip, one for each posture.
    poses
        Posture of each model in turn: a name of the robot's file, or DEG,DEG,...
    out
        File of learned postures to write.
    channels_turned : deg
        Angle of the models' X from the base's x, with Z up; without it the axes of the base.
    next
        Number of postures to propose for the next measurements.
    x : m
        Lowest and highest x of the area of --next, and a number of places; without it the measured joints' range.
    y : m
        Lowest and highest y of that area, and a number of places.
    z : m
        Height of the tool tip in that area.
    names
        Names of the postures; without it those of the files.

    Returns
    -------
    LearnedPostures
        Learned differences, which predict modes in other postures.

    Raises
    ------
    InputError
        Another number of postures than of models, models that do not fit the robot, or an area that is not reached.

    Examples
    --------
    ::

        $ millfrf robot learn kuka_kr90_r3100 a.json b.json --pose home --pose 0,-10,100,0,90,0 --out postures.json
    """
    if (x is None) != (y is None) or (x is not None and next is None):
        raise InputError("an area of --next needs both --x LO HI N and --y LO HI N, and --next N")
    case = spatial(read_robot(robot))
    driven, axes = driven_of_each(case, poses, len(models), "modal models"), axes_turned(channels_turned)
    measured = [
        measured_modes(name, posture, read_modal_model(model), axes)
        for name, posture, model in zip(names or [Path(model).stem for model in models], driven, models, strict=True)
    ]
    with progress("learning"):
        learned = learn_from_modes(case.robot, measured)
        left_out = left_out_postures(learned)
    if out is not None:
        options = {"poses": poses, "channels_turned_deg": channels_turned}
        with writing_whole_file(out) as unfinished:
            write_learned_postures(unfinished, learned)
            add_to_json(unfinished, {"robot": Path(robot).name, **origin("robot learn", [robot, *models], options)})
    _show_measured(learned)
    _say_left_out(left_out)
    warn(f"{name}: the mode at {f:.2f} Hz is near none of the model's; left out" for name, f in learned.unpaired)
    say_written([out], f"{len(measured)} postures, {sum(len(pairs) for pairs in learned.pairs)} modes")
    if next is not None:
        postures = _in_joint_range(learned) if x is None or y is None else _in_area(case, x, y, z)
        _show_next(learned, postures, next)
        if x is None:
            say("area: the range of the measured joints and a tenth beyond it; --x, --y and --z set another")
    return learned


def _show_measured(learned: LearnedPostures) -> None:
    """Show a row for each posture: measured modes, and the error of the robot's model."""
    rows = []
    for modes, pairs, ratios in zip(learned.measured, learned.pairs, learned.frequency_ratios(), strict=True):
        error = 100 * float(np.sqrt(np.mean((ratios - 1) ** 2)))
        posture = shown_values(learned.robot.mechanism, modes.driven)
        paired = f"{len(pairs)} of {len(modes.frequencies)}"
        rows.append((modes.name, posture, paired, f"{modes.frequencies.min():.2f}", f"{error:.2g}"))
    columns = ("model", "posture", "modes paired", "lowest (Hz)", "model off by (%)")
    show(Table("Measured postures", columns, tuple(rows)))


def _say_left_out(left_out: Sequence[LeftOutPosture]) -> None:
    """Leave each posture out in turn; print how many values lie in the bands, and warn of contradictory postures."""
    if not left_out:
        warn(["two postures cannot test the bands; measure three or more"], 5)
        return
    covered = np.vstack([posture.held for posture in left_out])
    errors = np.sqrt(np.mean(np.vstack([posture.errors for posture in left_out]) ** 2, axis=0))
    say(
        f"each posture left out in turn: frequencies {100 * errors[0]:.2g} % off, damping {100 * errors[1]:.2g} %; "
        f"95 % bands hold {covered[:, 0].sum()} and {covered[:, 1].sum()} of {len(covered)}"
    )
    contradicted = [each for each in left_out if len(each.held) and each.held[:, 0].mean() < ROBOT_STEPS.least_in_band]
    warn(
        (
            f"{posture.name}: {int((~posture.held[:, 0]).sum())} of {len(posture.held)} frequencies lie outside of "
            "the bands from the other postures; check the posture in --pose"
            for posture in contradicted
        ),
        5,
    )


def _in_joint_range(learned: LearnedPostures) -> Real:
    """Return postures spread evenly (Sobol) over the joint range of the measured postures, one posture per row."""
    driven = np.array([modes.driven for modes in learned.measured])
    low, high = driven.min(axis=0), driven.max(axis=0)
    margin = ROBOT_STEPS.joint_margin * (high - low)
    frames = [learned.robot.mechanism.frames[i] for i in learned.robot.mechanism.moving]
    limits = np.array([(frame.lower, frame.upper) for frame in frames if frame.active])
    low, high = np.maximum(low - margin, limits[:, 0]), np.minimum(high + margin, limits[:, 1])
    even = qmc.Sobol(len(low), seed=0).random(64)[: ROBOT_STEPS.candidates + ROBOT_STEPS.targets]
    return np.asarray(low + even * (high - low))


def _in_area(case: SpatialCase, x: tuple[float, float, int], y: tuple[float, float, int], z: float) -> Real:
    """Return the postures at the places that the robot reaches, in random order, one posture per row."""
    check_axis("x", x)
    check_axis("y", y)
    postures, start = [], named_posture(case, None)
    for u in np.linspace(*x):
        for v in np.linspace(*y):
            try:
                postures.append(solve_place(case.robot, tool_down([u, v, z]), start))
            except InputError:
                continue
    if not postures:
        raise InputError("no place of the area is reached; move --x, --y or --z")
    return np.array(postures)[np.random.default_rng(0).permutation(len(postures))]


def _show_next(learned: LearnedPostures, postures: Real, count: int) -> None:
    """Show the postures to measure next, and the error expected after each measurement."""
    with progress("choosing postures"):
        chosen = choose_postures(
            learned, postures[: ROBOT_STEPS.candidates], postures[-ROBOT_STEPS.targets :], min(count, len(postures))
        )
    mechanism = learned.robot.mechanism
    rows = tuple(
        (str(i), shown_values(mechanism, choice.driven), f"{100 * choice.before:.2g}", f"{100 * choice.after:.2g}")
        for i, choice in enumerate(chosen, 1)
    )
    columns = ("", "posture", "error before (%)", "error after (%)")
    show(Table("Measure next: standard error of the lowest modes' peaks over the area", columns, rows))
