from .compilation import compiled
from .cutting_file import CuttingTable, process_from_table, read_cutting_process
from .cutting_writer import write_cutting_process
from .directional import (
    average_directional_matrix,
    chip_direction,
    damping_harmonics,
    directional_harmonics,
    directional_matrix,
    force_direction,
    turn_harmonics,
)
from .drilling_force import Drill, DrillingLoad, SpecificForce, catalogue_load, drilling_load, fitted_to_catalogue
from .engaged_edge import damping_matrices, edge_matrices
from .force_fourier import force_harmonics
from .immersion import IMMERSIONS, immersion_angles
from .milling_process import MillingProcess
from .one_tooth import engaged_share, specific_forces, tooth_force, tooth_offsets, wrapped_immersion
from .refusal import refuse_varied
from .transverse_force import (
    SettledDrill,
    TransverseForce,
    bending_stiffness,
    edge_thicknesses,
    resultant_force,
    settled_drill,
)

__all__ = [
    "IMMERSIONS",
    "CuttingTable",
    "Drill",
    "DrillingLoad",
    "MillingProcess",
    "SettledDrill",
    "SpecificForce",
    "TransverseForce",
    "average_directional_matrix",
    "bending_stiffness",
    "catalogue_load",
    "chip_direction",
    "compiled",
    "damping_harmonics",
    "damping_matrices",
    "directional_harmonics",
    "directional_matrix",
    "drilling_load",
    "edge_matrices",
    "edge_thicknesses",
    "engaged_share",
    "fitted_to_catalogue",
    "force_direction",
    "force_harmonics",
    "immersion_angles",
    "process_from_table",
    "read_cutting_process",
    "refuse_varied",
    "resultant_force",
    "settled_drill",
    "specific_forces",
    "tooth_force",
    "tooth_offsets",
    "turn_harmonics",
    "wrapped_immersion",
    "write_cutting_process",
]
