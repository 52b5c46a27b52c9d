"""A page that turns the robot and plays its mode shapes: one file, no network."""

import json
from importlib.resources import files

import numpy as np
from jinja2 import Template

from robot_model import StructureModes

_MOST = 12
"""Modes on the page."""


def mode_page(name: str, modes: StructureModes, lines: list[tuple[int, int]]) -> str:
    """HTML of an interactive picture: drag turns it, a list chooses the mode, a slider the exaggeration."""
    count = min(_MOST, len(modes.squares))
    shapes = modes.shapes[:count, :, :3]
    largest = np.linalg.norm(shapes, axis=2).max(axis=1)
    data = {
        "positions": modes.structure.positions.round(5).tolist(),
        "tip": modes.structure.tip,
        "lines": [list(pair) for pair in lines],
        "frequencies": modes.frequencies[:count].round(3).tolist(),
        "shapes": (shapes / np.maximum(largest, 1e-300)[:, None, None]).round(4).tolist(),
    }
    template = Template((files("millfrf.robot") / "mode_page.html.j2").read_text(encoding="utf-8"), autoescape=True)
    return str(template.render(name=name, data=json.dumps(data)))
