"""Robots as data: posture to stiffness, modes, receptance and deviation; knows nothing of recordings."""

from .exact_beam import planar_dynamic_stiffness, spatial_dynamic_stiffness
from .exact_chain import coupled_receptance, exact_receptance
from .identification import Identification, identify
from .modal_damping import modal_damping_matrix, rayleigh_constants
from .modal_reduction import modal_model
from .planar_file import PlanarCase, read_planar_robot
from .planar_identification import apply_identified, identify_from_frequencies, identify_from_frfs
from .planar_robot import PlanarRobot
from .receptance_coupling import block_diagonal, couple_receptances
from .rigid_links import rigid_matrices, rigid_model
from .robot_files import assumptions, robot_names
from .section import Material, Section, hollow_circle

__all__ = [
    "Identification",
    "Material",
    "PlanarCase",
    "PlanarRobot",
    "Section",
    "apply_identified",
    "assumptions",
    "block_diagonal",
    "couple_receptances",
    "coupled_receptance",
    "exact_receptance",
    "hollow_circle",
    "identify",
    "identify_from_frequencies",
    "identify_from_frfs",
    "modal_damping_matrix",
    "modal_model",
    "planar_dynamic_stiffness",
    "rayleigh_constants",
    "read_planar_robot",
    "rigid_matrices",
    "rigid_model",
    "robot_names",
    "spatial_dynamic_stiffness",
]
