"""Step ``robot learn``: modal models of some postures, for predictions in all."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scipy.stats import qmc

from millfrf.core import InputError, Real, writing_whole_file
from millfrf.core.progress import bar
from millfrf.core.provenance import add_to_json, origin
from millfrf.core.terminal import Table, say, show
from millfrf.options import check_output
from millfrf.robot_model import (
    LearnedPostures,
    LeftOutPosture,
    SpatialCase,
    choose_postures,
    learn_postures,
    left_out_postures,
    measured_modes,
    named_posture,
    read_robot,
    shown_values,
    tool_down,
    write_learned_postures,
)
from modal_fit import read_modal_model

from .postures import Asked, check_axis, check_degrees, check_places, posture_of, solve_place, spatial

CANDIDATES, TARGETS = 40, 20
"""Postures that are offered, and postures whose predictions count."""

BEYOND = 0.1
"""Share of the measured joints' range that is added at either end where no area is asked for."""


@dataclass(frozen=True)
class WorkArea:
    """Area of a vertical tool as typed: ``LO HI N`` along x and y, and its height, m."""

    x: tuple[float, float, int]
    y: tuple[float, float, int]
    z: float


def show_next_postures(case: SpatialCase, learned: LearnedPostures, count: int, area: WorkArea | None) -> None:
    """Print the postures to measure next, and what each is expected to be worth.

    Raises
    ------
    InputError
        A number of postures that cannot be, or an area of which the robot reaches nothing.
    """
    if not 1 <= count <= 12:
        raise InputError(f"--next {count}: give 1 to 12 postures")
    offered = _in_joint_range(learned) if area is None else _in_area(case, area)
    with bar("choosing postures"):
        chosen = choose_postures(learned, offered[:CANDIDATES], offered[-TARGETS:], min(count, len(offered)))
    mechanism = case.robot.mechanism
    rows = tuple(
        (str(i), shown_values(mechanism, one.driven), f"{100 * one.before:.2g}", f"{100 * one.after:.2g}")
        for i, one in enumerate(chosen, 1)
    )
    columns = ("", "posture", "error before (%)", "error after (%)")
    show(Table("Measure next: standard error of the lowest modes' peaks over the area", columns, rows))
    if area is None:
        say("area: the measured joints' range and a tenth beyond it; --x, --y and --z ask for another")


def _in_joint_range(learned: LearnedPostures) -> Real:
    """Postures over the range of the measured ones, evenly (Sobol), (n, n_active)."""
    driven = np.array([one.driven for one in learned.measured])
    low, high = driven.min(axis=0), driven.max(axis=0)
    beyond = BEYOND * (high - low)
    frames = [learned.robot.mechanism.frames[i] for i in learned.robot.mechanism.moving]
    limits = np.array([(frame.lower, frame.upper) for frame in frames if frame.active])
    low, high = np.maximum(low - beyond, limits[:, 0]), np.minimum(high + beyond, limits[:, 1])
    even = qmc.Sobol(len(low), seed=0).random(64)[: CANDIDATES + TARGETS]
    return np.asarray(low + even * (high - low))


def _in_area(case: SpatialCase, area: WorkArea) -> Real:
    """Postures of the places that the robot reaches, in an order that mixes them, (n, n_active)."""
    check_axis("x", area.x)
    check_axis("y", area.y)
    check_places(z=area.z)
    found = []
    start = named_posture(case, None)
    for x in np.linspace(*area.x):
        for y in np.linspace(*area.y):
            try:
                found.append(solve_place(case.robot, tool_down([x, y, area.z]), start))
            except InputError:
                continue
    if not found:
        raise InputError("no place of the area is reached; move --x, --y or --z")
    return np.array(found)[np.random.default_rng(0).permutation(len(found))]


WRONG = 0.6
"""A posture of whose frequencies fewer than this share lie in their bands may be another than is stated."""


@dataclass(frozen=True)
class LearningFrom:
    """Options of learning as they were typed.

    Parameters
    ----------
    poses
        A posture for each model.
    feed
        Direction of the models' X axes from the base's x, degrees; None: the base's.
    next_postures
        Number of postures to choose for the next measurements, or None.
    area
        Area over which predictions matter; None: the range of the measured joints.
    """

    poses: tuple[str, ...]
    feed: float | None = None
    next_postures: int | None = None
    area: WorkArea | None = None


def learn_from_files(
    robot: str, models: Sequence[Path], asking: LearningFrom, out: Path, names: Sequence[str] | None = None
) -> LearnedPostures:
    """Learn, write the file, print the table of postures; ``names`` of the postures are else those of the files.

    Raises
    ------
    InputError
        Files or postures that cannot be used together.
    """
    check_output(out, (".json",), models)
    case = spatial(read_robot(robot))
    axes = axes_of(asking.feed)
    if len(asking.poses) != len(models):
        raise InputError(
            f"{len(asking.poses)} postures for {len(models)} modal models; give --pose once for each, in the same order"
        )
    measured = [
        measured_modes(name, driven_of(case, pose), read_modal_model(path), axes)
        for name, path, pose in zip(names or [path.stem for path in models], models, asking.poses, strict=True)
    ]
    with bar("learning"):
        learned = learn_postures(case.robot, measured)
        left_out = left_out_postures(learned)
    with writing_whole_file(out) as temporary:
        write_learned_postures(temporary, learned)
        add_to_json(temporary, {"robot": Path(robot).name, **origin("robot learn", [robot, *models], asdict(asking))})
    _show(case, learned)
    _tell_left_out(left_out)
    for name, frequency in learned.unpaired:
        say(f"warning: {name}: the mode at {frequency:.2f} Hz is near none of the model's; left out")
    say(f"wrote {out}: {len(measured)} postures, {sum(len(one) for one in learned.pairs)} modes")
    if asking.next_postures is not None:
        show_next_postures(case, learned, asking.next_postures, asking.area)
    return learned


def driven_of(case: SpatialCase, pose: str) -> Real:
    """Driven joint values of a posture's name, or of degrees (prismatic joints: metres) with commas."""
    asked = Asked(joints=pose) if "," in pose else Asked(pose=pose)
    return posture_of(case, asked)[0]


def axes_of(feed: float | None) -> Real:
    """Axes X, Y, Z of models whose X lies ``feed`` degrees from the base's x, Z upwards; None: the base's."""
    if feed is None:
        return np.eye(3)
    check_degrees(feed=feed)
    return tool_down([0.0, 0.0, 0.0], np.radians(feed)).axes


def _tell_left_out(left_out: Sequence[LeftOutPosture]) -> None:
    """Say whether bands hold postures that were left out in turn, and warn of one that the others contradict."""
    if not left_out:
        say("warning: two postures say nothing of whether bands hold; measure three or more")
        return
    held = np.vstack([one.held for one in left_out])
    errors = np.sqrt(np.mean(np.vstack([one.errors for one in left_out]) ** 2, axis=0))
    say(
        f"each posture left out in turn: frequencies {100 * errors[0]:.2g} % off, damping {100 * errors[1]:.2g} %; "
        f"95 % bands hold {held[:, 0].sum()} and {held[:, 1].sum()} of {len(held)}"
    )
    for one in left_out:
        if len(one.held) and one.held[:, 0].mean() < WRONG:
            say(
                f"warning: {one.name}: {int((~one.held[:, 0]).sum())} of {len(one.held)} frequencies lie outside of "
                "what the other postures say; is it the posture that --pose states?"
            )


def _show(case: SpatialCase, learned: LearnedPostures) -> None:
    """A row for each posture: what was measured, and how far the model was off."""
    rows = []
    for one, pairs, evidence in zip(learned.measured, learned.pairs, learned.frequency_ratios(), strict=True):
        first = f"{one.frequencies.min():.2f}"
        off = 100 * float(np.sqrt(np.mean((evidence - 1) ** 2)))
        posture = shown_values(case.robot.mechanism, one.driven)
        rows.append((one.name, posture, f"{len(pairs)} of {len(one.frequencies)}", first, f"{off:.2g}"))
    columns = ("model", "posture", "modes paired", "lowest (Hz)", "model off by (%)")
    show(Table("Measured postures", columns, tuple(rows)))
