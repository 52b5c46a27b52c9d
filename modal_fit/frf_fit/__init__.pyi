from .fit import fit_matrix
from .matrix_fit import NOT_REFINED, REFINED, MatrixFit
from .mode_selection import default_order
from .picked import fit_picked

__all__ = [
    "NOT_REFINED",
    "REFINED",
    "MatrixFit",
    "default_order",
    "fit_matrix",
    "fit_picked",
]
