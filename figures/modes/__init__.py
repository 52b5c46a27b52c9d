"""Figures of modal models: vectors, shapes, stabilisation charts, indicators and synthesis."""

from .indicators import indicator_figure
from .mode import mode_figure
from .shapes import assurance_figure, compass_figure
from .stabilisation import stabilisation_figure
from .synthesis import synthesis_figure

__all__ = [
    "assurance_figure",
    "compass_figure",
    "indicator_figure",
    "mode_figure",
    "stabilisation_figure",
    "synthesis_figure",
]
