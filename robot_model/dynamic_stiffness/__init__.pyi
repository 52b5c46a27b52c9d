from .exact_beam import planar_dynamic_stiffness, spatial_dynamic_stiffness
from .exact_chain import coupled_receptance, exact_receptance
from .exact_structure import coupled_frf_at, exact_frf_at
from .receptance_coupling import block_diagonal, couple_along, couple_receptances

__all__ = [
    "block_diagonal",
    "couple_along",
    "couple_receptances",
    "coupled_frf_at",
    "coupled_receptance",
    "exact_frf_at",
    "exact_receptance",
    "planar_dynamic_stiffness",
    "spatial_dynamic_stiffness",
]
