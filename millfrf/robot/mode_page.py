"""A page that turns the robot, plays its mode shapes and tells its numbers: one file, no network."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files

import numpy as np
from jinja2 import Template

from robot_model import StructureModes

_MOST = 12
"""Modes on the page."""


@dataclass(frozen=True)
class Fact:
    """A table below the picture: heading, names of the columns, rows of text."""

    heading: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def mode_page(
    name: str,
    modes: StructureModes,
    lines: list[tuple[int, int]],
    facts: Sequence[Fact] = (),
    warnings: Sequence[str] = (),
) -> str:
    """HTML of an interactive picture: drag turns it, a list chooses the mode, a slider the exaggeration.

    Without modes the robot stands still. Joints are drawn as short lines along their axes.
    """
    count = min(_MOST, len(modes.squares))
    shapes = modes.shapes[:count, :, :3]
    largest = np.linalg.norm(shapes, axis=2).max(axis=1, initial=0.0)
    data = {
        "positions": modes.structure.positions.round(5).tolist(),
        "tip": modes.structure.tip,
        "lines": [list(pair) for pair in lines],
        "joints": [
            [spring.place.round(5).tolist(), spring.axes[:, 2].round(5).tolist()] for spring in modes.structure.springs
        ],
        "frequencies": modes.frequencies[:count].round(3).tolist(),
        "shapes": (shapes / np.maximum(largest, 1e-300)[:, None, None]).round(4).tolist(),
    }
    template = Template((files("millfrf.robot") / "mode_page.html.j2").read_text(encoding="utf-8"), autoescape=True)
    return str(template.render(name=name, data=json.dumps(data), facts=facts, warnings=warnings))
