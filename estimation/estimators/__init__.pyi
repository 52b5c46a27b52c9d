from .error_in_variables import h2, hv, instrumental_variable
from .least_squares import h1, h1_side_by_side
from .local_polynomials import local_half_width, local_polynomial

__all__ = [
    "h1",
    "h1_side_by_side",
    "h2",
    "hv",
    "instrumental_variable",
    "local_half_width",
    "local_polynomial",
]
