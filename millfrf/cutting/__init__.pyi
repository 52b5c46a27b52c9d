from .chip_law import ChipLaw, equivalent_chip, equivalent_chips
from .cuts_in_words import ANY_MILL, law_in_words, refuse_varied, shape_in_words
from .cutter_table import CutterShape, CutterTable
from .cutting_file import CuttingTable, process_from_table, read_cutter, read_cutting_process, write_cutting_process
from .directional import (
    average_directional_matrix,
    chip_direction,
    damping_harmonics,
    directional_harmonics,
    directional_matrix,
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
from .earlier_motions import EarlierMotions, PieceNodes
from .process import MillingProcess, immersion_angles
from .profile import (
    EdgeSlices,
    ProfileElement,
    ball_profile,
    bull_nose_profile,
    edge_slices,
    straight_profile,
    table_height,
    whole_slices,
)
from .published_coefficients import PUBLISHED
from .sliced_edge import EdgeForces, add_edge_forces, edge_example, summed_forces
from .tooth import (
    chip_forces,
    engaged_share,
    specific_forces,
    thin_chip_immersions,
    tooth_force,
    tooth_offsets,
    wrapped_immersion,
)
from .turning import approach_angle_of, turning_process
from .turning_table import TurningTable

__all__ = [
    "ANY_MILL",
    "PUBLISHED",
    "ChipLaw",
    "CutterShape",
    "CutterTable",
    "CuttingTable",
    "Drill",
    "DrillingLoad",
    "EarlierMotions",
    "EdgeForces",
    "EdgeSlices",
    "MillingProcess",
    "PieceNodes",
    "ProfileElement",
    "SettledDrill",
    "TurningTable",
    "add_edge_forces",
    "approach_angle_of",
    "average_directional_matrix",
    "ball_profile",
    "bending_stiffness",
    "bull_nose_profile",
    "chip_direction",
    "chip_forces",
    "damping_harmonics",
    "directional_harmonics",
    "directional_matrix",
    "drilling_load",
    "edge_example",
    "edge_slices",
    "engaged_share",
    "equivalent_chip",
    "equivalent_chips",
    "fitted_to_catalogue",
    "force_direction",
    "force_harmonics",
    "immersion_angles",
    "law_in_words",
    "process_from_table",
    "read_cutter",
    "read_cutting_process",
    "refuse_varied",
    "settled_drill",
    "shape_in_words",
    "specific_forces",
    "straight_profile",
    "summed_forces",
    "table_height",
    "thin_chip_immersions",
    "tooth_force",
    "tooth_offsets",
    "turn_harmonics",
    "turning_process",
    "whole_slices",
    "wrapped_immersion",
    "write_cutting_process",
]
