from .modal_lines import displacement_at, outside_displacement, receptance_at
from .modal_loops import add_outer, add_outside, driven_basis, modal_displacement, modal_slopes, outside_slopes
from .small_matrices import closed_loop, line_products

__all__ = [
    "add_outer",
    "add_outside",
    "closed_loop",
    "displacement_at",
    "driven_basis",
    "line_products",
    "modal_displacement",
    "modal_slopes",
    "outside_displacement",
    "outside_slopes",
    "receptance_at",
]
