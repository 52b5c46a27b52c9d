"""The step from a robot's file and modal models measured in several postures to learned postures."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError, writing_whole_file
from millfrf.robot_model import (
    LearnedPostures,
    LeftOutPosture,
    SpatialCase,
    learn_postures,
    left_out_postures,
    measured_modes,
    read_robot,
    shown_values,
    tool_down,
    write_learned_postures,
)
from modal_fit import read_modal_model

from ...options import check_output
from ...progress import bar
from ...provenance import add_to_json, origin
from ...tables import Table, show
from ...terminal import say
from ..asked_loads import check_degrees
from ..postures import Asked, posture_of, spatial
from .posture_choice import WorkArea, show_next_postures

Real = NDArray[np.float64]

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
