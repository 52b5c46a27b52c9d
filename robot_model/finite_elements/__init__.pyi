from .beam_element import beam_mass, beam_stiffness
from .constrained_statics import constrained_system, tip_compliance, tip_stiffness
from .generalised_coordinates import coordinate_basis
from .gravity import STANDARD_GRAVITY, gravity_hessian, gravity_stiffness, gravity_torques, with_gravity
from .modal_damping import modal_damping_matrix, rayleigh_constants
from .modal_reduction import from_real_modes, modal_model
from .section import Material, Section, hollow_circle, tube_diameters
from .structure import (
    Beam,
    Body,
    Drive,
    Spring,
    Structure,
    cross_matrix,
    mass_matrix,
    rigid_motion,
    rigid_rows,
    six_by_six,
    stiffness_matrix,
)

__all__ = [
    "STANDARD_GRAVITY",
    "Beam",
    "Body",
    "Drive",
    "Material",
    "Section",
    "Spring",
    "Structure",
    "beam_mass",
    "beam_stiffness",
    "constrained_system",
    "coordinate_basis",
    "cross_matrix",
    "from_real_modes",
    "gravity_hessian",
    "gravity_stiffness",
    "gravity_torques",
    "hollow_circle",
    "mass_matrix",
    "modal_damping_matrix",
    "modal_model",
    "rayleigh_constants",
    "rigid_motion",
    "rigid_rows",
    "six_by_six",
    "stiffness_matrix",
    "tip_compliance",
    "tip_stiffness",
    "tube_diameters",
    "with_gravity",
]
