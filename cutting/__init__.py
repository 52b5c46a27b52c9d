"""Milling forces and directional coefficients: knows nothing of structures."""

from .cutting_file import read_cutting_process
from .directional import (
    average_directional_matrix,
    chip_direction,
    directional_harmonics,
    directional_matrix,
    force_direction,
)
from .force_harmonics import force_harmonics
from .milling_process import MillingProcess

__all__ = [
    "MillingProcess",
    "average_directional_matrix",
    "chip_direction",
    "directional_harmonics",
    "directional_matrix",
    "force_direction",
    "force_harmonics",
    "read_cutting_process",
]
