"""Milling and drilling forces, and directional coefficients; knows nothing of structures."""

from .cutting_file import CuttingTable, process_from_table, read_cutting_process, write_cutting_process
from .directional import (
    average_directional_matrix,
    chip_direction,
    damping_harmonics,
    damping_matrices,
    directional_harmonics,
    directional_matrix,
    edge_matrices,
    force_direction,
    force_harmonics,
    turn_harmonics,
)
from .drilling import (
    Drill,
    DrillingLoad,
    SettledDrill,
    bending_stiffness,
    drilling_load,
    fitted_to_catalogue,
    settled_drill,
)
from .process import MillingProcess, immersion_angles, refuse_varied
from .tooth_force import engaged_share, specific_forces, tooth_force, tooth_offsets, wrapped_immersion

__all__ = [
    "CuttingTable",
    "Drill",
    "DrillingLoad",
    "MillingProcess",
    "SettledDrill",
    "average_directional_matrix",
    "bending_stiffness",
    "chip_direction",
    "damping_harmonics",
    "damping_matrices",
    "directional_harmonics",
    "directional_matrix",
    "drilling_load",
    "edge_matrices",
    "engaged_share",
    "fitted_to_catalogue",
    "force_direction",
    "force_harmonics",
    "immersion_angles",
    "process_from_table",
    "read_cutting_process",
    "refuse_varied",
    "settled_drill",
    "specific_forces",
    "tooth_force",
    "tooth_offsets",
    "turn_harmonics",
    "wrapped_immersion",
    "write_cutting_process",
]
