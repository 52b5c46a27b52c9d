from .modal_lines import displacement_at, receptance_at
from .modal_loops import add_outer, driven_basis, modal_displacement, modal_slopes, outside_slopes
from .small_matrices import closed_loop, line_products

__all__ = [
    "add_outer",
    "closed_loop",
    "displacement_at",
    "driven_basis",
    "line_products",
    "modal_displacement",
    "modal_slopes",
    "outside_slopes",
    "receptance_at",
]
