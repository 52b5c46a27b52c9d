"""A page that turns the robot, plays its mode shapes and tells its numbers: one file, no network."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from millfrf.figures import MovingShapes
from millfrf.robot_model import StructureModes

from ...provenance import versions
from ...report import ResultsPage, Section, page_text, picture_of
from ...tables import Table
from .drawn_robot import robot_figure, skeleton

_MOST = 12
"""Modes on the page."""

_AXIS = 0.09
"""Half the length of the line that shows the axis of a joint, m."""


@dataclass(frozen=True)
class Fact:
    """A table below the picture: heading, names of the columns, rows of text."""

    heading: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def mode_page(
    name: str,
    modes: StructureModes,
    facts: Sequence[Fact] = (),
    warnings: Sequence[str] = (),
) -> str:
    """HTML of an interactive picture: drag or arrow keys turn it, a list chooses the mode, a slider the exaggeration.

    Without modes the robot stands still. Joints are drawn as short lines along their axes.
    """
    moving = _moving(modes)
    frequencies = ", ".join(f"{frequency:.2f}" for frequency in modes.frequencies[:4])
    verdict = (
        f"The lowest natural frequencies are {frequencies} Hz." if frequencies else "Without masses it has no modes."
    )
    told = tuple(
        f"{row[0].capitalize()}: {row[1]}." for fact in facts for row in fact.rows if row[0].startswith("softest")
    )
    page = ResultsPage(
        "Robot in a posture", name, f"Made by millfrf {versions()['millfrf']}", (verdict, *told), tuple(warnings)
    )
    caption = "Grey: at rest; orange: tool tip; black lines: axes of the joints. Displacements are exaggerated."
    words = f"{name} with its mode shapes" if len(moving.labels) else f"{name} at rest"
    picture = picture_of(robot_figure(modes), caption, words, moving=moving)
    tables = [Section(fact.heading, tables=(Table(fact.heading, fact.columns, fact.rows),)) for fact in facts]
    rows = tuple((str(k + 1), f"{frequency:.3f}") for k, frequency in enumerate(modes.frequencies[:_MOST]))
    listed = Section("Natural frequencies", tables=(Table("Modes", ("mode", "frequency (Hz)"), rows),) if rows else ())
    shown = Section("Mode shapes" if len(moving.labels) else "Robot", pictures=(picture,))
    return page_text(page, [shown, listed, *tables])


def _moving(modes: StructureModes) -> MovingShapes:
    """Shapes with largest displacement 1, and the axes of the joints."""
    count = min(_MOST, len(modes.squares))
    shapes = modes.shapes[:count, :, :3]
    largest = np.linalg.norm(shapes, axis=2).max(axis=1, initial=0.0)
    axes = tuple(
        (
            (spring.place - _AXIS * spring.axes[:, 2]).round(5).tolist(),
            (spring.place + _AXIS * spring.axes[:, 2]).round(5).tolist(),
        )
        for spring in modes.structure.springs
    )
    return MovingShapes(
        modes.structure.positions,
        tuple(skeleton(modes)),
        (shapes / np.maximum(largest, 1e-300)[:, None, None]).astype(complex),
        tuple(f"{k + 1}: {frequency:.2f} Hz" for k, frequency in enumerate(modes.frequencies[:count])),
        np.ones(len(modes.structure.positions), dtype=bool),
        axes,
        modes.structure.tip,
    )
